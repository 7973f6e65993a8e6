"""Map the clock of a device to the monotonic time of the host.

A receipt is late by a delay that is never negative, bunched and heavy-tailed. The least delayed readings therefore show
the clock: of each time slice the least delayed reading is kept, and a line is fitted beneath them.

A one-way stream cannot show a constant least delay. All times are late by it, and no bound here includes it;
``delay_ns`` subtracts the known part. Readings that wait for a poll (a USB port) wait for up to the time between two
readings or, with one reading per poll, for up to a poll period; the wait depends on a phase that may drift over
minutes. If reads hold several readings, the bound includes this wait. If each holds one, nothing shows it, and the
bound includes it only if ``poll_ns`` states it.

A delay that grows later is seen: a reading that lags more than an earlier one is late by the difference, unless the
device's clock went back. Then its time falls, or advances less per reading than before. Otherwise the line is kept.
"""

from __future__ import annotations

import math
from collections import deque

from slipd.signals.clock_fit import MOST_SLOPE, SLICES, Slice, lowest_line, period_of_step

SLICE_NS = 125_000_000
"""Length of a time slice, of which one reading is kept. A reset must be over within 1 s, so a line is needed soon."""
SETTLE_NS, SETTLE_RECEIPTS = 500_000_000, 8
"""Least time and least number of receipts before a line is fitted."""
PROBATION_NS = 10_000_000_000
"""Time for which a failed clock must run well before it is used again."""
JUMPS, STEADY_NS = 4, 2_000_000_000
"""This many backward jumps without a steady time in between are a jumping clock, not restarts."""
SHARED_READS = 0.2
"""Reads are polls if more than this fraction of them holds several readings."""
UNEVEN_STEPS = 0.05
"""Times are rounded if more than this fraction of the steps differs from the grid; a smaller one is lost readings."""
READ_SHARE = 1.0 / 32.0
"""Weight of one read in these averages."""
OPEN_SHARE = 0.6
"""Fraction of the open interval between two readings that the bound includes: half of it, and the line's own error."""
OPEN_SLICES = 8
"""Slices that are searched for a read that came just before the next reading; the phase drifts little meanwhile."""
EARLY_NS, EARLY_SETTLING_NS = 1_000_000, 50_000_000
"""A reading earlier than the line by 3 bounds plus this belongs to another line; the second holds while settling."""
LATE_SLICES = 6
"""So many late slices in a row are a delay that lasts, or a clock that went back."""
LATE_NS, MOST_LATE_NS = 1_000_000, 20_000_000
"""A slice is late beyond 3 bounds plus the first, at most beyond the second. No stream is stale before that."""
STEEPEST_SHARE = 1.0 / 512.0
"""Weight of one fit in the long average of the steepest slope: 64 s."""
RAMP = 100e-6
"""Change of a crystal's rate as it warms, beside the error of the fit; a lag that grows faster is a growing delay."""
PAUSE_NS = 60_000_000_000
"""After a longer pause of the device's own time a new line starts: the old one has drifted."""
FINEST_GRID_NS = 1_000
"""Rounding of device times to a finer grid than this does not matter."""
_NEVER = 1 << 200  # no previous reading: every device time lies behind it
_NOTHING_OPEN = (_NEVER, 0)


class DeviceClock:
    """Maps the times of one device's clock to CLOCK_MONOTONIC, online.

    Readings of one read share one receipt, and only the last of them carries information about the delay. If the
    device's clock jumps, a new line starts; until it is fitted (``SETTLE_NS``) the time of a reading is its receipt, as
    without a clock. Times never go back as long as receipts do not, not even after a restart.

    Args:
        span_ns: Time after which the device's clock wraps around; None if it never does.
        delay_ns: Known part of the least delay from acquisition to receipt.
        poll_ns: Longest wait of a single reading for a poll, e.g. 1 ms on full-speed USB.

    Attributes:
        state: "none" (no device time), "settling", "locked", "delayed" (readings come later than before), or
            "not_a_clock" (its rate is off by more than ``MAX_PPM``, it is stuck, or it jumps).
        locked: Times are those of the device's clock, not of the receipt.
        slewed_ns: How far NTP has slewed CLOCK_MONOTONIC by now: the delay of a line does not grow by it.
    """

    def __init__(self, span_ns: int | None, *, delay_ns: int = 0, poll_ns: int = 0) -> None:
        self._span_ns, self._delay_ns, self._poll_ns = span_ns, delay_ns, poll_ns
        self.slewed_ns = 0
        self._mapped_ns = self._wanted_ns = self._readings = 0
        self.forget()

    def forget(self) -> None:
        """Start over: after a suspend or a lost link, the next reading may be of another device."""
        self.state = "none"
        self._jumps, self._settle_ns = 0, SETTLE_NS
        self._raw_ns, self._receipt_ns = _NEVER, -1
        self._begin(0, 0)

    def _begin(self, device_ns: int, receipt_ns: int) -> None:
        """Start a new line with a reading."""
        self.locked = False
        if self.state in ("locked", "delayed"):
            self.state = "settling"
        self._device_ns = self._at_ns = device_ns
        self._lag_ns = self._base_ns = receipt_ns - device_ns
        self._slope = self._bound_ns = self._spread_ns = self._rate_bound = 0.0
        self._slices: deque[Slice] = deque(maxlen=SLICES)
        self._late: deque[Slice] = deque(maxlen=LATE_SLICES)
        self._steepest = MOST_SLOPE
        self._least: tuple[int, Slice] | None = None  # lag at the line's rate, and the reading
        self._receipts = 0
        self._from_ns, self._slice_end_ns = receipt_ns, receipt_ns + SLICE_NS
        self._grid_ns, self._uneven = 0, 0.0
        self._first_ns, self._shared, self._open = device_ns, 0.0, _NOTHING_OPEN
        self._opens: deque[tuple[int, int]] = deque(maxlen=OPEN_SLICES)

    def map(self, device_time_ns: int | None, receipt_ns: int) -> int:
        """Return the time of acquisition of a reading on CLOCK_MONOTONIC, never after its receipt.

        Args:
            device_time_ns: Device time as sent; None if the reading has none.
            receipt_ns: CLOCK_MONOTONIC at receipt; it never falls.
        """
        receipt_ns -= self._delay_ns + self.slewed_ns
        if device_time_ns is None:
            if self.state != "none":
                self.forget()
            self._wanted_ns = self._mapped_ns = receipt_ns
            return receipt_ns + self.slewed_ns
        self._readings += 1
        step = device_time_ns - self._raw_ns
        if step < 0 or receipt_ns != self._receipt_ns:
            self._advance(device_time_ns, step, receipt_ns)
        else:
            self._device_ns += step
            self._raw_ns = device_time_ns
        mapped = receipt_ns
        if self.locked:
            mapped = self._device_ns + self._base_ns + int(self._slope * (self._device_ns - self._at_ns))
        self._wanted_ns = mapped
        if mapped < self._mapped_ns:
            mapped = self._mapped_ns
        if mapped > receipt_ns:
            mapped = receipt_ns
        self._mapped_ns = mapped
        return mapped + self.slewed_ns

    @property
    def uncertainty_ns(self) -> int | None:
        """Bound on the error of the newest time, without the constant least delay; None while not known."""
        if not self.locked:
            return None
        held = max(0, self._mapped_ns - self._wanted_ns)
        return round(self._bound_at(self._device_ns)) + held

    @property
    def late_ns(self) -> int:
        """Lasting delay of the readings beyond the least one known, ns; 0 unless the state is "delayed"."""
        return self._late_by(self._late[-1]) if self.state == "delayed" else 0

    @property
    def drift_ppm(self) -> float | None:
        """Rate error of the device's clock, ppm, positive if fast; None while not known."""
        return -1e6 * self._slope / (1.0 + self._slope) if self.locked else None

    def _advance(self, device_time_ns: int, step: int, receipt_ns: int) -> None:
        """Update with the first reading of a read, or with one whose device time went back."""
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
            elif step > PAUSE_NS:
                self._begin(device_time_ns, receipt_ns)
            else:
                self._device_ns += step
                if fresh and not 0 < self._grid_ns <= FINEST_GRID_NS:
                    # find the grid of the device times; if nearly every step is one of it, the device counts readings
                    self._grid_ns = math.gcd(self._grid_ns, step)
                    self._uneven += READ_SHARE * ((step != self._grid_ns) - self._uneven)
        if fresh:
            self._first_ns = self._device_ns
        self._raw_ns, self._receipt_ns = device_time_ns, receipt_ns

    def _commit(self, step: int) -> None:
        """Use the last reading of the previous read, the least delayed one of that read.

        The next reading, a ``step`` later, had not arrived by then. So the delay is known only to within a step; if
        reads and readings beat slowly, many reads carry no more information.
        """
        device_ns, receipt_ns = self._device_ns, self._receipt_ns
        lag = tilted = receipt_ns - device_ns
        tilted -= int(self._slope * (device_ns - self._at_ns))
        late = tilted - self._lag_ns
        if late < 0:
            early = EARLY_NS + 3.0 * self._bound_at(device_ns) if self.locked else EARLY_SETTLING_NS
            if late < -early:  # the clock jumped ahead, or all previous readings were late
                self._begin(device_ns, receipt_ns)
                tilted = lag
            else:
                self._lag_ns += late
                self._base_ns += late
        self._receipts += 1
        self._shared += READ_SHARE * ((device_ns != self._first_ns) - self._shared)
        if 0 <= step - late < self._open[0]:
            self._open = step - late, step
        if self._least is None or tilted < self._least[0]:
            self._least = tilted, (device_ns, lag, self._readings - 1)
        if receipt_ns >= self._slice_end_ns:
            newest = self._least[1]
            if self._open[1]:
                self._opens.append(self._open)
            self._least, self._open, self._slice_end_ns = None, _NOTHING_OPEN, receipt_ns + SLICE_NS
            if self.locked and self._late_by(newest) > self._punctual_ns(device_ns):
                self._hold(newest, receipt_ns)
                return
            self._late.clear()
            if self.state == "delayed":
                self.state = "locked"
            self._slices.append(newest)
            if receipt_ns - self._from_ns >= self._settle_ns and self._receipts >= SETTLE_RECEIPTS:
                self._fit(receipt_ns)

    def _late_by(self, newest: Slice) -> int:
        return newest[1] - self._lag_ns - int(self._slope * (newest[0] - self._at_ns))

    def _punctual_ns(self, device_ns: int) -> float:
        """Return the largest lag beyond the line that its own error and the reads' phase explain."""
        error_ns = self._spread_ns + self._rate_bound * abs(device_ns - self._at_ns)
        return LATE_NS + min(3.0 * error_ns, MOST_LATE_NS)

    def _hold(self, newest: Slice, receipt_ns: int) -> None:
        """Keep the line beneath a slice whose readings are all late, unless the clock itself shows why."""
        self._late.append(newest)
        if self.state == "delayed" or len(self._late) < LATE_SLICES:
            return
        late_ns = self._late_by(newest)
        period_ns = period_of_step(self._slices, newest, late_ns)
        if period_ns is None:
            self.state = "delayed"
        elif late_ns > period_ns:  # the clock is stuck, or has slowed down
            self._fail(receipt_ns)
        else:  # it went back by less than the time between two readings
            self._slices.clear()
            self._slices.extend(self._late)
            self._late.clear()
            self._grid_ns, self._uneven = 0, 0.0
            self._fit(receipt_ns)

    def _fit(self, receipt_ns: int) -> None:
        shared = bool(self._opens) and self._shared > SHARED_READS
        open_ns = sorted(self._opens)[len(self._opens) // 2][0] if shared else self._poll_ns
        line = lowest_line(self._slices)
        if line is None or line.slope > self._steepest:
            if line is None or not self.locked:
                self._fail(receipt_ns)
            return  # otherwise the delay grows
        self._slope, self._at_ns, self._lag_ns = line.slope, line.at_ns, line.lag_ns
        self._bound_ns, self._rate_bound = line.bound_ns, line.rate_bound
        rounded = self._grid_ns > FINEST_GRID_NS and self._uneven > UNEVEN_STEPS
        grid_ns = self._grid_ns if rounded else 0
        self._spread_ns = self._bound_ns + OPEN_SHARE * open_ns
        self._bound_ns = self._spread_ns + 0.5 * grid_ns
        self._rate_bound += open_ns / max(1, self._slices[-1][0] - self._slices[0][0])
        self._base_ns = line.lag_ns + (grid_ns - open_ns) // 2
        self.locked, self.state, self._settle_ns = True, "locked", SETTLE_NS
        if len(self._slices) == SLICES:
            steepest = self._slope + self._rate_bound + RAMP
            share = STEEPEST_SHARE if self._steepest < MOST_SLOPE else 1.0
            self._steepest = min(self._steepest + share * (steepest - self._steepest), MOST_SLOPE)
        if receipt_ns - self._from_ns >= STEADY_NS:
            self._jumps = 0

    def _bound_at(self, device_ns: int) -> float:
        return self._bound_ns + self._rate_bound * abs(device_ns - self._at_ns)

    def _fail(self, receipt_ns: int) -> None:
        """Give up an unusable clock and start a long probation."""
        self.state, self._settle_ns, self._jumps = "not_a_clock", PROBATION_NS, 0
        self._begin(self._device_ns, receipt_ns)
