"""Detect force/torque readings that look fresh but are not: repeated bits, impossible values, a flickering stream.

A sensor that hangs often goes on sending. It shows by equal readings: a real reading carries noise, and the more noise,
the shorter is the longest run of equal readings. Some devices send a reading twice, and a coarse sensor at rest repeats
its counts for a while; neither is a fault.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array

STUCK_NS = 20_000_000
"""Shortest reported run, whatever the noise: a device may send several readings of one conversion."""
HANG_NS = 70_000_000
"""A run of this length is reported at any rate: within 100 ms from 30 Hz up, otherwise with the third repeat."""
HABITS = 3
"""Multiple of the usual run (one in a thousand, or none) that chance practically never makes: once in 1e9."""
HABIT_NS = 10_000_000_000
RESTED_NS = 50_000_000
"""Age at which a repeated reading, which is as old as the first of its run, becomes suspect."""
DEFAULT_REPEATS = 50
"""With six components of normal noise of 0.3 counts, so many have a probability of 1e-12: less than once in eight years
at 4 kHz. A component with a noise of s counts repeats with a probability of at most erf(1 / (2 √2 s))."""

MOST = 1e6
"""Default range, N or N·m: no sensor on a gripper measures more."""
MOST_IMPOSSIBLE = 3.0
"""Number of impossible readings, minus forgotten ones, from which a stream is garbage: a single one is a bit error."""
FORGET = 0.05
"""Number of impossible readings that each good one offsets: garbage ends after 60 good readings."""
JUMP_SHARE = 0.25
"""Share of the range of the force that no real force changes by, from one reading to the next, back and forth."""
_NEVER = 1 << 63
"""More repeats than ever occur; before the first reading, a time later than any, so that no gap ends with it."""

REPEATS, JUMPS, IMPOSSIBLE, NOT_FINITE = 1, 2, 4, 8
"""Findings about a reading, which `compare` adds up."""

FLICKER_NS = 10_000_000_000
FLICKERS = 3
"""A stream that failed this often within ``FLICKER_NS`` is intermittent until it has been good for as long."""


class WrenchWatch:
    """Reports a force/torque stream that is stuck, garbage or intermittent.

    Args:
        range_n: Largest force that the sensor can report, as the length of the vector, N; more is impossible.
        range_nm: Likewise the largest torque, N·m.
        repeats: Repeats of a reading that mean a stuck sensor. Up to `DEFAULT_REPEATS`, a run of `HANG_NS` that is
            longer than usual for the sensor also counts. 0: never stuck, for a sensor whose readings may rest; they are
            suspect all the same.
        gap_ns: A longer silence is a failure of the stream.

    Attributes:
        fault: Fault of the newest reading, or "".
        lively: All of the newest readings are finite, in range, and differ from the one before, by no jump.
        suspect: The newest reading jumped, or repeats the one before for longer than usual. It is used, but no grip is
            raised on it.
        rests: It is suspect only because it repeats, and ``repeats`` states that readings of this sensor may rest.
    """

    def __init__(
        self,
        range_n: float = MOST,
        range_nm: float = MOST,
        *,
        repeats: int = DEFAULT_REPEATS,
        gap_ns: int = 20_000_000,
    ) -> None:
        self._range_n, self._range_nm = range_n, range_nm
        self._jump_n = JUMP_SHARE * range_n
        self._repeats, self._gap_ns = repeats or _NEVER, gap_ns
        self._row: Sequence[float] = (math.nan,) * 6
        self._equal = 0
        self._since_ns = self._last_ns = _NEVER
        self._habit = Habit()
        self._step: list[float] | None = None  # the last change, where it was a jump
        self._impossible = 0.0
        self._garbage = self._failing = self._alert = False
        self._failed_ns: list[int] = []
        self.fault = ""
        self.lively = self.suspect = self.rests = False

    def excuse(self, t_ns: int) -> None:
        """Count no gap until ``t_ns``, because the daemon did not read the stream."""
        self._last_ns = t_ns

    def update(self, readings: Sequence[Sequence[float]], times_ns: Sequence[int], rows: Array) -> dict[int, str]:
        """Update with readings as the sensor sent them, before tare and mounting.

        Args:
            readings: Force, N, and torque, N·m (zeros where the device has none) of each: a tuple of six; at least one.
            times_ns: Time of each.
            rows: The same as an array, shape (n, 6).

        Returns:
            "stuck", "garbage" or "intermittent" of each reading with a fault, by its index.
        """
        limits = self._range_n, self._range_nm, self._jump_n
        follows = not math.isnan(self._row[0]) and times_ns[-1] - self._last_ns <= self._gap_ns
        self.lively = follows and not self._alert and not any_finding(self._row, rows, *limits)
        if self.lively:
            if self._equal:
                self._end_run(honest=True)
            self._row, self._last_ns, self._step, self.fault = readings[-1], times_ns[-1], None, ""
            self.suspect = self.rests = False
            return {}
        found = {}
        for at, reading in enumerate(readings):
            findings = compare(self._row, rows[at], *limits)
            self._check_closely(reading, times_ns[at], findings)
            if self.fault:
                found[at] = self.fault
        return found

    def _check_closely(self, row: Sequence[float], t_ns: int, findings: int) -> None:
        """Check a reading for faults; `compare` returned ``findings``."""
        before, self._row = self._row, row
        gap, self._last_ns, last_ns = t_ns - self._last_ns > self._gap_ns, t_ns, self._last_ns
        jumps, impossible, alike = bool(findings & JUMPS), bool(findings & IMPOSSIBLE), bool(findings & REPEATS)
        if gap or not alike:
            self._end_run(honest=not gap)
        if alike:
            if self._equal == 0:
                self._since_ns = t_ns if gap else last_ns
                self._habit.age(self._since_ns)
            self._equal += 1
        if jumps or impossible:
            self._count_impossible(row[:3], before[:3], beyond_range=impossible)
        else:
            self._step = None
        stuck = self._is_stuck(t_ns)
        self.fault = self._find_fault(gap, stuck, t_ns) if gap or stuck or self._alert else ""
        if impossible and self.fault != "stuck" and not findings & NOT_FINITE:
            self.fault = "garbage"
        rested = t_ns - self._since_ns > RESTED_NS
        repeats = self._equal > 0 and (rested or self._equal > self._habit.repeats)
        self.suspect = jumps or repeats
        self.rests = repeats and not jumps and self._repeats == _NEVER

    def _end_run(self, *, honest: bool) -> None:
        """End a run of equal readings; one that was never reported as stuck is usual for this sensor."""
        if honest and self.fault != "stuck":
            self._habit.learn(self._equal)
        self._equal = 0

    def _is_stuck(self, t_ns: int) -> bool:
        if self._equal >= self._repeats:
            return t_ns - self._since_ns >= STUCK_NS
        unusual = self._equal >= HABITS * (self._habit.repeats + 1)
        return unusual and self._repeats <= DEFAULT_REPEATS and t_ns - self._since_ns >= HANG_NS

    def _count_impossible(self, force_n: Sequence[float], last_n: Sequence[float], *, beyond_range: bool) -> None:
        """Count a reading out of range or a jump back and forth; a single jump may be a blow."""
        before, self._step = self._step, [now - last for now, last in zip(force_n, last_n, strict=True)]
        back = before is not None and sum(map(mul, before, self._step)) < 0.0
        if back or beyond_range:
            self._impossible = min(self._impossible + 1.0, MOST_IMPOSSIBLE) + FORGET
            self._alert = True

    def _find_fault(self, gap: bool, stuck: bool, t_ns: int) -> str:
        self._impossible = max(self._impossible - FORGET, 0.0)
        self._garbage = self._impossible >= MOST_IMPOSSIBLE or (self._garbage and self._impossible > 0.0)
        failing = stuck or gap or self._garbage
        if failing and not self._failing:
            self._failed_ns = [*self._failed_ns[1 - FLICKERS :], t_ns]
        self._failing = failing
        if not failing and self._failed_ns and t_ns - self._failed_ns[-1] > FLICKER_NS:
            self._failed_ns = []
        self._alert = failing or self._impossible > 0.0 or bool(self._failed_ns)
        often = len(self._failed_ns) == FLICKERS and self._failed_ns[-1] - self._failed_ns[0] <= FLICKER_NS
        return "stuck" if stuck else "garbage" if self._garbage else "intermittent" if often else ""


class Habit:
    """Longest run of equal readings that is usual for a sensor, learned from runs that ended by themselves.

    Attributes:
        repeats: Length of the third longest run of the last 10 to 20 s: one or two longer runs, by chance or because
            the sensor hung for a moment, do not count as usual.
    """

    def __init__(self) -> None:
        self.repeats = 0
        self._before = 0  # of the previous 10 s
        self._longest = [0, 0, 0]
        self._since_ns = 0

    def learn(self, repeats: int) -> None:
        """Record the length of a run."""
        if repeats > self._longest[0]:
            self._longest = sorted((*self._longest[1:], repeats))

    def age(self, t_ns: int) -> None:
        """Update `repeats` for the time ``t_ns``."""
        age_ns = t_ns - self._since_ns
        if age_ns > HABIT_NS:
            self._before = self._longest[0] if age_ns <= 2 * HABIT_NS else 0
            self._longest, self._since_ns = [0, 0, 0], t_ns
        self.repeats = max(self._before, self._longest[0])


@compiled
def compare(before: Sequence[float], row: Sequence[float], range_n: float, range_nm: float, jump_n: float) -> int:
    """Return the sum of the findings about a reading; 0 if it is in range, and differs from the last, by no jump.

    Args:
        before: Force and torque of the reading before; NaN if there is none.
        row: Force and torque of the reading.
        range_n: Largest possible force; NaN is impossible too.
        range_nm: Largest possible torque; NaN is only not finite.
        jump_n: Smallest change of the force that is a jump; a change from or to NaN is none.
    """
    repeats = finite = True
    for i in range(6):
        repeats = repeats and row[i] == before[i]
        finite = finite and math.isfinite(row[i])
    findings = 0
    if repeats:
        findings += REPEATS
    if not finite:
        findings += NOT_FINITE
    if math.hypot(math.hypot(row[0] - before[0], row[1] - before[1]), row[2] - before[2]) >= jump_n:
        findings += JUMPS
    force_is_possible = math.hypot(math.hypot(row[0], row[1]), row[2]) <= range_n
    if not force_is_possible or math.hypot(math.hypot(row[3], row[4]), row[5]) > range_nm:
        findings += IMPOSSIBLE
    return findings


@compiled
def any_finding(before: Sequence[float], rows: Array, range_n: float, range_nm: float, jump_n: float) -> bool:
    """Return whether `compare` finds anything about one of several readings."""
    if compare(before, rows[0], range_n, range_nm, jump_n):
        return True
    for k in range(1, len(rows)):  # noqa: SIM110 - Numba knows no generators
        if compare(rows[k - 1], rows[k], range_n, range_nm, jump_n):
            return True
    return False
