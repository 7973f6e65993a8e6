"""A device's own clock told in the host's monotonic time.

A receipt is late by a delay that is never negative, bunched and heavy-tailed, so what is true of the clock shows in
the readings that were late the least: the line beneath all pairs of device time and receipt. Of each slice of time the
least late reading is kept; the line is the edge of their lower convex hull that leaves the least sum of lateness
(Zhang, Liu and Xia, "Clock synchronization algorithms for network measurements", INFOCOM 2002), newer slices weighing
more. A least delay that never changes cannot be seen in a stream that goes one way: all times are late by it, and no
bound here holds it. ``delay_ns`` takes off what is known of it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import mul

#: Largest rate error of a clock, ppm: twice what crystals in use have.
MAX_PPM = 1_000.0
#: One reading is kept of each slice of so much time; a reset must be over within 1 s, so a line needs some soon.
SLICE_NS = 125_000_000
#: The line is laid under so many slices (8 s without gaps): long enough to know some ppm, short against warming.
SLICES = 64
#: Weight of a slice over that of the one after it: a changed rate is followed within some seconds.
FADE = 0.97
#: A line is laid after so much time and so many receipts.
SETTLE_NS, SETTLE_RECEIPTS = 500_000_000, 8
#: A clock that failed must run well for so long before it is believed again.
PROBATION_NS = 10_000_000_000
#: So many restarts without a steady time after them are a clock that jumps.
RESTARTS, STEADY_NS = 4, 10_000_000_000
#: Least bound: by so much waking up varies, however even the readings look.
LEAST_BOUND_NS = 20_000
#: Bound over the mean lateness of the kept readings; measured over the delays of the report.
BOUND_FACTOR = 4.0
#: Slices at which too few to know the mean lateness double the bound.
FEW = 4.0
#: More than this share of the reads hold several readings where reads are polls; share of one read in the average.
SHARED_READS, SHARED_FADE = 0.2, 1.0 / 32.0
#: Of what is open between two readings; half of it lies to each side, and the line's own error beside.
OPEN_SHARE = 0.6
#: Slices in which a read is sought that came just before the next reading: the phase drifts little in so long.
OPEN_SLICES = 8
#: A crystal's rate changes by so much within a stall, at most.
WANDER = 1e-6
#: A reading earlier than the line by 3 bounds and this is of another time line; so is one while the line settles.
EARLY_NS, EARLY_SETTLING_NS = 1_000_000, 50_000_000
#: So many slices that all came late alike, by this at least, are a step back of less than a period.
STEP_SLICES, STEP_NS = 6, 500_000
#: A rate is out of bounds by more than the noise from so many times mean lateness over length.
RATE_FACTOR = 6.0
#: A grid of device times finer than this is no rounding that matters.
FINEST_GRID_NS = 1_000
#: A pusher's own time may be so old: the longest that a reading waits for a loop that stalls.
OLDEST_HOST_NS = 10_000_000_000

_NEVER = 1 << 200  # no reading before: every device time lies behind it
_NOTHING_OPEN = (_NEVER, 0)


class DeviceClock:
    """Maps the times of one device's clock onto CLOCK_MONOTONIC, on line.

    Readings that come in one read have one receipt, and only the last of them says something of the delay. Where the
    device's clock jumps, a new line is begun; until it is laid (``SETTLE_NS``) readings get their receipt as their
    time, as they do without a clock. Times never go back while receipts do not: after a restart too.

    Args:
        span_ns: The device's clock begins anew after so long; None where it never does.
        delay_ns: Known part of the least delay from acquisition to receipt.

    Raises:
        ValueError: A span that is not positive, a delay that is negative.

    Attributes:
        state: "none" (no device time), "settling", "locked", or "not_a_clock" (its rate is off by more than
            ``MAX_PPM``, it is stuck, or it jumps).
    """

    def __init__(self, span_ns: int | None, *, delay_ns: int = 0) -> None:
        if span_ns is not None and span_ns <= 0:
            raise ValueError(f"span_ns must be positive, or None for a clock that never begins anew, not {span_ns}")
        if delay_ns < 0:
            raise ValueError(f"delay_ns must not be negative, not {delay_ns}")
        self._span_ns, self._delay_ns = span_ns, delay_ns
        self._told_ns = self._wanted_ns = 0
        self._slices: deque[tuple[int, int]] = deque(maxlen=SLICES)  # device time, receipt less device time
        self._opens: deque[tuple[int, int]] = deque(maxlen=OPEN_SLICES)
        self.forget()

    def forget(self) -> None:
        """Begin anew: the host slept or the link was lost, and what comes next may be another device."""
        self.state = "none"
        self._restarts, self._settle_ns = 0, SETTLE_NS
        self._raw_ns, self._receipt_ns = _NEVER, -1
        self._begin(0, 0)

    def map(self, device_time_ns: int | None, receipt_ns: int) -> int:
        """Time of acquisition of a reading on CLOCK_MONOTONIC, never after its receipt.

        Args:
            device_time_ns: The device's clock, as sent; None where the reading has none.
            receipt_ns: CLOCK_MONOTONIC when it was received, never falling.
        """
        receipt_ns -= self._delay_ns
        if device_time_ns is None:
            if self.state != "none":
                self.forget()
            self._wanted_ns = self._told_ns = receipt_ns
            return receipt_ns
        step = device_time_ns - self._raw_ns
        if step < 0 or receipt_ns != self._receipt_ns:
            self._go_on(device_time_ns, step, receipt_ns)
        else:
            self._device_ns += step
            self._raw_ns = device_time_ns
        told = receipt_ns
        if self._locked:
            told = self._device_ns + self._base_ns + int(self._slope * (self._device_ns - self._at_ns))
        self._wanted_ns = told
        if told < self._told_ns:
            told = self._told_ns
        if told > receipt_ns:
            told = receipt_ns
        self._told_ns = told
        return told

    @property
    def uncertainty_ns(self) -> int | None:
        """Bound on the error of the newest time beyond the constant least delay; None while not known."""
        if not self._locked:
            return None
        held = max(0, self._told_ns - self._wanted_ns)
        return round(self._bound_at(self._device_ns)) + held

    @property
    def drift_ppm(self) -> float | None:
        """By how much the device's clock is fast, ppm; None while not known."""
        return -1e6 * self._slope / (1.0 + self._slope) if self._locked else None

    def _go_on(self, device_time_ns: int, step: int, receipt_ns: int) -> None:
        """Take a reading that is the first of its read, or that lies behind the one before."""
        fresh = receipt_ns != self._receipt_ns
        if self.state == "none":
            self.state = "settling"
            self._begin(device_time_ns, receipt_ns)
        else:
            if step < 0 and self._span_ns is not None and step + self._span_ns <= self._span_ns // 2:
                step += self._span_ns
            if fresh:
                self._commit(step)
            if step < 0:
                self._restart(device_time_ns, receipt_ns)
            else:
                self._device_ns += step
                if fresh:
                    self._note_step(step)
        if fresh:
            self._first_ns = self._device_ns
        self._raw_ns, self._receipt_ns = device_time_ns, receipt_ns

    def _note_step(self, step: int) -> None:
        """Find the grid that the device's times lie on; where each step is one of the grid, it counts readings."""
        if not 0 < self._grid_ns <= FINEST_GRID_NS:
            self._grid_ns = math.gcd(self._grid_ns, step)
            self._least_step_ns = min(self._least_step_ns, step)

    def _commit(self, step: int) -> None:
        """Take the last reading of the read before this: of that read it was late the least.

        The reading after it, a ``step`` later, had not come by then. So a read that shows all there is leaves open by
        how much less than a step it was late; where reads and readings beat slowly, many reads tell no more.
        """
        device_ns, receipt_ns = self._device_ns, self._receipt_ns
        lag = receipt_ns - device_ns
        late = lag - self._lag_ns - int(self._slope * (device_ns - self._at_ns))
        early = EARLY_NS + 3.0 * self._bound_at(device_ns) if self._locked else EARLY_SETTLING_NS
        if late < -early:
            self._restart(device_ns, receipt_ns)
        elif late < 0:
            self._lag_ns += late
            self._base_ns += late
        self._receipts += 1
        self._shared += SHARED_FADE * ((device_ns != self._first_ns) - self._shared)
        if 0 <= step - late < self._open[0]:
            self._open = step - late, step
        tilted = lag - int(self._slope * (device_ns - self._at_ns))
        if self._least is None or tilted < self._least[0]:
            self._least = tilted, device_ns, lag
        if receipt_ns >= self._slice_end_ns:
            self._slices.append(self._least[1:])
            if self._open[1]:
                self._opens.append(self._open)
            self._least, self._open, self._slice_end_ns = None, _NOTHING_OPEN, receipt_ns + SLICE_NS
            if receipt_ns - self._from_ns >= self._settle_ns and self._receipts >= SETTLE_RECEIPTS:
                self._lay(receipt_ns)

    def _lay(self, receipt_ns: int) -> None:
        shared = bool(self._opens) and self._shared > SHARED_READS
        open_ns, period_ns = sorted(self._opens)[len(self._opens) // 2] if shared else (0, 0)
        line = lowest_line(self._slices)
        if line is None:
            self._fail(receipt_ns)
            return
        if line.stepped_ns > period_ns:
            while len(self._slices) > STEP_SLICES:
                self._slices.popleft()
            line = lowest_line(self._slices) or line
        self._slope, self._at_ns, self._lag_ns = line.slope, line.at_ns, line.lag_ns
        self._bound_ns, self._rate_bound = line.bound_ns, line.rate_bound
        rounded = self._grid_ns > FINEST_GRID_NS and self._grid_ns != self._least_step_ns
        grid_ns = self._grid_ns if rounded else 0
        self._bound_ns += OPEN_SHARE * open_ns + 0.5 * grid_ns
        self._rate_bound += open_ns / max(1, self._slices[-1][0] - self._slices[0][0])
        self._base_ns = line.lag_ns + (grid_ns - open_ns) // 2
        self._locked, self.state, self._settle_ns = True, "locked", SETTLE_NS
        if receipt_ns - self._from_ns >= STEADY_NS:
            self._restarts = 0

    def _bound_at(self, device_ns: int) -> float:
        return self._bound_ns + self._rate_bound * abs(device_ns - self._at_ns)

    def _restart(self, device_ns: int, receipt_ns: int) -> None:
        """Begin another line: the device's clock jumped."""
        self._restarts += 1
        if self._restarts >= RESTARTS:
            self._fail(receipt_ns)
        elif self._locked:
            self.state = "settling"
        self._begin(device_ns, receipt_ns)

    def _fail(self, receipt_ns: int) -> None:
        """Give up a clock that is none, and try it again for long."""
        self.state, self._settle_ns, self._restarts = "not_a_clock", PROBATION_NS, 0
        self._begin(self._device_ns, receipt_ns)

    def _begin(self, device_ns: int, receipt_ns: int) -> None:
        self._locked = False
        self._device_ns = self._at_ns = device_ns
        self._lag_ns = self._base_ns = receipt_ns - device_ns
        self._slope = self._bound_ns = self._rate_bound = 0.0
        self._slices.clear()
        self._least: tuple[int, int, int] | None = None
        self._receipts = 0
        self._from_ns, self._slice_end_ns = receipt_ns, receipt_ns + SLICE_NS
        self._grid_ns, self._least_step_ns = 0, _NEVER
        self._first_ns, self._shared, self._open = device_ns, 0.0, _NOTHING_OPEN
        self._opens.clear()


@dataclass(frozen=True, slots=True)
class Line:
    """The receipt of a reading that is not late: device time + lag + slope · (device time − at).

    Attributes:
        at_ns: Device time of the newest point.
        lag_ns: Receipt less device time there.
        slope: Host seconds a device second, less one.
        bound_ns: Bound on the line's error at ``at_ns``.
        rate_bound: Bound on the slope's error.
        stepped_ns: By so much the newest slices are late all alike: the clock was set back so far; 0 where not.
    """

    at_ns: int
    lag_ns: int
    slope: float
    bound_ns: float
    rate_bound: float
    stepped_ns: float


def lowest_line(points: Sequence[tuple[int, int]]) -> Line | None:
    """The line beneath points of device time and lag, time rising; None where no clock runs like that."""
    at_ns, lag_ns = points[-1]
    x = [float(point[0] - at_ns) for point in points]
    y = [float(point[1] - lag_ns) for point in points]
    length = -x[0]
    if length <= 0.0:
        return None
    slope, least = _edge(x, y)
    most = MAX_PPM * 1e-6
    if abs(slope) > most:
        mean = sum(y) / len(y) - slope * sum(x) / len(x) - least
        if abs(slope) > most + RATE_FACTOR * mean / length:
            return None
        slope = math.copysign(most, slope)
        least = min(b - slope * a for a, b in zip(x, y, strict=True))
    late = [b - slope * a - least for a, b in zip(x, y, strict=True)]
    mean = sum(late) / len(late)
    bound = LEAST_BOUND_NS + BOUND_FACTOR * (1.0 + FEW / len(late)) * max(mean, min(late[-2:]))
    newest = late[-STEP_SLICES:]
    before = sum(late[:-STEP_SLICES]) / max(1, len(late) - STEP_SLICES)
    low = min(newest)
    stepped = len(late) > STEP_SLICES and low > STEP_NS + 4.0 * before and max(newest) < 1.5 * low
    return Line(at_ns, lag_ns + round(least), slope, bound, BOUND_FACTOR * mean / length + WANDER, low if stepped else 0.0)


def _edge(x: list[float], y: list[float]) -> tuple[float, float]:
    """Slope, and height at x = 0, of the lower hull's edge beneath the points' weighted middle."""
    hull: list[tuple[float, float]] = []
    for c, d in zip(x, y, strict=True):
        while len(hull) > 1 and (hull[-1][0] - hull[-2][0]) * (d - hull[-2][1]) <= (hull[-1][1] - hull[-2][1]) * (
            c - hull[-2][0]
        ):
            hull.pop()
        hull.append((c, d))
    weights = _WEIGHTS[-len(x) :]
    middle = sum(map(mul, weights, x)) / sum(weights)
    (a, b), (c, d) = next(edge for edge in pairwise(hull) if edge[1][0] >= middle)
    slope = (d - b) / (c - a)
    return slope, b - slope * a


_WEIGHTS = [FADE**age for age in reversed(range(SLICES))]


def host_time(device_time_ns: int | None, receipt_ns: int) -> tuple[int, bool]:
    """Time of acquisition of a reading whose clock is the host's own CLOCK_MONOTONIC.

    Returns:
        The reading's own time and True; its receipt and False where it has none, or one in the future or older than
        ``OLDEST_HOST_NS``.
    """
    if device_time_ns is not None and 0 <= receipt_ns - device_time_ns <= OLDEST_HOST_NS:
        return device_time_ns, True
    return receipt_ns, False
