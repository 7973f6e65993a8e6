"""Recordings on request: which runs, what its file is called, and what became of it. Files are the service's."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

from slipd.grip.policy import Refusal
from slipd.pipeline.events import Record, RecordingFailed

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
#: A replayed file may tell any clock; this one ends in the year 5138.
_SPAN_S = 10**11


class Recordings:
    """The recordings of one run, one at a time. No client chooses a name: a name is a path.

    Args:
        boot: Id of this run.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.
    """

    def __init__(self, boot: str, wall_minus_monotonic_ns: int) -> None:
        self._boot = boot
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._count = 0
        self._name = ""
        self._running = False
        self._failure = ""
        self._due: list[Record] = []

    def start(self, t_ns: int) -> dict[str, Any] | Refusal:
        """Begins one; its name tells the time by the wall clock, the run, and the how manieth of the run it is."""
        if self._running:
            return Refusal("not_ready", f"{self._name} is being recorded: record.stop ends it")
        self._count += 1
        wall_s = (t_ns + self._wall_minus_monotonic_ns) // 10**9 % _SPAN_S
        time = (_EPOCH + timedelta(seconds=wall_s)).strftime("%Y%m%dT%H%M%SZ")
        self._name, self._running, self._failure = f"slipd-{time}-{self._boot}-{self._count}.mcap", True, ""
        self._due.append(Record(self._name))
        return {"name": self._name}

    def stop(self) -> dict[str, Any] | Refusal:
        """Ends the one that runs."""
        if not self._running:
            return Refusal("not_ready", self._failure or "nothing is being recorded: record.start begins it")
        self._running = False
        self._due.append(Record(""))
        return {"name": self._name}

    def fail(self, event: RecordingFailed) -> None:
        """Takes note that one stopped, though not of one that is over."""
        if event.name == self._name:
            self._running, self._failure = False, event.reason

    def due(self) -> list[Record]:
        """What is to be begun or ended since this was last asked."""
        due, self._due = self._due, []
        return due

    def body(self) -> dict[str, Any]:
        """``recording`` of the status: the newest one."""
        return {"name": self._name or None, "running": self._running, "failure": self._failure or None}
