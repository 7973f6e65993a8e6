"""Messages about how fast the arm may go, and when they are published."""

from __future__ import annotations

from slipd.events import Output
from slipd.grasp.motion_advice import MotionAdvice, MotionLimits
from slipd.publish.grasp_messages import GRASP_FRAME
from slipd.publish.message_sequencer import Body, MessageSequencer, Pace, array, finite
from slipd_client.messages import MOTION_TOPIC

MOST_HZ = 10.0


class MotionPublisher:
    """Publish the advice at `MOST_HZ`, and at once where the grasp's level changed or the advice became unknown.

    Args:
        advice: The advice.
        sequencer: Numbers and dates the messages.

    Attributes:
        pace: Limits the rate of messages without a change.
    """

    def __init__(self, advice: MotionAdvice, sequencer: MessageSequencer) -> None:
        self._advice, self._sequencer = advice, sequencer
        self.pace = Pace(MOST_HZ)
        self._level = "unknown"

    def publish(self, t_ns: int, out: list[Output]) -> None:
        """Append the message at ``t_ns`` where it is due."""
        level = self._advice.level
        if self.pace.passes(t_ns, now=level != self._level):
            self._level = level
            body = motion_body(self._advice, self._advice.limits(t_ns))
            out.append(self._sequencer.message(MOTION_TOPIC, t_ns, GRASP_FRAME, body))


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
