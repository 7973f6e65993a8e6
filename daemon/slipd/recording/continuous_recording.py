"""The whole run in files that follow each other, each complete by itself; the oldest are deleted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from slipd.config import Continuous
from slipd.events import Event, FirstEvents, Record, RecordingChanged
from slipd.recording.requested_recordings import RequestedRecordings
from slipd.requests.recording_state import utc_stamp
from slipd.types.wall_clock import WallClock

RETRY_NS = 60_000_000_000
"""Time from the failure of a file to the next attempt, ns."""

KIND = "run"


class ContinuousRecording:
    """Begins a new file when the present one is old or large enough; nothing is lost in between.

    Args:
        recordings: Writes the files, one at a time.
        limits: ``[recording.continuous]``.
        name: Returns the name of a file that begins at a time, without kind, number and suffix.
    """

    def __init__(self, recordings: RequestedRecordings, limits: Continuous, name: Callable[[int], str]) -> None:
        self._recordings = recordings
        self._limits = limits
        self._name_at = name
        self._name = ""
        self._count = 0
        self._due_ns: int | None = None

    def event(self, event: Event, t_ns: int) -> None:
        """Record an event that enters the engine at ``t_ns``."""
        self._recordings.event(event, t_ns)

    def published(self, topic: str, payload: bytes, t_ns: int) -> None:
        """Record the bytes that were published."""
        self._recordings.published(topic, payload, t_ns)

    def changes(self, t_ns: int, first: Callable[[], FirstEvents]) -> list[RecordingChanged]:
        """Begin a new file if it is time; return the changes that the engine must know, each once.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            first: Returns the events that precede a file that begins now.
        """
        changes = [change for change in self._recordings.changes(t_ns) if change.name == self._name]
        if any(change.state != "running" for change in changes):
            self._due_ns = t_ns + RETRY_NS
        elif self._due_ns is None or t_ns >= self._due_ns or self._recordings.size_bytes >= self._limits.file_bytes:
            self._begin(t_ns, first())
        return [replace(change, name="") for change in changes]

    def _begin(self, t_ns: int, first: FirstEvents) -> None:
        self._count += 1
        self._name = f"{KIND}-{self._name_at(t_ns)}-{self._count:04}.mcap"
        self._due_ns = t_ns + round(self._limits.file_s * 1e9)
        self._recordings.handle(Record(self._name, first), t_ns)

    def close(self) -> None:
        """Finish the file."""
        self._recordings.close()


def run_name(boot: str, wall: WallClock) -> Callable[[int], str]:
    """Return what names a file of a run by the time at which it begins."""
    return lambda t_ns: f"{utc_stamp(wall.at_ns(t_ns))}-{boot}"
