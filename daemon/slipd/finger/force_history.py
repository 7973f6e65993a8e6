"""Force readings of the recent past, for the images of the pad beside the sensor."""

from __future__ import annotations

import math
from collections import deque

from slipd.finger.force_summary import NO_SUMMARY, ForceSummary
from slipd.finger.verdict_batch import VerdictBatch
from slipd.fusion.rows import FREE, TOUCHING
from slipd.fusion.streaming import wrench_at

MOVING_STDS = 6.0
"""The normal force moves where its range between two images exceeds this many standard deviations of its noise."""
PAST_NS, PASTS = 1_000_000, 128
"""One reading in this time is kept, and so many in all: the longest scan of a pad takes a tenth of a second."""


class ForceHistory:
    """Range of the normal force since the newest image, and wrenches of the last 128 ms at least.

    Args:
        noise_n: Standard deviation of a force component, N.
    """

    def __init__(self, noise_n: float) -> None:
        self._moving_n = MOVING_STDS * noise_n
        self._low_n, self._high_n = math.inf, -math.inf
        self._past: deque[tuple[int, tuple[float, ...]]] = deque(maxlen=PASTS)

    def update(self, batch: VerdictBatch) -> None:
        """Add the readings of one read that can be trusted."""
        last_ns = self._past[-1][0] if self._past else -PAST_NS
        rows, times_ns, phases = batch.readings.rows, batch.readings.times_ns, batch.phases
        for k, normal_n in enumerate(rows["contact"]["normal_n"].tolist()):
            if phases[k] not in (TOUCHING, FREE):
                continue
            t_ns = times_ns[k]
            if t_ns - last_ns >= PAST_NS:
                self._past.append((t_ns, wrench_at(rows, k)))
                last_ns = t_ns
            if normal_n < self._low_n:
                self._low_n = normal_n
            if normal_n > self._high_n:
                self._high_n = normal_n

    def take_summary(self, normal_n: float | None, *, free: bool, agrees: bool) -> ForceSummary:
        """Return what the force sensor measured since the image before, and begin the next interval.

        Args:
            normal_n: Normal force now, N; None: it is not known.
            free: Nothing touches the pad by it.
            agrees: Force and images did not contradict each other so far.
        """
        if normal_n is None:
            return NO_SUMMARY
        moving = self._high_n - self._low_n > self._moving_n
        self._low_n = self._high_n = normal_n
        return ForceSummary(free, normal_n, moving, agrees)

    def mean_wrench(self, since_ns: int, until_ns: int) -> tuple[float, ...]:
        """Return the mean wrench of the kept readings between two times.

        If no reading is kept of that interval, this is the wrench of the reading nearest to its end.

        Args:
            since_ns: CLOCK_MONOTONIC; a reading of this time does not count.
            until_ns: Likewise; a reading of this time counts.

        Raises:
            IndexError: There was no reading yet.
        """
        found = []
        for t_ns, wrench in reversed(self._past):
            if t_ns <= since_ns:
                break
            if t_ns <= until_ns:
                found.append(wrench)
        if not found:
            return self.wrench_at(until_ns)
        share = 1.0 / len(found)
        return tuple([share * sum(component) for component in zip(*found, strict=True)])

    def wrench_at(self, t_ns: int) -> tuple[float, ...]:
        """Return the wrench of the kept reading nearest to ``t_ns``, in the pad frame: N and N·m, six numbers.

        Raises:
            IndexError: There was no reading yet.
        """
        nearest = self._past[-1]
        for past in reversed(self._past):
            if abs(past[0] - t_ns) > abs(nearest[0] - t_ns):
                break
            nearest = past
        return nearest[1]
