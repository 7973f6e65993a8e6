"""Write what truly happened into the recording of a simulated grasp, beside the events that the engine gets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from slipd.events import Event
from slipd.types.finite import finite_or_none
from slipd_client.messages import encode

if TYPE_CHECKING:
    from slipd.tools.sim.offline_grasp import Log
    from slipd.tools.sim.stickslip import GraspTrace

TRUTH = "truth"
"""Channel of a recording with the truth; no daemon publishes such a topic.

An entry has ``t_ns`` (CLOCK_MONOTONIC), ``sliding`` (the object slides as a whole) and ``utilisation`` (1 slips; nil
without a contact). It holds until the next.
"""

EVERY_S = 0.01
"""Longest time from one entry to the next, s; a change of ``sliding`` is written at once."""

ROUNDING_S = 1e-9


class TruthLog:
    """Pass the entries of a run on to a recording, with the truth between them.

    Args:
        log: The recording.
        trace: The grasp.
        begin_ns: CLOCK_MONOTONIC at the first sample of the trace.

    Attributes:
        entries: Number of entries so far, for ``finish``.
    """

    def __init__(self, log: Log, trace: GraspTrace, begin_ns: int) -> None:
        self.entries = 0
        self._log = log
        self._truth = _due(trace, begin_ns)
        self._next = next(self._truth, None)

    def event(self, n: int, t_ns: int, event: Event) -> None:
        """Write an event, after the truth that is due by then; its own index takes the place of ``n``."""
        while self._next is not None and self._next[0] <= t_ns:
            at_ns, payload = self._next
            self._log.published(self.entries, at_ns, TRUTH, payload)
            self.entries += 1
            self._next = next(self._truth, None)
        self._log.event(self.entries, t_ns, event)
        self.entries += 1

    def published(self, n: int, t_ns: int, topic: str, payload: bytes) -> None:
        """Write a message; its own index takes the place of ``n``."""
        self._log.published(self.entries, t_ns, topic, payload)
        self.entries += 1


def _due(trace: GraspTrace, begin_ns: int) -> Iterator[tuple[int, bytes]]:
    """Yield when each entry is due, and its bytes."""
    last_s, was_sliding = float("-inf"), False
    times_s = (trace.t_s - trace.t_s[0]).tolist()
    for t_s, sliding, used in zip(times_s, trace.gross.tolist(), trace.utilisation.tolist(), strict=True):
        if t_s - last_s < EVERY_S - ROUNDING_S and sliding == was_sliding:
            continue
        last_s, was_sliding = t_s, sliding
        t_ns = begin_ns + round(t_s * 1e9)
        yield t_ns, encode({"t_ns": t_ns, "sliding": sliding, "utilisation": finite_or_none(used)})
