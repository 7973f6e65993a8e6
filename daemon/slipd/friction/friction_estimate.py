"""The friction of one finger's contact: what is stated of it, and what its readings teach."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from slipd.friction.friction_state import FrictionState
from slipd.friction.learning import KEPT, LEARNING, SCATTER, WIDENING, Z, begin_grasp, combine, end_grasp, learn
from slipd.fusion.rows import Rows, new_rows
from slipd.types.finite import finite_or_none

STEP_NS = 20_000_000
"""A verdict takes over what was learned at multiples of this time, so that it does not depend on how readings are split
into reads; shorter than any reaction to it."""
MOST_OBJECTS = 256
"""Named objects that are remembered; beyond that the one forgotten is the one not named for longest."""

MOST_LN = 7.0
"""Largest absolute logarithm of a coefficient that one run takes over from another: beyond it no friction is real."""

_OBJECT = ("object_ln", "object_var", "object_floor")
_Knowledge = tuple[tuple[float, float], tuple[float, float], float]
_UNKNOWN = math.nan, math.nan
_NOTHING: _Knowledge = _UNKNOWN, _UNKNOWN, 0.0


class Taught(NamedTuple):
    """What was learned of one coefficient; each pair is the mean and the variance of its logarithm.

    Attributes:
        slips: By the slips of the present grasp, the newest last; None: one that was disproved since.
        earlier: By earlier grasps of the named object; None: nothing.
    """

    slips: tuple[tuple[float, float] | None, ...]
    earlier: tuple[float, float] | None


class FrictionEstimate:
    """Learns the friction of one contact, and gives the coefficient that a verdict uses.

    It starts anew with each contact. What it learned of a named object is kept for the next grasp of that object.

    Args:
        mu: Stated coefficient of static friction, a low estimate; None: unknown.
        spread: Its relative standard deviation; 0: it is known exactly, and nothing is learned.
        most: Largest coefficient that a verdict may use.

    Attributes:
        state: The result that is in force.
    """

    def __init__(self, mu: float | None, spread: float, most: float) -> None:
        self._row = new_rows(LEARNING, 1)
        self._row["spread"], self._row["most"] = spread, most
        self._objects: dict[str, _Knowledge] = {}
        self._name: str | None = None
        self._step = 0
        self._version = -1
        self.state = FrictionState()
        self.restart(mu, None, "config")

    def restart(self, mu: float | None, mu_d: float | None, source: str) -> None:
        """Forget all that was learned: other coefficients are stated.

        Args:
            mu: Of static friction; None: unknown.
            mu_d: Of dynamic friction; None: unknown.
            source: Who states them: "config" or "request".
        """
        self._row["stated"] = math.nan if mu is None else mu
        self._source, self._stated_d = source, mu_d
        self._objects.clear()
        self._know(_NOTHING)
        begin_grasp(self._row)
        self._take_over()

    def doubt(self) -> None:
        """Forget what makes verdicts more lenient than what is stated: it was measured with another zero.

        What makes them stricter stays: if it is wrong, a warning comes too early, and an object that is known to be
        slippery does not pass for another one because somebody took a tare.
        """
        self._objects = {
            name: (ln, var, 0.0) for name, (ln, var, _) in self._objects.items() if self._is_strict(ln, var)
        }
        ln, var, _ = self._knowledge()
        self._know((ln, var, 0.0) if self._is_strict(ln, var) else _NOTHING)
        (bound,), (stated,) = self._row["bound"].tolist(), self._row["stated"].tolist()
        if bound < stated:
            self._row["floor"] = self._row["carried"] = 0.0
            combine(self._row)
        else:
            begin_grasp(self._row)
        self._take_over()

    def _is_strict(self, ln: tuple[float, float], var: tuple[float, float]) -> bool:
        """Return whether knowledge of an object gives it a lower coefficient than what is stated."""
        (stated,) = self._row["stated"].tolist()
        return not math.isnan(var[0]) and math.exp(_lowest(ln, var)) < stated

    def end_contact(self) -> None:
        """End the grasp: the contact ended, or is no longer known."""
        end_grasp(self._row)
        self._take_over()

    def discard_grasp(self) -> None:
        """Forget what the grasp taught, for its object too: its readings turned out not to be trusted."""
        begin_grasp(self._row)
        self._take_over()

    def set_object(self, name: str | None) -> None:
        """Name the object in the grip, or the next one; None: it has no name.

        A name given during a grasp counts for all of it. Another name, or none, is another object: all starts anew.
        """
        before = self._name
        if name == before:
            return
        if before is not None:
            end_grasp(self._row)
            self._objects.pop(before, None)
            self._objects[before] = self._knowledge()
            if len(self._objects) > MOST_OBJECTS:
                del self._objects[next(iter(self._objects))]
        self._name = name
        self._know(self._objects.get(name, _NOTHING) if name is not None else _NOTHING)
        if before is None:
            combine(self._row)
        else:
            begin_grasp(self._row)
        self._take_over()

    @property
    def least_known(self) -> float:
        """Least coefficient with which the next grasp of a named object begins; inf where no slip of one is known."""
        known = [*self._objects.values(), self._knowledge()]
        return math.exp(min((_lowest(ln, var) for ln, var, _ in known if not math.isnan(var[0])), default=math.inf))

    def taught(self) -> tuple[Taught, Taught]:
        """Return what was learned of the object in the grip: its static and its dynamic friction."""
        ln, var, _ = self._knowledge()
        static, dynamic = map(_real, zip(ln, var, strict=True))
        return Taught(self._slips(0), static), Taught(self._slips(1), dynamic)

    def resume(self, taught: tuple[Taught, Taught]) -> None:
        """Go on with what the run before learned in the present grasp, if it is stricter than what is stated.

        What was carried does not go on: it only makes verdicts more lenient.
        """
        before = self._row.copy()
        for kind, (slips, earlier) in enumerate(taught):
            samples = [*slips, *self._slips(kind)][-KEPT:]
            self._row["taken"][0, kind] = len(samples)
            for k, sample in enumerate(samples):
                ln, var = _real(sample) or _UNKNOWN
                self._row["sample_ln"][0, kind, k], self._row["sample_var"][0, kind, k] = ln, var
            if (known := _real(earlier)) is not None:
                self._row["object_ln"][0, kind], self._row["object_var"][0, kind] = known
        self._row["touched_s"] = math.inf  # the time without a daemon is no gap that ends the grasp
        combine(self._row)
        (bound,), (stated,) = self._row["bound"].tolist(), self._row["stated"].tolist()
        if not 0.0 < bound < stated:
            self._row[:] = before
        self._take_over()

    def _slips(self, kind: int) -> tuple[tuple[float, float] | None, ...]:
        """Return the samples of one coefficient by the present grasp, the newest last."""
        (taken,) = self._row["taken"][:, kind].tolist()
        at = [k % KEPT for k in range(max(taken - KEPT, 0), taken)]
        lns, variances = (self._row[name][0, kind].tolist() for name in ("sample_ln", "sample_var"))
        return tuple(_real((lns[k], variances[k])) for k in at)

    def segments(self, times_ns: Sequence[int]) -> Iterator[tuple[int, int]]:
        """Yield ranges of readings with one state each; take over what was learned before each of them.

        Args:
            times_ns: When the readings were acquired, CLOCK_MONOTONIC; they rise.
        """
        begin, count = 0, len(times_ns)
        if times_ns[-1] // STEP_NS != self._step:
            for k, t_ns in enumerate(times_ns):
                step = t_ns // STEP_NS
                if step != self._step:
                    if k > begin:
                        yield begin, k
                    self._step, begin = step, k
                    self._take_over()
        yield begin, count

    def learn(self, readings: Rows, shape_error: float, *, teaches: bool, raises: bool) -> None:
        """Learn from assessed readings; arguments as of `slipd.friction.learning.learn`."""
        learn(readings, self._row, shape_error, teaches, raises)

    def _know(self, knowledge: _Knowledge) -> None:
        """Use what earlier grasps taught of the object in the grip."""
        for name, values in zip(_OBJECT, knowledge, strict=True):
            self._row[name] = values
        self._row["named"] = self._name is not None

    def _knowledge(self) -> _Knowledge:
        """Return what earlier grasps taught of the object in the grip."""
        (ln,), (var,), (floor,) = (self._row[name].tolist() for name in _OBJECT)
        return ln, var, floor

    def _take_over(self) -> None:
        """Put in force what was learned."""
        version = int(self._row["changes"][0])
        if version == self._version:
            return
        self._version = version
        mu, low, high, mu_d, carried, learned = (
            self._row[name].item() for name in ("bound", "low", "high", "dynamic", "carried", "learned")
        )
        known, most = finite_or_none(mu), finite_or_none(high)
        dynamic = self._stated_d if math.isnan(mu_d) else mu_d
        self.state = FrictionState(
            known,
            "none" if known is None else "learned" if learned else self._source,
            finite_or_none(low),
            most,
            dynamic if dynamic is None or most is None else min(dynamic, most),
            carried or None,
            self._name,
        )


def _real(known: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return mean and variance of the logarithm of a coefficient; None where they cannot be those of friction."""
    return known if known is not None and abs(known[0]) <= MOST_LN and 0.0 < known[1] < math.inf else None


def _lowest(ln: tuple[float, float], var: tuple[float, float]) -> float:
    """Return the logarithm of the coefficient with which the next grasp of a known object begins."""
    return ln[0] - Z * math.sqrt(var[0] + WIDENING**2 + SCATTER**2)
