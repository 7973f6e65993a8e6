"""Detect force/torque readings that look fresh but are not: repeated bits, impossible values, a flickering stream.

A sensor that hangs often goes on sending. It shows by readings that are equal, or differ by far less than its noise: a
real reading carries noise, and the more noise, the shorter is the longest run of equal readings. Some devices send a
reading twice, and a coarse sensor at rest repeats its counts for a while; neither is a fault.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.rows import GARBAGE, INTERMITTENT, NOT_FINITE, STUCK, Row, Rows, new_rows

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
STILL = 1e-3
"""Readings are equal if no component differs by more than this share of its stated noise. White noise does so in one of
1e19 readings, and that of a sensor a hundred times quieter than stated in one of 1e7: never fifty times in a row."""
JUMP_SHARE = 0.25
"""Share of the range of the force that no real force changes by, from one reading to the next, back and forth."""
_NEVER = 1 << 62
"""More repeats than ever occur; before the first reading, a time later than any, so that no gap ends with it. Its
negative: long before the first failure."""

FLICKER_NS = 10_000_000_000
FLICKERS = 3
"""A stream that failed this often within ``FLICKER_NS`` is intermittent until it has been good for as long."""

FAULTS = {0: "", STUCK: "stuck", GARBAGE: "garbage", INTERMITTENT: "intermittent"}
"""Word for each fault of a stream."""
_FAULT = STUCK | GARBAGE | INTERMITTENT
_SUSPECT, _RESTS, _DOUBTED = 16, 32, 64
"""Beside the faults of the newest reading: it is suspect, it rests, and some reading of the read is in doubt."""

STREAM = np.dtype(
    [
        *[(name, "f8") for name in ("range_n", "range_nm", "jump_n", "impossible")],
        ("before", "f8", (6,)),
        ("step_n", "f8", (3,)),
        ("still", "f8", (6,)),
        *[(name, "i8") for name in ("stuck_after", "gap_ns", "equal", "since_ns", "last_ns")],
        *[(name, "i8") for name in ("habit", "habit_before", "habit_since_ns", "fault_before")],
        ("longest", "i8", (3,)),
        ("failed_ns", "i8", (FLICKERS,)),
        *[(name, "?") for name in ("garbage", "failing", "alert")],
    ],
    align=True,
)
"""Limits and memory of one force stream.

``range_n``, ``range_nm``: more is impossible; ``jump_n``: a change of the force that no real force makes;
``stuck_after``: repeats that mean a stuck sensor; ``gap_ns``: a longer silence is a failure. ``before`` is the newest
reading, at ``last_ns``, with the fault ``fault_before``; ``step_n`` is the last change, NaN where it was no jump.
``equal`` readings repeat the one at ``since_ns``, each the one before, up to ``still`` by component. ``impossible``
counts impossible readings less the forgotten ones. ``failed_ns``: when the last failures began, the newest last.
``alert``: the stream failed lately, or some readings were impossible.

``habit``: longest run of equal readings that is usual for the sensor, learned from runs that ended by themselves: the
third longest of the last 10 to 20 s, as one or two longer runs are chance, or a sensor that hung for a moment.
``habit_before`` is that of the previous 10 s; ``longest`` are the runs since ``habit_since_ns``, the longest last.
"""


class WrenchWatch:
    """Reports a force/torque stream that is stuck, garbage or intermittent.

    Args:
        range_n: Largest force that the sensor can report, as the length of the vector, N; more is impossible.
        range_nm: Likewise the largest torque, N·m.
        repeats: Repeats of a reading that mean a stuck sensor. Up to `DEFAULT_REPEATS`, a run of `HANG_NS` that is
            longer than usual for the sensor also counts. 0: never stuck, for a sensor whose readings may rest; they are
            suspect all the same.
        gap_ns: A longer silence is a failure of the stream.
        noise: Stated standard deviation of each force component, N, and of each torque component, N·m; 0: not stated.

    Attributes:
        fault: Fault of the newest reading, or "".
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
        noise: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._stream = stream = new_rows(STREAM, 1)
        stream["range_n"], stream["range_nm"], stream["jump_n"] = range_n, range_nm, JUMP_SHARE * range_n
        stream["stuck_after"], stream["gap_ns"] = repeats or _NEVER, gap_ns
        stream["before"] = stream["step_n"] = math.nan
        stream["still"] = STILL * np.repeat(noise, 3)
        stream["since_ns"] = stream["last_ns"] = _NEVER
        stream["failed_ns"] = -_NEVER
        self._found = 0
        self.fault = ""
        self.suspect = self.rests = False

    def excuse(self, t_ns: int) -> None:
        """Count no gap until ``t_ns``, because the daemon did not read the stream."""
        self._stream["last_ns"] = t_ns

    def update(self, readings: Rows) -> bool:
        """Update with readings as the sensor sent them, before tare and mounting.

        Args:
            readings: Rows of READING, shape (n,), n ≥ 1; the torque is 0 where the device has none. Their doubts are
                filled in.

        Returns:
            Whether one of them is in doubt.
        """
        found = check_readings(readings, self._stream)
        if found != self._found:
            self._found, self.fault = found, FAULTS[found & _FAULT]
            self.suspect, self.rests = bool(found & _SUSPECT), bool(found & _RESTS)
        return found >= _DOUBTED


@compiled
def check_readings(readings: Rows, streams: Rows) -> int:
    """Fill in the doubts about readings in sequence.

    Args:
        readings: Rows of READING, shape (n,), of the sensor.
        streams: One row of STREAM.

    Returns:
        Fault of the newest reading, whether it is suspect, whether it rests, and whether any reading is in doubt.
    """
    stream, found, doubted = streams[0], 0, 0
    for k in range(len(readings)):
        t_ns, wrench, before = readings[k]["t_ns"], readings[k]["wrench"], stream["before"]
        repeats = finite = True
        for i in range(6):
            repeats = repeats and (wrench[i] == before[i] or abs(wrench[i] - before[i]) <= stream["still"][i])
            finite = finite and math.isfinite(wrench[i])
        gap = t_ns - stream["last_ns"] > stream["gap_ns"]
        _follow_run(stream, t_ns, repeats, gap)
        impossible, jumps = _find_impossible(stream, wrench)
        fault = _find_fault(stream, t_ns, gap)
        if impossible and finite and fault != STUCK:
            fault = GARBAGE
        for i in range(6):
            before[i] = wrench[i]
        stream["last_ns"], stream["fault_before"] = t_ns, fault
        rested = t_ns - stream["since_ns"] > RESTED_NS
        lasts = stream["equal"] > 0 and (rested or stream["equal"] > stream["habit"])
        found = fault + (_SUSPECT if jumps or lasts else 0)
        if lasts and not jumps and stream["stuck_after"] == _NEVER:
            found += _RESTS
        doubts = fault if finite else fault + NOT_FINITE
        readings[k]["doubts"] = doubts
        if doubts:
            doubted = _DOUBTED
    return found + doubted


@compiled_part
def _follow_run(stream: Row, t_ns: int, repeats: bool, gap: bool) -> None:
    """Count equal readings; a run that ends by itself, and was never reported as stuck, is usual for the sensor."""
    if not (repeats or gap) and stream["fault_before"] != STUCK:
        _learn_run(stream["longest"], stream["equal"])
    if not repeats:
        stream["equal"] = 0
    elif gap or stream["equal"] == 0:
        _begin_run(stream, t_ns if gap else stream["last_ns"])
    else:
        stream["equal"] += 1


@compiled_part
def _learn_run(longest: Row, equal: int) -> None:
    """Insert a run into the three longest, which are in rising order, where it is longer than one of them."""
    if equal > longest[0]:
        longest[0] = min(equal, longest[1])
        longest[1] = min(max(equal, longest[1]), longest[2])
        longest[2] = max(equal, longest[2])


@compiled_part
def _begin_run(stream: Row, since_ns: int) -> None:
    """Begin a run with the reading of ``since_ns``, and take over what is usual from the last 10 to 20 s."""
    longest, age_ns = stream["longest"], since_ns - stream["habit_since_ns"]
    if age_ns > HABIT_NS:
        stream["habit_before"], stream["habit_since_ns"] = longest[0] if age_ns <= 2 * HABIT_NS else 0, since_ns
        longest[:] = 0
    stream["equal"], stream["since_ns"], stream["habit"] = 1, since_ns, max(stream["habit_before"], longest[0])


@compiled_part
def _find_impossible(stream: Row, wrench: Row) -> tuple[bool, bool]:
    """Return whether a reading is out of range, and whether it jumps; count those that no sensor gives.

    A single jump may be a blow, one that goes back is none. A force without a value is out of range, a torque without
    one is not. A change from or to NaN is no jump.
    """
    step_n, before = stream["step_n"], stream["before"]
    x, y, z = wrench[0] - before[0], wrench[1] - before[1], wrench[2] - before[2]
    jumps = math.hypot(math.hypot(x, y), z) >= stream["jump_n"]
    possible = math.hypot(math.hypot(wrench[0], wrench[1]), wrench[2]) <= stream["range_n"]
    impossible = not possible or math.hypot(math.hypot(wrench[3], wrench[4]), wrench[5]) > stream["range_nm"]
    jumps_back = jumps and step_n[0] * x + step_n[1] * y + step_n[2] * z < 0.0
    step_n[0], step_n[1], step_n[2] = x if impossible or jumps else math.nan, y, z
    if impossible or jumps_back:
        stream["impossible"] = min(stream["impossible"] + 1.0, MOST_IMPOSSIBLE) + FORGET
        stream["alert"] = True
    return impossible, jumps


@compiled_part
def _find_fault(stream: Row, t_ns: int, gap: bool) -> int:
    """Return the fault of the stream; 0 where it has none."""
    stuck = _is_stuck(stream, t_ns)
    if not (gap or stuck or stream["alert"]):
        return 0
    stream["impossible"] = max(stream["impossible"] - FORGET, 0.0)
    garbage = stream["impossible"] >= MOST_IMPOSSIBLE or (stream["garbage"] and stream["impossible"] > 0.0)
    failing, failed_ns = gap or stuck or garbage, stream["failed_ns"]
    if failing and not stream["failing"]:
        for i in range(FLICKERS - 1):
            failed_ns[i] = failed_ns[i + 1]
        failed_ns[FLICKERS - 1] = t_ns
    lately = failing or t_ns - failed_ns[FLICKERS - 1] <= FLICKER_NS
    stream["garbage"], stream["failing"] = garbage, failing
    stream["alert"] = lately or stream["impossible"] > 0.0
    if stuck:
        return STUCK
    if garbage:
        return GARBAGE
    often = lately and failed_ns[FLICKERS - 1] - failed_ns[0] <= FLICKER_NS
    return INTERMITTENT if often else 0


@compiled_part
def _is_stuck(stream: Row, t_ns: int) -> bool:
    """Return whether equal readings last too long: by their stated number, or by what is usual for the sensor."""
    equal, stuck_after, lasts_ns = stream["equal"], stream["stuck_after"], t_ns - stream["since_ns"]
    if equal >= stuck_after:
        return bool(lasts_ns >= STUCK_NS)
    return bool(equal >= HABITS * (stream["habit"] + 1) and stuck_after <= DEFAULT_REPEATS and lasts_ns >= HANG_NS)
