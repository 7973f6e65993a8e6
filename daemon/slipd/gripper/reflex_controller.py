"""Run the reflex: decide when it acts, collect its inputs, and send its commands through the motion gate."""

from __future__ import annotations

from slipd.config import Config
from slipd.finger.finger import Finger
from slipd.grasp.grasp_view import GraspView
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.no_gripper import NoGripper
from slipd.gripper.reflex import PERIOD_NS, Reflex, ReflexAct, ReflexSettings

ALARMS = frozenset({"warning", "slipping"})
"""Levels at which the reflex decides at once."""


class ReflexController:
    """Let the reflex act on the grasp of two fingers.

    Args:
        settings: How the reflex acts.
        view: The two fingers as one grasp.
        fingers: The two fingers.
        gripper: The gripper that holds with them.

    Attributes:
        due_ns: Time of the next decision, unless a finger begins to warn before.
    """

    def __init__(
        self, settings: ReflexSettings, view: GraspView, fingers: list[Finger], gripper: GripperControl
    ) -> None:
        self._view, self._fingers, self._gripper = view, fingers, gripper
        self._reflex = Reflex(settings, gripper.policy)
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
        trusted = all(finger.trust.for_raise(t_ns) for finger in self._fingers)
        needed_n = state.grip_kept_n if state.level == "stable" else state.grip_needed_n
        act = self._reflex.decide(state.level, needed_n, state.internal_n, trusted, t_ns)
        if act is None or self._gripper.carry_out("reflex", t_ns, force_n=act.force_n) is not None:
            return None
        self._reflex.acted(act)
        return act


def make_reflex_controller(
    config: Config, view: GraspView | None, fingers: dict[str, Finger], gripper: GripperControl | NoGripper
) -> ReflexController | None:
    """Return the reflex of a config; None where it has none, or no force limit."""
    if (
        isinstance(gripper, NoGripper)
        or view is None
        or not config.reflex.enabled
        or gripper.policy.limits.max_n is None
    ):
        return None
    wanted = config.reflex
    settings = ReflexSettings(
        ceiling_n=gripper.policy.limits.max_n if wanted.ceiling_n is None else wanted.ceiling_n,
        raise_n_per_s=wanted.raise_n_per_s,
        slip_gain=wanted.slip_gain,
        calm_s=wanted.calm_s,
        lower_n_per_s=wanted.lower_n_per_s,
    )
    return ReflexController(settings, view, [fingers[name] for name in view.names], gripper)
