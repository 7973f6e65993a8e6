"""Raises the grip by itself when a finger warns, and undoes that slowly; every act has a reason.

It raises only at "warning" or "slipping" and lowers only while "stable"; "caution" lies between, so the two never hunt
each other. What the gripper has not yet had time to do is not asked for again: an act is judged by its effect only
after `SETTLE_NS`, else a slow gripper would be wound up to its ceiling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slipd.gripper.grip_policy import ROUNDING_N, GripPolicy

#: Least time between two acts, and the time whose rise one act may take: grippers answer some 50 commands a second.
PERIOD_NS = 20_000_000
#: A gripper shows the effect of a command after this long.
SETTLE_NS = 100_000_000
#: What was not looked at for so long was not calm.
LONGEST_GAP_NS = 250_000_000
#: Smaller differences are noise of the need or rounding of the gripper, N.
DEAD_BAND_N = 0.1
#: It lowers to a tenth above the need, so that noise and a gripper that rounds down do not call it back.
KEEP = 1.1


@dataclass(frozen=True, slots=True)
class ReflexSettings:
    """How the reflex acts; forces on one pad.

    Attributes:
        ceiling_n: Most that it asks for, N.
        raise_n_per_s: How fast it raises, N/s.
        slip_gain: Times the present force that it asks for where a finger slips although the grip should hold.
        calm_s: It lowers only after so long without need, s.
        lower_n_per_s: How fast it lowers, N/s; 0: never.
    """

    ceiling_n: float
    raise_n_per_s: float
    slip_gain: float
    calm_s: float
    lower_n_per_s: float


@dataclass(frozen=True, slots=True)
class ReflexAct:
    """A force to tell the gripper now.

    Attributes:
        force_n: On one pad, N.
        from_n: Force in force, N.
        reason: "needed" (a finger warns, and this is on the way to what is needed), "slipping" (it slips although the
            grip should hold) or "calm" (less is needed for long).
    """

    force_n: float
    from_n: float
    reason: str


class Reflex:
    """Decides on the force of one grasp; to be asked at each reading and tick, whatever the level. Time is an argument.

    Args:
        settings: How it acts.
        policy: The force in force, what was asked for, and what limits and budget leave. Whether an act may happen is
            for the motion gate to say.
    """

    def __init__(self, settings: ReflexSettings, policy: GripPolicy) -> None:
        self._settings = settings
        self._policy = policy
        self._t_ns = 0
        self._forget()

    def _forget(self) -> None:
        """Nothing is gripped: what was known of the grasp is void."""
        self._told_n: float | None = None
        self._told_ns = 0
        self._lack_n = 0.0
        self._goal_n: float | None = None
        self._calm_ns: int | None = None
        self._line_n: float | None = None
        self._act: ReflexAct | None = None
        self._act_ns = self._raise_ns = -SETTLE_NS

    def decide(
        self, level: str, needed_n: float | None, internal_n: float | None, trusted: bool, t_ns: int
    ) -> ReflexAct | None:
        """Decide what to send the gripper now; once the gripper has taken it, call `acted`.

        Args:
            level: Level of the worse finger, a word of the message API.
            needed_n: Least force on one pad that holds both fingers, N; None or not finite: not known, or none would.
            internal_n: Internal grip force measured, N; None or not finite: not measured.
            trusted: Nothing speaks against the readings of either finger; without, it does nothing.
            t_ns: Now; an earlier time than the last counts as the last.

        Returns:
            What to do, or None: nothing.
        """
        elapsed_ns = max(t_ns - self._t_ns, 0)
        self._t_ns += elapsed_ns
        force_n = self._policy.force_n
        if force_n is None:
            self._forget()
            return None
        self._follow(force_n, _known(internal_n) if trusted else None)
        need_n = _known(needed_n)
        if trusted and level == "stable" and need_n is not None and elapsed_ns <= LONGEST_GAP_NS:
            return self._hand_out(self._lower(KEEP * need_n + max(self._lack_n, 0.0), force_n, elapsed_ns))
        self._calm_ns = self._line_n = None
        if trusted and level in ("warning", "slipping"):
            wanted_n = None if need_n is None else need_n + self._lack_n
            return self._hand_out(self._raise(wanted_n, level == "slipping", force_n))
        return None

    def acted(self, act: ReflexAct) -> None:
        """Note that the gripper accepted the act that `decide` has just returned."""
        self._act, self._act_ns = act, self._t_ns
        if act.force_n > act.from_n:
            self._raise_ns = self._t_ns

    def _follow(self, force_n: float, internal_n: float | None) -> None:
        """Learns by how much the grip felt stays behind the force told, once the gripper had time to follow."""
        if force_n != self._told_n:
            if self._told_n is not None and force_n < self._told_n:
                self._goal_n = None
            self._told_n, self._told_ns = force_n, self._t_ns
        elif self._t_ns - self._told_ns >= SETTLE_NS:
            self._lack_n = 0.0 if internal_n is None else force_n - internal_n

    def _raise(self, wanted_n: float | None, slipping: bool, force_n: float) -> ReflexAct | None:
        """A step towards the force wanted, or where it slips all the same towards `slip_gain` times the present."""
        reason = "needed"
        if slipping and (wanted_n is None or wanted_n <= force_n + DEAD_BAND_N):
            if self._t_ns - self._raise_ns >= SETTLE_NS:
                self._goal_n = self._settings.slip_gain * force_n
            wanted_n, reason = self._goal_n, "slipping"
        most_n = self._policy.most_n
        if wanted_n is None or most_n is None:
            return None
        wanted_n = min(wanted_n, self._settings.ceiling_n, most_n)
        base_n = force_n
        if self._act is not None and self._act.from_n == force_n and self._t_ns - self._raise_ns < SETTLE_NS:
            base_n = max(force_n, self._act.force_n)  # the gripper has not shown it: the rise goes on from there
        if wanted_n <= base_n + DEAD_BAND_N:
            return None
        step_n = self._settings.raise_n_per_s * PERIOD_NS * 1e-9
        return ReflexAct(min(wanted_n, base_n + step_n), force_n, reason)

    def _lower(self, keep_n: float, force_n: float, elapsed_ns: int) -> ReflexAct | None:
        """A step down a line that falls at `lower_n_per_s` to what is to be kept, and to what the client asked for."""
        if self._calm_ns is None:
            self._calm_ns = self._t_ns
        rate = self._settings.lower_n_per_s
        if rate == 0.0 or self._t_ns - self._calm_ns < self._settings.calm_s * 1e9:
            return None
        line_n = force_n if self._line_n is None else self._line_n - rate * elapsed_ns * 1e-9
        step_n = max(rate * PERIOD_NS * 1e-9, DEAD_BAND_N)
        self._line_n = max(line_n, force_n - step_n, keep_n, self._policy.requested_n or 0.0)
        return ReflexAct(self._line_n, force_n, "calm") if self._line_n <= force_n - DEAD_BAND_N + ROUNDING_N else None

    def _hand_out(self, act: ReflexAct | None) -> ReflexAct | None:
        """Let an act pass that neither comes too soon nor repeats the last at once."""
        since_ns = self._t_ns - self._act_ns
        if act is None or since_ns < PERIOD_NS or (act == self._act and since_ns < SETTLE_NS):
            return None
        return act


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
