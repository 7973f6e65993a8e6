"""How fast the arm may go with the object in the grip: a scale for a control loop, and a check for a planner.

What is not known is None, or the floor that the caller states. It is never full speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from slipd_client.client_base import GripClientBase
from slipd_client.errors import CallError
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.messages import MOTION_TOPIC
from slipd_client.messages.replies import MotionReply
from slipd_client.messages.topics import Motion
from slipd_client.quaternions import STANDARD_DOWN, conjugate, plus, rotated
from slipd_client.request_protocol import TIMEOUT_S
from slipd_client.subscriber import Subscriber

STALE_S = 0.35
"""Age at which advice no longer counts, s: the daemon publishes it at 10 Hz, so that two messages may be late."""


def point_of(
    t_s: float,
    quat_xyzw: Sequence[float],
    acceleration_mps2: Sequence[float],
    angular_velocity_radps: Sequence[float] = (0.0, 0.0, 0.0),
    angular_acceleration_radps2: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[float]:
    """Return a point of a trajectory for `MotionAdvisor.check`, from values in a base frame whose Z points up.

    Args:
        t_s: Its time, s.
        quat_xyzw: Orientation of the gripper frame in the base, unit quaternion.
        acceleration_mps2: Of the origin of the gripper frame, m/s².
        angular_velocity_radps: Of the gripper, rad/s.
        angular_acceleration_radps2: Likewise, rad/s².
    """
    felt = plus(STANDARD_DOWN, [-each for each in acceleration_mps2])
    vectors = (felt, angular_velocity_radps, angular_acceleration_radps2)
    return [t_s, *(each for vector in vectors for each in rotated(conjugate(quat_xyzw), vector))]


class MotionAdvisorBase:
    """What the blocking and the asyncio advisor share.

    Args:
        publish: Where the daemon publishes; its default endpoint when None.
        requests: Where it accepts requests; likewise.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        timeout_s: How long ``check`` waits for a reply.

    Attributes:
        client: Sends the requests; it never needs the lease.
        why_unknown: Why the newest advice is not known, for people; "" where it is.
    """

    _kind: type[GripClientBase]

    def __init__(
        self,
        publish: str | None = None,
        requests: str | None = None,
        *,
        keys: Keys | None = None,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self.client: Any = self._kind(requests, keys=keys, timeout_s=timeout_s)
        self._messages = Subscriber(publish, (MOTION_TOPIC,), keys=keys)
        self._newest: Motion | None = None
        self.why_unknown = ""

    def advice(self) -> Motion | None:
        """Return the newest advice, with the limits along each axis; None if none has come or it is stale.

        A daemon on another machine must have answered one request before, which shows its clock.
        """
        for message in self._messages.newest():
            if isinstance(message, Motion):
                self._newest = message
        newest = self._newest
        if newest is None:
            self.why_unknown = "no advice has come: is slipd running, with [grasp] in its config?"
            return None
        age_s = newest.age_by(self.client.clock)
        age_s = newest.age_s if age_s is None else age_s
        if not -STALE_S <= age_s <= STALE_S:
            self.why_unknown = f"the newest advice is {age_s:.3g} s old"
            return None
        self.why_unknown = newest.unknown or ""
        return newest

    def speed_scale(self, floor: float | None = None) -> float | None:
        """Return the time scale, 0 to 1, for the next step of a control loop; it never waits.

        With the speed multiplied by it, and accelerations thereby by its square, the grip holds the acceleration of
        ``[grasp.motion]`` in every direction.

        Args:
            floor: Returned while the scale is not known, 0 to less than 1; None: None is returned then.

        Raises:
            CallError: The floor is full speed, or no scale.
        """
        if floor is not None and not 0.0 <= floor < 1.0:
            raise CallError(f"floor must be from 0 to less than 1: what is not known is never full speed, got {floor}")
        advice = self.advice()
        if advice is None or advice.unknown or advice.speed_scale is None:
            self.why_unknown = self.why_unknown or "no speed is known to hold"
            return floor
        return min(max(advice.speed_scale, 0.0), 1.0)


class MotionAdvisor(MotionAdvisorBase):
    """The blocking advisor, best used in a ``with`` statement. Arguments: `MotionAdvisorBase`."""

    _kind = GripClient
    client: GripClient

    def check(
        self,
        trajectory: Sequence[Sequence[float]] | None = None,
        acceleration_mps2: Sequence[float] | None = None,
    ) -> MotionReply:
        """Return whether the grip holds a motion, and how far to slow it down. It moves nothing.

        Args:
            trajectory: Up to 2,000 points as of `point_of`, at rising times.
            acceleration_mps2: Instead of it one acceleration from the present orientation, in the gripper frame.

        Raises:
            RequestRefused: A point is no point.
            NoAnswer: The daemon does not answer.
        """
        return self.client.motion_check(trajectory, acceleration_mps2)

    def close(self) -> None:
        """Close the connections."""
        self._messages.close()
        self.client.disconnect()

    def __enter__(self) -> MotionAdvisor:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()
