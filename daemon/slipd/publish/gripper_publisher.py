"""Messages about the gripper: its state after a reading, a loss, or an act of the reflex."""

from __future__ import annotations

from slipd.events import Output
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.lease import Lease
from slipd.gripper.no_gripper import NoGripper
from slipd.gripper.reflex import ReflexAct
from slipd.publish.message_sequencer import NO_FRAME, MessageSequencer
from slipd.publish.wire_values import Body, finite
from slipd_client.messages import GRIPPER_TOPIC


class GripperPublisher:
    """Publish every state of the gripper, where there is one.

    Args:
        gripper: The gripper.
        sequencer: Numbers and dates the messages.
    """

    def __init__(self, gripper: GripperControl | NoGripper, sequencer: MessageSequencer) -> None:
        self._gripper = gripper
        self._sequencer = sequencer

    def publish(self, t_ns: int, out: list[Output], act: ReflexAct | None = None) -> None:
        """Append the state at ``t_ns``, with the act of the reflex that led to it."""
        if isinstance(self._gripper, GripperControl):
            body = gripper_body(self._gripper, t_ns, act)
            out.append(self._sequencer.message(GRIPPER_TOPIC, t_ns, NO_FRAME, body))


def gripper_body(gripper: GripperControl, t_ns: int, act: ReflexAct | None = None) -> Body:
    """Return ``gripper``: the state of the gripper at ``t_ns``."""
    sample, policy = gripper.sample, gripper.policy
    body = {
        "width_m": None if sample is None else sample.width_m,
        "force_command_n": gripper.force_command_n,
        "force_limit_n": policy.limits.max_n,
        "active": None if sample is None else sample.active,
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
    return finite(body)


def lease_body(lease: Lease, t_ns: int) -> Body:
    """Return ``lease``: whether a client holds the lease, and for how long."""
    expires_in_s = lease.expires_in_s(t_ns)
    return {"held": expires_in_s is not None, "expires_in_s": expires_in_s}
