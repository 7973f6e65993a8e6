"""Readings that look fresh and are not: the same bits again, values no force can make, a stream that flickers.

A sensor that hangs often goes on sending. What gives it away is that its bits rest: a real reading carries noise, and
the more of it, the shorter is the longest run of equal readings. Some devices send a reading twice, and a coarse one
at rest repeats its counts for a while; neither is a fault.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled

Array = NDArray[np.float64]

FROZEN_IMAGES = 3
"""Images equal to the one before. XELA's server repeats 7 % of its images and never two running."""
FROZEN_NS = 85_000_000
"""Time since the last new image; with three repeats it takes at most 100 ms at 30 Hz and more, for the jitter."""

CHANCE = 1e-12
"""A run is told where chance makes it less often than this: at 4 kHz less than once in eight years."""
STUCK_NS = 20_000_000
"""No shorter run is told, whatever the noise: a device may hand on several readings of one conversion."""
DEFAULT_REPEATS = 50
"""What `repeats_of_a_stuck_sensor` gives for six components whose noise is 0.3 of a count."""

JUMPS = 3.0
"""Impossible readings, less those forgotten, from which a stream is garbage: one is a bit error."""
FORGET = 0.05
"""Of an impossible reading, forgotten with each good one: garbage ends 60 good readings after its last."""
_NEVER_NS = 1 << 63
"""Before the first reading: later than any time, so that no gap ends with it."""

FLICKER_NS = 10_000_000_000
FLICKERS = 3
"""A stream that failed so often within ``FLICKER_NS`` is intermittent until it has been well for as long."""


class FrozenImage:
    """Tells that a whole tactile image hangs while the force on it moves.

    Args:
        force_step_n: Change of the normal force that the image must show: several times the force sensor's noise, and
            what moves a reading of the pad by several counts.
    """

    def __init__(self, force_step_n: float) -> None:
        if not 0.0 < force_step_n < math.inf:
            raise ValueError(f"force_step_n must be positive and finite, not {force_step_n}")
        self._step_n = force_step_n
        self._bits = b""
        self._repeats = 0
        self._since_ns = 0
        self._low_n, self._high_n = math.inf, -math.inf

    def update(self, values: Array, t_ns: int, normal_n: float | None) -> bool:
        """Takes an image; says whether the array hangs.

        Args:
            values: Readings as they came, any shape.
            t_ns: Time of the image.
            normal_n: Normal force that the force sensor reads now; None or NaN where it does not know. Without it
                nothing is told: a pad without noise may rest as long as its load does.
        """
        bits = values.tobytes()
        if bits != self._bits:
            self._bits, self._repeats, self._since_ns = bits, 0, t_ns
            self._low_n, self._high_n = math.inf, -math.inf
        else:
            self._repeats += 1
        if normal_n is not None:
            if normal_n < self._low_n:
                self._low_n = normal_n
            if normal_n > self._high_n:
                self._high_n = normal_n
        return (
            self._repeats >= FROZEN_IMAGES
            and t_ns - self._since_ns >= FROZEN_NS
            and self._high_n - self._low_n >= self._step_n
        )


def repeats_of_a_stuck_sensor(std_counts: float, components: int = 6) -> int:
    """Finds how many equal readings running tell a stuck sensor, for noise that is normal and independent.

    A component repeats most while its mean lies in the middle of a count: P = erf(1 / (2 √2 s)), s its noise in
    counts.

    Args:
        std_counts: Standard deviation of a component's noise in counts (or in steps of its resolution).
        components: Components that are compared.

    Returns:
        The least number whose probability is below ``CHANCE``, at least 4.

    Raises:
        ValueError: Noise that is not positive, or so small that a sensor at rest repeats itself for over 1e6 readings.
    """
    alike = math.erf(0.5 / (math.sqrt(2.0) * std_counts)) ** components if std_counts > 0.0 else 1.0
    if not 0.0 <= alike < 1.0 or math.log(CHANCE) / math.log(max(alike, 1e-300)) > 1e6:
        raise ValueError(f"a noise of {std_counts} counts is too small to tell rest from a stuck sensor")
    return max(math.ceil(math.log(CHANCE) / math.log(max(alike, 1e-300))), 4)


class WrenchWatch:
    """Tells a force/torque stream that is stuck, garbage or intermittent.

    Args:
        range_n: Largest force that the sensor can state, as the length of the vector, N; more is impossible.
        jump_n: A change of the force from one reading to the next, N, that nothing real makes to and fro: a good part
            of the range; None: a quarter.
        repeats: Equal readings running that tell a stuck sensor: see `repeats_of_a_stuck_sensor`.
        gap_ns: A longer silence is a failure of the stream.

    Raises:
        ValueError: A range that is not positive and finite.

    Attributes:
        fault: What speaks against the newest reading; "" where nothing does.
        lively: The newest readings were all numbers, in range, and no two running alike.
    """

    def __init__(
        self, range_n: float, *, jump_n: float | None = None, repeats: int = DEFAULT_REPEATS, gap_ns: int = 20_000_000
    ) -> None:
        if not 0.0 < range_n < math.inf:
            raise ValueError(f"range_n must be positive and finite, not {range_n}")
        self._range_n = range_n
        self._jump_n = 0.25 * range_n if jump_n is None else jump_n
        self._repeats, self._gap_ns = repeats, gap_ns
        self._row: Sequence[float] = (math.nan,) * 6
        self._equal = 0
        self._since_ns = self._last_ns = _NEVER_NS
        self._step: list[float] | None = None  # the last change, where it was a jump
        self._impossible = 0.0
        self._garbage = self._failing = self._alert = False
        self._failed_ns: list[int] = []
        self.fault = ""
        self.lively = False

    def excuse(self, t_ns: int) -> None:
        """Count no gap until ``t_ns``: the daemon did not read the stream."""
        self._last_ns = t_ns

    def update(self, readings: Sequence[Sequence[float]], times_ns: Sequence[int], rows: Array) -> dict[int, str]:
        """Takes readings as the sensor sent them, before tare and mounting.

        Args:
            readings: Force, N, and torque, N·m (zeros where the device has none) of each: six numbers; at least one.
            times_ns: Time of each.
            rows: The same as an array, whose rows may be longer.

        Returns:
            "stuck", "garbage" or "intermittent" of each reading that something speaks against, by its place.
        """
        if len(readings) > 1 and self._take_lively(readings, times_ns[-1], rows):
            return {}
        found = {}
        self.lively = True
        for at, reading in enumerate(readings):
            if self._take(reading, times_ns[at]):
                found[at] = self.fault
        return found

    def _take_lively(self, readings: Sequence[Sequence[float]], last_ns: int, rows: Array) -> bool:
        """Takes readings that are well, all at once; False where one of them is to be looked at."""
        if self._alert or last_ns - self._last_ns > self._gap_ns:
            return False
        self.lively = _is_lively(np.array(self._row), rows, self._range_n**2, self._jump_n**2)
        if self.lively:
            self._row, self._last_ns, self._equal, self._step, self.fault = readings[-1], last_ns, 0, None, ""
        return self.lively

    def _take(self, row: Sequence[float], t_ns: int) -> str:
        """Takes one reading; returns the fault."""
        before, self._row = self._row, row
        force_n, last_n = row[:3], before[:3]
        gap = t_ns - self._last_ns > self._gap_ns
        jumps = not (math.dist(force_n, last_n) < self._jump_n and math.hypot(*force_n) <= self._range_n)
        if gap or jumps or self._alert or row == before or not math.isfinite(sum(row)):
            self.lively = False
            self._count(alike=row == before and not gap)
            if jumps:
                self._suspect(force_n, last_n)
            else:
                self._step = None
            told = gap or self._alert or self._equal >= self._repeats
            self.fault = self._told(gap, t_ns) if told else ""
        else:
            self._equal, self._step, self.fault = 0, None, ""
        self._last_ns = t_ns
        return self.fault

    def _count(self, *, alike: bool) -> None:
        """Counts readings that repeat the one before."""
        if alike and self._equal == 0:
            self._since_ns = self._last_ns
        self._equal = self._equal + 1 if alike else 0

    def _suspect(self, force_n: Sequence[float], last_n: Sequence[float]) -> None:
        """Takes a reading out of range, or a jump; a single jump may be a blow."""
        before, self._step = self._step, [now - last for now, last in zip(force_n, last_n, strict=True)]
        back = before is not None and sum(map(mul, before, self._step)) < 0.0
        if back or not math.hypot(*force_n) <= self._range_n:
            self._impossible = min(self._impossible + 1.0, JUMPS) + FORGET
            self._alert = True

    def _told(self, gap: bool, t_ns: int) -> str:
        self._impossible = max(self._impossible - FORGET, 0.0)
        self._garbage = self._impossible >= JUMPS or (self._garbage and self._impossible > 0.0)
        stuck = self._equal >= self._repeats and t_ns - self._since_ns >= STUCK_NS
        failing = stuck or gap or self._garbage
        if failing and not self._failing:
            self._failed_ns = [*self._failed_ns[1 - FLICKERS :], t_ns]
        self._failing = failing
        if not failing and self._failed_ns and t_ns - self._failed_ns[-1] > FLICKER_NS:
            self._failed_ns = []
        self._alert = failing or self._impossible > 0.0 or bool(self._failed_ns)
        often = len(self._failed_ns) == FLICKERS and self._failed_ns[-1] - self._failed_ns[0] <= FLICKER_NS
        return "stuck" if stuck else "garbage" if self._garbage else "intermittent" if often else ""


@compiled
def _is_lively(before: Array, rows: Array, range2: float, jump2: float) -> bool:
    """Each reading is finite, differs from the one before, by less than a jump, and is in range."""
    for k in range(len(rows)):
        last = before if k == 0 else rows[k - 1]
        jump = size = total = 0.0
        alike = True
        for i in range(6):
            alike = alike and rows[k, i] == last[i]
            total += rows[k, i]
            if i < 3:
                jump += (rows[k, i] - last[i]) ** 2
                size += rows[k, i] ** 2
        if alike or not (jump < jump2 and size <= range2 and math.isfinite(total)):
            return False
    return True
