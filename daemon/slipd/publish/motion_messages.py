"""Messages about how fast the arm may go, and when they are published."""

from __future__ import annotations

from slipd.events import Output
from slipd.grasp.motion_advice import MotionAdvice
from slipd.grasp.motion_answers import MotionLimits
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.no_gripper import NoGripper
from slipd.publish.grasp_messages import GRASP_FRAME
from slipd.publish.message_sequencer import Body, MessageSequencer, Pace, array, finite
from slipd_client.messages import MOTION_TOPIC

MOST_HZ = 10.0


class MotionPublisher:
    """Publish the advice at `MOST_HZ`, and at once where the grasp's level changed or the advice became unknown.

    Args:
        advice: The advice.
        gripper: Measures the width between the pads.
        sequencer: Numbers and dates the messages.

    Attributes:
        advice: As given.
    """

    def __init__(self, advice: MotionAdvice, gripper: GripperControl | NoGripper, sequencer: MessageSequencer) -> None:
        self.advice, self._gripper, self._sequencer = advice, gripper, sequencer
        self._pace = Pace(MOST_HZ)
        self._level = "unknown"

    def publish(self, t_ns: int, out: list[Output]) -> int:
        """Follow the loads, append the message at ``t_ns`` where it is due, and return when to call this again."""
        looks_ns, level = self.advice.follow(t_ns), self.advice.level
        if self._pace.passes(t_ns, now=level != self._level):
            self._level = level
            body = motion_body(self.advice, self.advice.limits(t_ns, self._gripper.width_m))
            out.append(self._sequencer.message(MOTION_TOPIC, t_ns, GRASP_FRAME, body))
        return min(looks_ns, self._pace.due_ns)


def motion_body(advice: MotionAdvice, limits: MotionLimits) -> Body:
    """Return ``motion``: how fast the arm may go."""
    along = limits.accelerations_mps2
    return finite(
        {
            "finger": limits.finger,
            "mode": limits.mode,
            "utilisation": limits.utilisation,
            "acceleration_limit_mps2": limits.acceleration_mps2,
            "worst_direction": array(limits.worst_direction),
            "acceleration_limits_mps2": None if along is None else list(along),
            "turn_utilisation": limits.turn_utilisation,
            "worst_gravity_mps2": array(limits.worst_gravity_mps2),
            "angular_acceleration_limit_radps2": limits.angular_acceleration_radps2,
            "safety": advice.safety,
            "grip_needed_n": limits.grip_needed_n,
            "wanted_acceleration_mps2": advice.wanted_mps2,
            "speed_scale": limits.speed_scale,
            "unknown": limits.unknown or None,
        }
    )
