"""State of the recordings: which one runs, the name of its file, and how it ended. The service writes the files."""

from __future__ import annotations

from dataclasses import replace

from slipd.events import Body, Record, RecordingChanged, Request, WallClock
from slipd.types.permit import RefusalError


class RecordingState:
    """Recordings of one run: one on request at a time, and one of the whole run where there is one.

    The daemon names the files, as a name from a client could be any path.

    Args:
        boot: Id of this run.
        wall: Wall clock of the run.

    Attributes:
        requested: The newest recording on request; its state is "none" before the first.
        whole_run: The recording of the whole run; None where there is none.
    """

    def __init__(self, boot: str, wall: WallClock) -> None:
        self._boot = boot
        self._wall = wall
        self._count = 0
        self.requested = RecordingChanged("", "", "none")
        self.whole_run: RecordingChanged | None = None
        self._waiting: dict[str, tuple[Request, Body]] = {}
        self._due: list[Record] = []

    def start(self, request: Request, t_ns: int) -> Body:
        """Start a recording; return its reply, which is empty until the disk has answered (`note`).

        Raises:
            RefusalError: One is running.
        """
        if self._running:
            rule = f"{self.requested.name} is being recorded: end it with record.stop"
            raise RefusalError("not_ready", rule)
        self._count += 1
        name = f"slipd-{self._wall.stamp(t_ns)}-{self._boot}-{self._count}.mcap"
        self.requested = RecordingChanged(name, "", "running")
        self._due.append(Record(name))
        reply: Body = {}
        self._waiting[name] = request, reply
        return reply

    def stop(self) -> RecordingChanged:
        """End the recording that runs, and return it.

        Raises:
            RefusalError: None is running.
        """
        recording = self.requested
        if not self._running:
            rule = recording.reason or "nothing is being recorded: begin with record.start"
            raise RefusalError("not_ready", rule)
        self.requested = replace(recording, state="stopped")
        self._due.append(Record(""))
        return self.requested

    def note(self, event: RecordingChanged) -> tuple[Request, Body] | None:
        """Note the new state of a recording; return the request that waited for it, if one did, and its empty reply."""
        if not event.name:
            self.whole_run = event
            return None
        if event.name == self.requested.name:
            if self._running or event.state == "failed":
                self.requested = event
            elif event.state == "running":  # its file was created only after its record.stop
                self.requested = replace(event, state="stopped")
        return self._waiting.pop(event.name, None)

    def due(self) -> list[Record]:
        """Return the recordings to start or end since the last call."""
        due, self._due = self._due, []
        return due

    @property
    def _running(self) -> bool:
        return self.requested.state == "running"
