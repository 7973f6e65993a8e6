"""A session and an emulator on one line, under one simulated clock."""

from __future__ import annotations

from typing import Any

from nanoseconds import MS


def drive(session: Any, emulator: Any, seconds: float, *, begin_ns: int = 0, start: bool = True) -> list[Any]:
    """Play in steps of a millisecond; return the readings."""
    samples: list[Any] = []
    asked = [session.start(begin_ns)] if start else []
    for now_ns in range(begin_ns + MS, begin_ns + round(seconds * 1000) * MS + 1, MS):
        said = [answer for request in asked if request for answer in emulator.receive(request, now_ns)]
        for piece in said + emulator.advance(now_ns):
            samples += session.receive(piece, now_ns)
        asked = []
        while (due := session.next_deadline()) is not None and due <= now_ns:
            asked.append(session.on_time(now_ns))
    return samples
