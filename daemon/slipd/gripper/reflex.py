"""The reflex: raises the grip force when a finger warns, and lowers it slowly afterwards; every act has a reason.

It raises only at "warning" or "slipping" and lowers only while "stable". "caution" lies between, so that raising and
lowering never oscillate. The effect of an act is judged only after `SETTLE_NS`; otherwise a slow gripper would be
driven up to the ceiling.
"""

from __future__ import annotations

from dataclasses import dataclass

from slipd.config import Reflex as ReflexConfig
from slipd.grasp.grasp_view import GraspView
from slipd.gripper.grip_policy import ROUNDING_N, GripPolicy
from slipd.gripper.gripper_control import GripperControl
from slipd.types.arrays import finite_or_none

PERIOD_NS = 20_000_000
"""Least time between two acts, and the time over which one act ramps: grippers take about 50 commands a second."""

SETTLE_NS = 100_000_000
"""A gripper shows the effect of a command after this long."""

LONGEST_GAP_NS = 250_000_000
"""After a longer pause between two decisions the calm time starts again."""

DEAD_BAND_N = 0.1
"""Smaller differences are noise of the needed force, or rounding by the gripper, N."""

KEEP = 1.1
"""Factor above the needed force that lowering keeps: noise, or a gripper that rounds down, must not trigger a raise."""


@dataclass(frozen=True, slots=True)
class ReflexAct:
    """A force that the reflex sends to the gripper.

    Attributes:
        force_n: On one pad, N.
        from_n: Force in force, N.
        reason: "needed" (a finger warns, and its load needs more force), "slipping" (a finger slips although the force
            should hold) or "calm" (less force has been enough for some time).
    """

    force_n: float
    from_n: float
    reason: str


class Reflex:
    """Decides on the force of one grasp; call `decide` at every reading and tick, whatever the level.

    Args:
        config: ``[reflex]``.
        policy: The force in force, the force that a client requested, and what limits, step, rate and budget leave. The
            grip gate decides whether an act may happen.
    """

    def __init__(self, config: ReflexConfig, policy: GripPolicy) -> None:
        self._config = config
        self._policy = policy
        self._t_ns = 0
        self._forget()

    def _forget(self) -> None:
        """Forget the grasp: nothing is gripped."""
        self._command_n: float | None = None
        self._command_ns = 0
        self._deficit_n = 0.0
        self._goal_n: float | None = None
        self._calm_ns: int | None = None
        self._ramp_n: float | None = None
        self._act: ReflexAct | None = None
        self._act_ns = self._raise_ns = -SETTLE_NS

    def decide(
        self, level: str, needed_n: float | None, internal_n: float | None, trusted: bool, t_ns: int
    ) -> ReflexAct | None:
        """Decide what to send the gripper now; call `acted` once the gripper has accepted it.

        Args:
            level: Level of the worse finger.
            needed_n: Least force on one pad that holds the load, N; None or not finite: not known, or no force does.
            internal_n: Measured internal grip force, N; None or not finite: not measured.
            trusted: The readings of both fingers are trusted; otherwise the reflex does nothing.
            t_ns: Now; a time before the last one counts as the last one.

        Returns:
            The act, or None.
        """
        elapsed_ns = max(t_ns - self._t_ns, 0)
        self._t_ns += elapsed_ns
        force_n = self._policy.force_n
        if force_n is None:
            self._forget()
            return None
        self._follow(force_n, finite_or_none(internal_n) if trusted else None)
        need_n = finite_or_none(needed_n)
        if trusted and level == "stable" and need_n is not None and elapsed_ns <= LONGEST_GAP_NS:
            return self._paced(self._lower(KEEP * need_n + max(self._deficit_n, 0.0), force_n, elapsed_ns))
        self._calm_ns = self._ramp_n = None
        if trusted and level in ("warning", "slipping"):
            wanted_n = None if need_n is None else need_n + self._deficit_n
            return self._paced(self._raise(wanted_n, level == "slipping", force_n))
        return None

    def acted(self, act: ReflexAct) -> None:
        """Record that the gripper accepted the act that `decide` has just returned."""
        self._act, self._act_ns = act, self._t_ns
        if act.force_n > act.from_n:
            self._raise_ns = self._t_ns

    def _follow(self, force_n: float, internal_n: float | None) -> None:
        """Learn how far the measured grip force stays below the commanded one, once the gripper had time to settle."""
        if force_n != self._command_n:
            if self._command_n is not None and force_n < self._command_n:
                self._goal_n = None
            self._command_n, self._command_ns = force_n, self._t_ns
        elif self._t_ns - self._command_ns >= SETTLE_NS:
            self._deficit_n = 0.0 if internal_n is None else force_n - internal_n

    def _raise(self, wanted_n: float | None, slipping: bool, force_n: float) -> ReflexAct | None:
        """Return a step up, to the wanted force or, if that force is in force and slips, to `slip_gain` times it."""
        reason = "needed"
        if slipping and (wanted_n is None or wanted_n <= force_n + DEAD_BAND_N):
            if self._t_ns - self._raise_ns >= SETTLE_NS:
                self._goal_n = self._config.slip_gain * force_n
            wanted_n, reason = self._goal_n, "slipping"
        most_n = self._policy.reflex_most_n
        if wanted_n is None or most_n is None:
            return None
        ceiling_n = self._config.ceiling_n
        wanted_n = min(wanted_n, most_n if ceiling_n is None else ceiling_n, most_n)
        base_n = force_n
        if self._act is not None and self._act.from_n == force_n and self._t_ns - self._raise_ns < SETTLE_NS:
            base_n = max(force_n, self._act.force_n)  # no effect seen yet: continue the ramp from there
        _, left_n = self._policy.change_left_n(self._t_ns)
        if wanted_n <= base_n + DEAD_BAND_N or left_n <= DEAD_BAND_N:
            return None
        step_n = self._config.raise_n_per_s * PERIOD_NS * 1e-9
        return ReflexAct(min(wanted_n, base_n + step_n, force_n + left_n), force_n, reason)

    def _lower(self, keep_n: float, force_n: float, elapsed_ns: int) -> ReflexAct | None:
        """Return a step down a ramp of `lower_n_per_s`, no lower than ``keep_n`` and the requested force."""
        if self._calm_ns is None:
            self._calm_ns = self._t_ns
        rate = self._config.lower_n_per_s
        if rate == 0.0 or self._t_ns - self._calm_ns < self._config.calm_s * 1e9:
            return None
        ramp_n = force_n if self._ramp_n is None else self._ramp_n - rate * elapsed_ns * 1e-9
        left_n, _ = self._policy.change_left_n(self._t_ns)
        step_n = min(max(rate * PERIOD_NS * 1e-9, DEAD_BAND_N), left_n)
        self._ramp_n = max(ramp_n, force_n - step_n, keep_n, self._policy.requested_n or 0.0)
        return ReflexAct(self._ramp_n, force_n, "calm") if self._ramp_n <= force_n - DEAD_BAND_N + ROUNDING_N else None

    def _paced(self, act: ReflexAct | None) -> ReflexAct | None:
        """Return the act unless it comes too soon or repeats the last one at once."""
        since_ns = self._t_ns - self._act_ns
        if act is None or since_ns < PERIOD_NS or (act == self._act and since_ns < SETTLE_NS):
            return None
        return act


ALARMS = frozenset({"warning", "slipping"})
"""Levels at which the reflex decides at once."""


class ReflexController:
    """Let the reflex act on the grasp of two fingers.

    Args:
        config: ``[reflex]``.
        view: The two fingers as one grasp.
        gripper: The gripper that holds with them.

    Attributes:
        due_ns: Time of the next decision, unless a finger begins to warn before.
    """

    def __init__(self, config: ReflexConfig, view: GraspView, gripper: GripperControl) -> None:
        self._view, self._gripper = view, gripper
        self._reflex = Reflex(config, gripper.policy)
        self._alarmed = False
        self.due_ns = 0

    def react(self, t_ns: int) -> ReflexAct | None:
        """Let the reflex decide: at once when a finger begins to warn, else once in a control period.

        Returns:
            The act whose command the gripper's session has accepted; None where there was none.
        """
        before, self._alarmed = self._alarmed, self._view.level() in ALARMS
        if t_ns < self.due_ns and (before or not self._alarmed):
            return None
        self.due_ns = t_ns + PERIOD_NS
        state = self._view.update(self._gripper.width_m)
        trusted = all(finger.trust.for_raise(t_ns) for finger in self._view.fingers)
        needed_n = state.grip_kept_n if state.level == "stable" else state.grip_needed_n
        act = self._reflex.decide(state.level, needed_n, state.internal_n, trusted, t_ns)
        if act is None or self._gripper.carry_out("reflex", t_ns, force_n=act.force_n) is not None:
            return None
        self._reflex.acted(act)
        return act
