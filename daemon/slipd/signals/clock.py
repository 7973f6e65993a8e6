"""A device's own clock told in the host's monotonic time.

A receipt is late by a delay that is never negative, bunched and heavy-tailed, so what is true of the clock shows in
the readings that were late the least: of each slice of time the least late is kept, and a line is laid beneath them.

What no stream that goes one way can show is a least delay that never changes: all times are late by it, and no bound
here holds it; ``delay_ns`` takes off what is known of it. Readings that wait for a poll (a USB port) wait for up to the
time between two readings, or, where there is one reading a poll, for up to a poll; how long depends on a phase that
may beat for minutes. Where reads hold several readings the bound holds this wait; where each holds one, nothing shows
it, and the bound holds it only where ``poll_ns`` tells of it.
"""

from __future__ import annotations

import math
from collections import deque

from slipd.signals.lowest_line import SLICES, STEP_SLICES, lowest_line

#: One reading is kept of each slice of so much time; a reset must be over within 1 s, so a line needs some soon.
SLICE_NS = 125_000_000
#: A line is laid after so much time and so many receipts.
SETTLE_NS, SETTLE_RECEIPTS = 500_000_000, 8
#: A clock that failed must run well for so long before it is believed again.
PROBATION_NS = 10_000_000_000
#: So many jumps back without a steady time after one are no restarts but a clock that jumps.
JUMPS, STEADY_NS = 4, 2_000_000_000
#: More than this share of the reads hold several readings where reads are polls.
SHARED_READS = 0.2
#: More than this share of the steps is not of the grid where times are rounded; fewer are readings lost.
UNEVEN_STEPS = 0.05
#: Share of one read in these averages.
READ_SHARE = 1.0 / 32.0
#: Of what is open between two readings; half of it lies to each side, and the line's own error beside.
OPEN_SHARE = 0.6
#: Slices in which a read is sought that came just before the next reading: the phase drifts little in so long.
OPEN_SLICES = 8
#: A reading earlier than the line by 3 bounds and this is of another time line; so is one while the line settles.
EARLY_NS, EARLY_SETTLING_NS = 1_000_000, 50_000_000
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
        poll_ns: Readings that come one by one may wait for a poll so long, e.g. 1 ms on a full-speed USB.

    Raises:
        ValueError: A span that is not positive, a delay or a poll that is negative.

    Attributes:
        state: "none" (no device time), "settling", "locked", or "not_a_clock" (its rate is off by more than
            ``MAX_PPM``, it is stuck, or it jumps).
    """

    def __init__(self, span_ns: int | None, *, delay_ns: int = 0, poll_ns: int = 0) -> None:
        if span_ns is not None and span_ns <= 0:
            raise ValueError(f"span_ns must be positive, or None for a clock that never begins anew, not {span_ns}")
        if delay_ns < 0 or poll_ns < 0:
            raise ValueError(f"delay_ns and poll_ns must not be negative, not {delay_ns} and {poll_ns}")
        self._span_ns, self._delay_ns, self._poll_ns = span_ns, delay_ns, poll_ns
        self._told_ns = self._wanted_ns = self._device_ns = self._first_ns = 0
        self._at_ns = self._lag_ns = self._base_ns = 0  # of the line, as its slope and bounds
        self._slope = self._bound_ns = self._rate_bound = self._shared = self._uneven = 0.0
        self._receipts = self._from_ns = self._slice_end_ns = self._grid_ns = 0
        self._least: tuple[int, int, int] | None = None  # of the slice: lag at the line's rate, device time, lag
        self._open = _NOTHING_OPEN
        self._locked = False
        self._slices: deque[tuple[int, int]] = deque(maxlen=SLICES)  # device time, receipt less device time
        self._opens: deque[tuple[int, int]] = deque(maxlen=OPEN_SLICES)
        self.forget()

    def forget(self) -> None:
        """Begin anew: the host slept or the link was lost, and what comes next may be another device."""
        self.state = "none"
        self._jumps, self._settle_ns = 0, SETTLE_NS
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
                self._begin(device_time_ns, receipt_ns)
                self._jumps += 1
                if self._jumps >= JUMPS:
                    self._fail(receipt_ns)
            else:
                self._device_ns += step
                if fresh and not 0 < self._grid_ns <= FINEST_GRID_NS:
                    self._note_step(step)
        if fresh:
            self._first_ns = self._device_ns
        self._raw_ns, self._receipt_ns = device_time_ns, receipt_ns

    def _note_step(self, step: int) -> None:
        """Find the grid that the device's times lie on; where nearly each step is one, it counts readings."""
        self._grid_ns = math.gcd(self._grid_ns, step)
        self._uneven += READ_SHARE * ((step != self._grid_ns) - self._uneven)

    def _commit(self, step: int) -> None:
        """Take the last reading of the read before this: of that read it was late the least.

        The reading after it, a ``step`` later, had not come by then. So a read that shows all there is leaves open by
        how much less than a step it was late; where reads and readings beat slowly, many reads tell no more.
        """
        device_ns, receipt_ns = self._device_ns, self._receipt_ns
        lag = receipt_ns - device_ns
        late = lag - self._lag_ns - int(self._slope * (device_ns - self._at_ns))
        if late < 0:
            early = EARLY_NS + 3.0 * self._bound_at(device_ns) if self._locked else EARLY_SETTLING_NS
            if late < -early:  # the clock jumped ahead, or all before was late
                self._begin(device_ns, receipt_ns)
            else:
                self._lag_ns += late
                self._base_ns += late
        self._receipts += 1
        self._shared += READ_SHARE * ((device_ns != self._first_ns) - self._shared)
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
        open_ns, period_ns = sorted(self._opens)[len(self._opens) // 2] if shared else (self._poll_ns,) * 2
        line = lowest_line(self._slices)
        if line is None:
            self._fail(receipt_ns)
            return
        if line.stepped_ns > period_ns:
            while len(self._slices) > STEP_SLICES:
                self._slices.popleft()
            line = lowest_line(self._slices) or line
            self._grid_ns, self._uneven = 0, 0.0
        self._slope, self._at_ns, self._lag_ns = line.slope, line.at_ns, line.lag_ns
        self._bound_ns, self._rate_bound = line.bound_ns, line.rate_bound
        rounded = self._grid_ns > FINEST_GRID_NS and self._uneven > UNEVEN_STEPS
        grid_ns = self._grid_ns if rounded else 0
        self._bound_ns += OPEN_SHARE * open_ns + 0.5 * grid_ns
        self._rate_bound += open_ns / max(1, self._slices[-1][0] - self._slices[0][0])
        self._base_ns = line.lag_ns + (grid_ns - open_ns) // 2
        self._locked, self.state, self._settle_ns = True, "locked", SETTLE_NS
        if receipt_ns - self._from_ns >= STEADY_NS:
            self._jumps = 0

    def _bound_at(self, device_ns: int) -> float:
        return self._bound_ns + self._rate_bound * abs(device_ns - self._at_ns)

    def _fail(self, receipt_ns: int) -> None:
        """Give up a clock that is none; it is tried again for long."""
        self.state, self._settle_ns, self._jumps = "not_a_clock", PROBATION_NS, 0
        self._begin(self._device_ns, receipt_ns)

    def _begin(self, device_ns: int, receipt_ns: int) -> None:
        self._locked = False
        if self.state == "locked":
            self.state = "settling"
        self._device_ns = self._at_ns = device_ns
        self._lag_ns = self._base_ns = receipt_ns - device_ns
        self._slope = self._bound_ns = self._rate_bound = 0.0
        self._slices.clear()
        self._least = None
        self._receipts = 0
        self._from_ns, self._slice_end_ns = receipt_ns, receipt_ns + SLICE_NS
        self._grid_ns, self._uneven = 0, 0.0
        self._first_ns, self._shared, self._open = device_ns, 0.0, _NOTHING_OPEN
        self._opens.clear()


def host_time(device_time_ns: int | None, receipt_ns: int) -> tuple[int, bool]:
    """Time of acquisition of a reading whose clock is the host's own CLOCK_MONOTONIC.

    Returns:
        The reading's own time and True; its receipt and False where it has none, or one in the future or older than
        ``OLDEST_HOST_NS``.
    """
    if device_time_ns is not None and 0 <= receipt_ns - device_time_ns <= OLDEST_HOST_NS:
        return device_time_ns, True
    return receipt_ns, False
