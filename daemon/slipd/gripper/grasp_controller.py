"""The grasp as it is told, and the reflex that keeps it: both follow the fingers' readings."""

from __future__ import annotations

from slipd.config import Config
from slipd.events import Output, Publish
from slipd.finger.finger import Finger
from slipd.finger.verdict import SEVERITY
from slipd.grasp.grasp_view import GraspView
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.reflex import PERIOD_NS, Reflex, ReflexAct, ReflexSettings
from slipd.publish.message_sequencer import NO_FRAME, MessageSequencer, Pace
from slipd.refusal import Refusal
from slipd_client.messages import GRASP_TOPIC, GRIPPER_TOPIC

GRASP_FRAME = "gripper"
#: Levels at which the reflex is asked at once.
ALARMS = frozenset({"warning", "slipping"})


class GraspController:
    """One grasp of two fingers.

    Args:
        config: The rig, with ``[grasp]``.
        view: The two fingers as one grasp.
        fingers: They.
        gripper: What closes them; None where the config names none.
        outlet: Numbers and dates the messages.
    """

    def __init__(
        self,
        config: Config,
        view: GraspView,
        fingers: list[Finger],
        gripper: GripperControl | None,
        sequencer: MessageSequencer,
    ) -> None:
        self._view, self._fingers, self._gripper, self._sequencer = view, fingers, gripper, sequencer
        self._pace = Pace(config.rates.grasp_hz)
        self._told = "unknown"
        self._reflex = None if gripper is None else _reflex(config, gripper)
        self._alarmed = False
        self._due_ns = 0

    def react(self, t_ns: int) -> Publish | None:
        """Asks the reflex, at once where a finger begins to warn and else once a control period.

        Returns:
            What is to be said of an act, once the gripper's session wrote its command; None where there was none.
        """
        reflex, gripper = self._reflex, self._gripper
        if reflex is None or gripper is None:
            return None
        before, self._alarmed = self._alarmed, self._level() in ALARMS
        if t_ns < self._due_ns and (before or not self._alarmed):
            return None
        self._due_ns = t_ns + PERIOD_NS
        state = self._view.update(t_ns, gripper.width_m)
        feels = all(finger.is_trusted_for_raise(t_ns) for finger in self._fingers)
        act = reflex.decide(state.level, state.grip_needed_n, state.internal_n, feels, t_ns)
        if act is None or isinstance(gripper.carry_out("reflex", t_ns, force_n=act.force_n), Refusal):
            return None
        reflex.acted(act)
        return self._sequencer.message(GRIPPER_TOPIC, t_ns, NO_FRAME, gripper.body(t_ns) | {"reflex": _told(act)})

    def tell(self, t_ns: int, out: list[Output]) -> None:
        """Adds what is to be said of the grasp."""
        level = self._level()
        changed = level != self._told
        if not self._pace.passes(t_ns, now=changed):
            return
        self._told = level
        self._view.update(t_ns, None if self._gripper is None else self._gripper.width_m)
        out.append(self._sequencer.message(GRASP_TOPIC, t_ns, GRASP_FRAME, self._view.body(t_ns)))

    def _level(self) -> str:
        """Of the worse finger."""
        return max((finger.state.verdict.level for finger in self._fingers), key=SEVERITY.__getitem__)


def make_grasp_controller(
    config: Config, fingers: dict[str, Finger], gripper: GripperControl | None, sequencer: MessageSequencer
) -> GraspController | None:
    """The grasp of a config; None where it has no ``[grasp]``."""
    if config.grasp is None:
        return None
    held = [fingers[name] for name in config.grasp.pads]
    return GraspController(config, GraspView(config.grasp, fingers), held, gripper, sequencer)


def _reflex(config: Config, gripper: GripperControl) -> Reflex | None:
    limit_n = None if config.gripper is None else config.gripper.max_force_n
    if not config.reflex.enabled or limit_n is None:
        return None
    wanted = config.reflex
    settings = ReflexSettings(
        ceiling_n=limit_n if wanted.ceiling_n is None else wanted.ceiling_n,
        raise_n_per_s=wanted.raise_n_per_s,
        slip_gain=wanted.slip_gain,
        calm_s=wanted.calm_s,
        lower_n_per_s=wanted.lower_n_per_s,
    )
    return Reflex(settings, gripper.policy)


def _told(act: ReflexAct) -> dict[str, float | str]:
    return {"force_n": act.force_n, "from_n": act.from_n, "reason": act.reason}
