"""Messages about both fingers as one grasp, the gripper, and how fast the arm may go, and when they are published."""

from __future__ import annotations

import math

from slipd.events import Body, Output
from slipd.grasp.grasp_view import GraspView, HoldState
from slipd.grasp.held_object import HeldObject
from slipd.grasp.motion_advice import MotionAdvice
from slipd.grasp.motion_answers import MotionLimits
from slipd.grasp.object_estimate import ObjectState
from slipd.gripper.grip_policy import NoGripper
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.lease import Lease
from slipd.gripper.reflex import ReflexAct
from slipd.publish.message_sequencer import MessageSequencer, Pace
from slipd.types.arrays import finite_fields, finite_list
from slipd_client.messages import GRASP_TOPIC, LEVELS, MOTION_TOPIC

GRASP_FRAME = "gripper"
MOST_HZ = 10.0
"""Largest rate of ``motion``, 1/s: the advice follows loads that are averaged over some tenths of a second."""


class GraspPublisher:
    """Publish a change of the grasp's level or state at once, and all else at the configured rate.

    Args:
        view: The two fingers as one grasp.
        held: The object between them.
        gripper: Measures the width between the pads, and is commanded to open.
        sequencer: Numbers and dates the messages.
        rate_hz: ``rates.grasp_hz``.
    """

    def __init__(
        self,
        view: GraspView,
        held: HeldObject,
        gripper: GripperControl | NoGripper,
        sequencer: MessageSequencer,
        rate_hz: float,
    ) -> None:
        self._view, self._held, self._gripper, self._sequencer = view, held, gripper, sequencer
        self._pace = Pace(rate_hz)
        self._hold = HoldState()

    def publish(self, t_ns: int, out: list[Output]) -> int:
        """Append the message at ``t_ns`` where it is due; return when the next one is."""
        self._hold.update(self._view.levels(), releasing=self._gripper.policy.releasing, t_ns=t_ns)
        if self._pace.passes(t_ns, (self._hold.word, self._view.level())):
            self._view.update(self._gripper.width_m)
            body = grasp_body(self._view, self._hold, self._held.state, t_ns)
            out.append(self._sequencer.message(GRASP_TOPIC, t_ns, GRASP_FRAME, body))
        return self._pace.due_ns


def grasp_body(view: GraspView, hold: HoldState, held: ObjectState, t_ns: int) -> Body:
    """Return ``grasp``: both fingers together at ``t_ns``, as of the last `GraspView.update`."""
    state, load = view.state, view.load(t_ns)
    first, second = [finger.name for finger in view.fingers]
    share = load.first_share
    body = {
        "fingers": [first, second],
        "state": hold.word,
        "state_t_ns": hold.since_ns,
        "level": state.level,
        "level_code": LEVELS.index(state.level),
        "reasons": list(state.reasons),
        "evidence": {name: list(found) for name, found in view.evidence().items()},
        "internal_n": state.internal_n,
        "grip_needed_n": state.grip_needed_n,
        "utilisation": state.utilisation,
        "external_force_n": finite_list(load.external_force_n),
        "external_torque_nm": finite_list(load.external_torque_nm),
        "load_share": {first: share, second: 1.0 - share} if math.isfinite(share) else None,
        "asymmetry": load.asymmetry,
        "width_m": state.width_m,
        "object": {
            "mass_kg": held.mass_kg,
            "mass_std_kg": held.mass_std_kg,
            "com_m": None if held.com_m is None else list(held.com_m),
            "com_std_m": None if held.com_std_m is None else list(held.com_std_m),
            "inertia_kgm2": held.inertia_kgm2,
            "inertia_std_kgm2": held.inertia_std_kgm2,
            "unknown": held.unknown,
        },
        "age_s": load.age_s,
    }
    return finite_fields(body)


def gripper_body(gripper: GripperControl, t_ns: int, act: ReflexAct | None = None) -> Body:
    """Return ``gripper``: the state of the gripper at ``t_ns``."""
    sample, policy = gripper.sample, gripper.policy
    body = {
        "width_m": None if sample is None else sample.width_m,
        "force_command_n": gripper.grip.command_n,
        "force_limit_n": policy.limits.max_n,
        "active": gripper.active,
        "object": None if sample is None else sample.object,
        "moving": None if sample is None else sample.moving,
        "fault": None if sample is None else sample.fault,
        "latched_fault": policy.fault,
        "echo_ok": None if sample is None else sample.echo_ok,
        "current_a": None if sample is None else sample.current_a,
        "force_n": None if sample is None else sample.force_n,
        "lease": lease_body(policy.lease, t_ns),
        "reflex": None if act is None else {"force_n": act.force_n, "from_n": act.from_n, "reason": act.reason},
        "age_s": None if sample is None else (t_ns - sample.t_ns) * 1e-9,
    }
    return finite_fields(body)


def lease_body(lease: Lease, t_ns: int) -> Body:
    """Return ``lease``: whether a client holds the lease, and for how long."""
    expires_in_s = lease.expires_in_s(t_ns)
    return {"held": expires_in_s is not None, "expires_in_s": expires_in_s}


class MotionPublisher:
    """Publish the advice at `MOST_HZ`, and at once where the grasp's level changed or the advice became unknown.

    Args:
        advice: The advice.
        view: The two fingers as one grasp.
        gripper: Measures the width between the pads.
        sequencer: Numbers and dates the messages.
    """

    def __init__(
        self, advice: MotionAdvice, view: GraspView, gripper: GripperControl | NoGripper, sequencer: MessageSequencer
    ) -> None:
        self._advice, self._view, self._gripper, self._sequencer = advice, view, gripper, sequencer
        self._pace = Pace(MOST_HZ)

    def publish(self, t_ns: int, out: list[Output]) -> int:
        """Append the message at ``t_ns`` where it is due; return when the next one is."""
        if self._pace.passes(t_ns, self._view.level()):
            body = motion_body(self._advice, self._advice.limits(t_ns, self._gripper.width_m))
            out.append(self._sequencer.message(MOTION_TOPIC, t_ns, GRASP_FRAME, body))
        return self._pace.due_ns


def motion_body(advice: MotionAdvice, limits: MotionLimits) -> Body:
    """Return ``motion``: how fast the arm may go."""
    along = limits.accelerations_mps2
    return finite_fields(
        {
            "finger": limits.finger,
            "mode": limits.mode,
            "utilisation": limits.utilisation,
            "acceleration_limit_mps2": limits.acceleration_mps2,
            "worst_direction": finite_list(limits.worst_direction),
            "acceleration_limits_mps2": None if along is None else list(along),
            "turn_utilisation": limits.turn_utilisation,
            "worst_gravity_mps2": finite_list(limits.worst_gravity_mps2),
            "angular_acceleration_limit_radps2": limits.angular_acceleration_radps2,
            "safety": advice.safety,
            "grip_needed_n": limits.grip_needed_n,
            "wanted_acceleration_mps2": advice.wanted_mps2,
            "speed_scale": limits.speed_scale,
            "unknown": limits.unknown or None,
        }
    )
