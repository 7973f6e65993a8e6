"""The friction of one finger's contact: what is stated of it, and what its readings teach."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slipd.friction.friction_state import FrictionState, LogMu, ObjectFriction, RotationFriction, Taught
from slipd.fusion.friction_learning import KEPT, LEARNING, begin_grasp, combine, end_grasp
from slipd.fusion.rows import new_rows
from slipd.types.arrays import finite_or_none

STEP_NS = 20_000_000
"""A verdict takes over what was learned at multiples of this time, so that it does not depend on how readings are split
into reads; shorter than any reaction to it."""
MOST_OBJECTS = 256
"""Named objects that are remembered; beyond that, the one that was not named for longest is forgotten."""

SEEN_SHARE = 0.5
"""Part of the fall from static to dynamic friction that must be seen before it counts as slip."""
LEAST_DROP = 0.01
"""Least relative fall that counts as slip: less is no fall."""

_UNKNOWN_OBJECT = ObjectFriction()


class FrictionEstimate:
    """Coefficients of friction of one contact: stated by the config or a client, and learned from its grasps.

    Learning starts anew with each contact. What it found for a named object is kept for the next grasp of that object.

    Args:
        mu: Stated coefficient of static friction, a low estimate; None: unknown.
        spread: Its relative standard deviation; 0: it is known exactly, and nothing is learned.
        most: Largest coefficient that a verdict may use.
        drop: Least relative fall of the required friction that counts as slip.
        mu_rotation: Stated coefficient that limits rotation; None: ``mu`` does.

    Attributes:
        state: What is in force.
        stated: Coefficient of static friction by config or client; None: unknown.
        drop: Least relative fall of the required friction that counts as slip: as given, or less.
        set_by: Client that set the coefficients last; None: only the config did.
        set_t_ns: When it did, CLOCK_MONOTONIC; None likewise.
        rotation: What is learned of rotation.
        learning: What is learned: one row of LEARNING, for `slipd.fusion.friction_learning.learn`.
    """

    def __init__(
        self, mu: float | None, spread: float, most: float, drop: float = 0.03, mu_rotation: float | None = None
    ) -> None:
        self.learning = new_rows(LEARNING, 1)
        self.learning["spread"], self.learning["most"] = spread, most
        self.drop = self._most_drop = drop
        self.set_by: str | None = None
        self.set_t_ns: int | None = None
        self.rotation = RotationFriction(mu_rotation)
        self._step = 0  # number of the step of STEP_NS in which the state was taken over
        self._objects: dict[str, ObjectFriction] = {}
        self._name: str | None = None
        self._version = -1
        self._restart(mu, None, "config")

    def set(self, mu_s: float, mu_d: float | None, by: str, t_ns: int | None) -> None:
        """Use the coefficients that a client states, for the rest of the run, and forget what was learned.

        Args:
            mu_s: Coefficient of static friction.
            mu_d: Coefficient of dynamic friction; None: the fall that counts as slip stays as it is.
            by: The client.
            t_ns: Now, CLOCK_MONOTONIC.
        """
        if mu_d is not None:
            self.drop = self._drop(mu_s, mu_d)
        self.rotation.forget()
        self._restart(mu_s, mu_d, "request")
        self.set_by, self.set_t_ns = by, t_ns

    def _restart(self, mu: float | None, mu_d: float | None, source: str) -> None:
        """Forget all that was learned: other coefficients are stated, by "config" or "request"."""
        self.learning["stated"] = math.nan if mu is None else mu
        self.stated, self._stated_d, self._source = mu, mu_d, source
        self._objects.clear()
        self._know(_UNKNOWN_OBJECT)
        begin_grasp(self.learning)
        self._take_over()

    @property
    def strictest(self) -> float | None:
        """Least μ that is in use, stated, or known of a named object; None: unknown, now or with the next grasp."""
        if self.state.mu is None or self.stated is None:
            return None
        return min(self.state.mu, self.stated, self.least_known)

    def is_more_lenient(self, mu_s: float, mu_d: float | None) -> bool:
        """Return whether these coefficients would make a verdict more lenient, in this grasp or a later one.

        A larger μ does, and so does a larger fall before a slip is reported.
        """
        if self.strictest is None or mu_s > self.strictest:
            return True
        return mu_d is not None and self._drop(mu_s, mu_d) > self.drop

    def _drop(self, mu_s: float, mu_d: float) -> float:
        """Return the least relative fall that counts as slip for these coefficients."""
        return min(max(SEEN_SHARE * (1.0 - mu_d / mu_s), LEAST_DROP), self._most_drop)

    def doubt(self) -> None:
        """Forget what makes verdicts more lenient than what is stated: it was measured with another zero.

        What makes them stricter stays: if it is wrong, a warning comes too early, and an object that is known to be
        slippery does not pass for another one because somebody took a tare.
        """
        self._objects = {
            name: known._replace(floor=0.0) for name, known in self._objects.items() if self._is_strict(known)
        }
        known = self._knowledge()
        self._know(known._replace(floor=0.0) if self._is_strict(known) else _UNKNOWN_OBJECT)
        (bound,), (stated,) = self.learning["bound"].tolist(), self.learning["stated"].tolist()
        if bound < stated:
            self.learning["floor"] = self.learning["carried"] = 0.0
            combine(self.learning)
        else:
            begin_grasp(self.learning)
        self._take_over()

    def _is_strict(self, known: ObjectFriction) -> bool:
        """Return whether an object is known to have a lower coefficient than what is stated."""
        stated: float = self.learning["stated"].item()
        return known.least_mu < stated  # False for NaN

    def end_contact(self) -> None:
        """End the grasp: the contact ended, or is no longer known."""
        end_grasp(self.learning)
        self._take_over()
        self.forget_turns()

    def discard_grasp(self) -> None:
        """Forget what the grasp taught, for its object too: its readings turned out not to be trusted."""
        begin_grasp(self.learning)
        self._take_over()

    def set_object(self, name: str | None) -> None:
        """Name the object in the grip, or the next one; None: it has no name.

        A name given during a grasp counts for all of it. Another name, or none, is another object: all starts anew.
        """
        before = self._name
        if name == before:
            return
        if before is not None:
            end_grasp(self.learning)
            self._objects.pop(before, None)
            self._objects[before] = self._knowledge()
            if len(self._objects) > MOST_OBJECTS:
                del self._objects[next(iter(self._objects))]
        self._name = name
        self._know(self._objects.get(name, _UNKNOWN_OBJECT) if name is not None else _UNKNOWN_OBJECT)
        if before is None:
            combine(self.learning)
        else:
            begin_grasp(self.learning)
        self._take_over()

    @property
    def least_known(self) -> float:
        """Least coefficient with which the next grasp of a named object begins; inf where no slip of one is known."""
        coefficients = [known.least_mu for known in (*self._objects.values(), self._knowledge())]
        return min((mu for mu in coefficients if not math.isnan(mu)), default=math.inf)

    def taught(self) -> tuple[Taught, Taught]:
        """Return what was learned of the object in the grip: its static and its dynamic friction."""
        known = self._knowledge()
        static, dynamic = (LogMu(ln, var).real for ln, var in zip(known.ln, known.var, strict=True))
        return Taught(self._slips(0), static), Taught(self._slips(1), dynamic)

    def resume(self, taught: tuple[Taught, Taught]) -> None:
        """Go on with what the run before learned in the present grasp, if it is stricter than what is stated.

        What was carried does not go on: it only makes verdicts more lenient.
        """
        before = self.learning.copy()
        for kind, (slips, earlier) in enumerate(taught):
            samples = [*slips, *self._slips(kind)][-KEPT:]
            self.learning["taken"][0, kind] = len(samples)
            for k, sample in enumerate(samples):
                slip = (sample and sample.real) or LogMu()
                self.learning["sample_ln"][0, kind, k], self.learning["sample_var"][0, kind, k] = slip
            if (known := earlier and earlier.real) is not None:
                self.learning["object_ln"][0, kind], self.learning["object_var"][0, kind] = known
        self.learning["touched_s"] = math.inf  # the time without a daemon is no gap that ends the grasp
        combine(self.learning)
        (bound,), (stated,) = self.learning["bound"].tolist(), self.learning["stated"].tolist()
        if not 0.0 < bound < stated:
            self.learning[:] = before
        self._take_over()

    def _slips(self, kind: int) -> tuple[LogMu | None, ...]:
        """Return the samples of one coefficient by the present grasp, the newest last."""
        (taken,) = self.learning["taken"][:, kind].tolist()
        at = [k % KEPT for k in range(max(taken - KEPT, 0), taken)]
        lns, variances = (self.learning[name][0, kind].tolist() for name in ("sample_ln", "sample_var"))
        return tuple(LogMu(lns[k], variances[k]).real for k in at)

    def begin_step(self, times_ns: Sequence[int], begin: int) -> int:
        """Take over what was learned, if reading ``begin`` is the first of another step of `STEP_NS`.

        Args:
            times_ns: When the readings were acquired, CLOCK_MONOTONIC; they rise.
            begin: Index of a reading.

        Returns:
            Index of the first reading after it for which the state has to be taken over again, or their number.
        """
        if times_ns[-1] // STEP_NS == self._step:
            return len(times_ns)
        step = times_ns[begin] // STEP_NS
        if step != self._step:
            self._step = step
            self._take_over()
        while begin < len(times_ns) and times_ns[begin] // STEP_NS == step:
            begin += 1
        return begin

    def note_turn(self, until_s: float) -> None:
        """Learn that the object moves, and counts as moving until then; see `RotationFriction.slip`."""
        self.rotation.slip(until_s)
        self._set_state()

    def forget_turns(self) -> None:
        """Forget what was learned of rotation: the contact ended, or is not known."""
        self.rotation.forget()
        self._set_state()

    def _know(self, known: ObjectFriction) -> None:
        """Use what earlier grasps taught of the object in the grip."""
        for name, values in known._asdict().items():
            self.learning[f"object_{name}"] = values
        self.learning["named"] = self._name is not None

    def _knowledge(self) -> ObjectFriction:
        """Return what earlier grasps taught of the object in the grip."""
        return ObjectFriction(*(self.learning[f"object_{name}"][0].tolist() for name in ObjectFriction._fields))

    def _take_over(self) -> None:
        """Put in force what was learned."""
        version = int(self.learning["changes"][0])
        if version == self._version:
            return
        self._version = version
        mu, low, high, mu_d, carried, learned = (
            self.learning[name].item() for name in ("bound", "low", "high", "dynamic", "carried", "learned")
        )
        known, most = finite_or_none(mu), finite_or_none(high)
        dynamic = self._stated_d if math.isnan(mu_d) else mu_d
        self._known = FrictionState(
            known,
            "none" if known is None else "learned" if learned else self._source,
            finite_or_none(low),
            most,
            dynamic if dynamic is None or most is None else min(dynamic, most),
            carried or None,
            self._name,
        )
        self._set_state()

    def _set_state(self) -> None:
        self.state = self._known._replace(mu_rotation=self.rotation.learned)
