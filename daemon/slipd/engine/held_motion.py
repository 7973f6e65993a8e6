"""Motion of a held object by evidence beside its load: images, high band, width of the gripper, and another process."""

from __future__ import annotations

from typing import cast

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.grasp.pad_motion import make_pad_motion
from slipd.gripper.gripper_control import GripperControl
from slipd.motion.evidence import REPORTED_NS, Evidence, MotionRisk
from slipd.motion.outside_motion import OutsideMotion
from slipd.motion.width_change import WidthChange
from slipd.rig import Rig
from slipd.types.samples import ObjectSample

Found = list[tuple[Finger, FingerState]]
"""Fingers that now report motion, with their states."""


class HeldMotion:
    """Combines the evidence of each finger, and that of the whole grasp, by the risk of each finger.

    Args:
        rig: Its parts.
    """

    def __init__(self, rig: Rig) -> None:
        gripper, fingers, grasp = rig.gripper, rig.fingers, rig.config.grasp
        self._pads = make_pad_motion(list(fingers.values()))
        self._width = WidthChange(gripper.session.width_step_m) if isinstance(gripper, GripperControl) else None
        observed = None if grasp is None else grasp.object
        self._outside = None if observed is None else OutsideMotion(observed.std_m, observed.rate_hz)
        self._risks: dict[str, MotionRisk] = {}
        self._fingers = fingers
        watches = {"image_change": self._pads, "width": self._width, "external": self._outside}
        shared = {kind: watch.looks_per_hour for kind, watch in watches.items() if watch is not None}
        for name, finger in fingers.items():
            looks = shared | ({} if finger.motion is None else {"image_change": finger.motion.looks_per_hour})
            if looks:
                self._risks[name] = MotionRisk(rig.config.levels.false_alarms_per_hour, looks)

    def update_image(self, finger: Finger) -> Found:
        """Judge what the newest image of a finger shows, after `Finger.update_image`."""
        motion, evidence = finger.motion, finger.motion_evidence
        if motion is None:
            return self._update_pads()
        kinds = () if evidence is None else self._risks[finger.name].update(evidence)
        return _report(finger, motion.confirm(), kinds) if kinds else []

    def _update_pads(self) -> Found:
        """Look at pads that measure the force themselves, after an image of one of them."""
        pads = self._pads
        if pads is None or (look := pads.update()) is None:
            return []
        found = self._judge(*look)
        if found:
            pads.confirm()
        return found

    def update_gripper(self, gripper: GripperControl, t_ns: int) -> Found:
        """Judge the newest reading of the gripper, of ``t_ns``."""
        width = cast("WidthChange", self._width)
        evidence = width.update(t_ns, gripper.width_m, held=gripper.holds, command=gripper.command)
        return self._judge_and_confirm(evidence)

    def update_object(self, sample: ObjectSample, acquired_ns: int) -> Found:
        """Judge a reading of the object by another process, acquired at ``acquired_ns``."""
        if self._outside is None or sample.status:
            return []
        held = all(finger.presence.is_pressed() for finger in self._fingers.values())
        return self._judge_and_confirm(self._outside.update(acquired_ns, sample, held=held))

    def _judge_and_confirm(self, evidence: Evidence | None) -> Found:
        found = [] if evidence is None else self._judge(evidence)
        for watch in (self._width, self._outside) if found else ():
            if watch is not None:
                watch.confirm()
        return found

    def _judge(self, evidence: Evidence, belief: float = 0.0) -> Found:
        """Judge evidence of the whole grasp: all fingers report what is enough for one of them.

        Args:
            evidence: The evidence.
            belief: Evidence of the load, see `MotionRisk.update`.
        """
        kinds = max((risk.update(evidence, belief) for risk in self._risks.values()), key=len)
        found: Found = []
        for finger in self._fingers.values() if kinds else ():
            found += _report(finger, evidence.t_ns + REPORTED_NS, kinds)
        return found


def _report(finger: Finger, until_ns: int, kinds: tuple[str, ...]) -> Found:
    state = finger.note_motion(until_ns, kinds)
    return [] if state is None else [(finger, state)]
