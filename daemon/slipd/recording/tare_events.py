"""The tares of a run, for files that begin later: their requests, with the readings before and during each."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from slipd.events import Bytes, Event, Request

TARE_LEAD_NS = 500_000_000
"""Readings that are kept from before a tare, which needs fresh ones, and from after its end, ns."""

TARES = 4
"""Requests for a tare that are kept of each sensor: the newest may have been refused."""

_TARE_S, _LONGEST_S = 1.0, 60.0
"""Longest time of a tare whose request states none, and of any, s."""


class Entered(NamedTuple):
    """An event that entered the engine, in the order of its index."""

    n: int
    t_ns: int
    event: Event


class TareEvents:
    """Keeps the readings of the last tares of each sensor, so that a later beginning has the same zero."""

    def __init__(self) -> None:
        self._recent: deque[Entered] = deque()
        self._kept: dict[tuple[object, object], deque[list[Entered]]] = {}
        self._growing: list[tuple[int, list[Entered]]] = []  # until when, and what is kept

    def update(self, entered: Entered) -> None:
        """Update with an event that enters the engine."""
        event, recent = entered.event, self._recent
        if isinstance(event, Request) and event.body.get("op") in ("tare", "tare.undo"):
            self._note_request(event, entered)
            return
        if not isinstance(event, Bytes):
            return
        recent.append(entered)
        while recent[0].t_ns < entered.t_ns - TARE_LEAD_NS:
            recent.popleft()
        for _, kept in self._growing:
            kept.append(entered)
        if self._growing:
            self._growing = [one for one in self._growing if one[0] > entered.t_ns]

    def _note_request(self, request: Request, entered: Entered) -> None:
        body = request.body
        kept = self._kept.setdefault((body.get("finger"), body.get("stream")), deque(maxlen=TARES))
        seconds = body.get("seconds", _TARE_S)
        window = [*self._recent, entered]
        kept.append(window)
        if isinstance(seconds, (int, float)) and 0.0 < seconds < _LONGEST_S:
            self._growing.append((entered.t_ns + round(seconds * 1e9) + TARE_LEAD_NS, window))

    def before(self, n: int) -> list[Entered]:
        """Return the kept events before the index ``n``, in order."""
        windows = (window for kept in self._kept.values() for window in kept)
        return sorted({one.n: one for window in windows for one in window if one.n < n}.values())
