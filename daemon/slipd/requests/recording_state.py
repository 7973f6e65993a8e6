"""State of the recordings: which one runs, the name of its file, and how it ended. The service writes the files."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

from slipd.events import Record, RecordingChanged, Request
from slipd.types.clocks import WallClock
from slipd.types.refusal import Refusal

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_SPAN_S = 10**11
"""Largest wall time in a name, in the year 5138; a replayed file may contain any time."""

_CODES = {"limited": "no_room", "failed": "record_failed"}
"""Error code of a `record.start` whose recording did not begin, by the state that was reported instead."""


def utc_stamp(wall_ns: int) -> str:
    """Return a wall time for the name of a file, such as "20261122T221300Z"."""
    return (_EPOCH + timedelta(seconds=wall_ns // 10**9 % _SPAN_S)).strftime("%Y%m%dT%H%M%SZ")


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
        self._waiting: dict[str, Request] = {}
        self._due: list[Record] = []

    def start(self, request: Request, t_ns: int) -> Refusal | None:
        """Start a recording; return None where the reply must wait for the disk (`settle`)."""
        if self._running:
            return Refusal("not_ready", f"{self.requested.name} is being recorded: end it with record.stop")
        self._count += 1
        name = f"slipd-{utc_stamp(self._wall.at_ns(t_ns))}-{self._boot}-{self._count}.mcap"
        self.requested = RecordingChanged(name, "", "running")
        self._waiting[name] = request
        self._due.append(Record(name))
        return None

    def stop(self) -> RecordingChanged | Refusal:
        """End the recording that runs, and return it."""
        recording = self.requested
        if not self._running:
            return Refusal("not_ready", recording.reason or "nothing is being recorded: begin with record.start")
        self.requested = replace(recording, state="stopped")
        self._due.append(Record(""))
        return self.requested

    def settle(self, event: RecordingChanged) -> tuple[Request, RecordingChanged | Refusal] | None:
        """Note the new state of a recording.

        Returns:
            The request that waited for it, and the recording or why it did not begin; None where no request waited.
        """
        if not event.name:
            self.whole_run = event
            return None
        if event.name == self.requested.name:
            if self._running or event.state == "failed":
                self.requested = event
            elif event.state == "running":  # its file was created only after its record.stop
                self.requested = replace(event, state="stopped")
        waiting = self._waiting.pop(event.name, None)
        if waiting is None:
            return None
        if event.state == "running":
            return waiting, event
        return waiting, Refusal(_CODES.get(event.state, "record_failed"), event.reason)

    def due(self) -> list[Record]:
        """Return the recordings to start or end since the last call."""
        due, self._due = self._due, []
        return due

    @property
    def _running(self) -> bool:
        return self.requested.state == "running"
