"""Sends the daemon what ROS nodes report of the arm: its motion, as the stream ``[grasp.arm]``, or its orientation.

A feed is a thread beside the messages of ``slipctl serve ros2``. Its state is an entry of ``/diagnostics``.
"""

from __future__ import annotations

import itertools
import math
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import zmq
from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.util import duration

from slipd_client.errors import CallError, ClientError
from slipd_client.gravity_feed import OBSTACLE_S, PERIOD_S, gravity_of
from slipd_client.grip import GripClient
from slipd_client.messages.codec import encode
from slipd_client.messages.names import Health
from slipd_client.quaternions import product
from slipd_client.ros.arm_motion import ArmReading, ArmSource, clock_offset_ns
from slipd_client.ros.conversion import Entry, entry
from slipd_client.ros.orientation import STALE_S, OrientationUnknown


class Background(threading.Thread):
    """A daemon thread that runs until `stop`; as a context, it runs within ``with``.

    Args:
        name: What it does.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._ended = threading.Event()

    def __enter__(self) -> None:
        self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()


class RosFeed(Background):
    """Sends the daemon what ROS reports of the arm, and reports failures.

    Args:
        what: What is sent, for people.
    """

    def __init__(self, what: str) -> None:
        super().__init__(what)
        self._what = what
        self._state = (Health.STALE, f"no {what} yet")
        self._well_s = time.monotonic()
        self._reported = ""

    @property
    def entry(self) -> Entry:
        """State of the feed, as an entry of ``/diagnostics``."""
        level, why = self._state
        return entry(f"{self._what} from ROS", level, why, "", {})

    def run(self) -> None:
        """Send until `stop`."""
        while not self._wait():
            try:
                self._state = self._send()
            except Exception as error:  # a message that cannot be decoded, for example; the next one may be well
                self._state = (Health.ERROR, f"{type(error).__name__}: {error}")
            self._report(*self._state)

    def _wait(self) -> bool:
        """Wait until there is something to send; return whether the feed has ended."""
        return self._ended.wait(PERIOD_S)

    def _send(self) -> tuple[Health, str]:
        """Send what is new; return the state and the reason for it."""
        raise NotImplementedError

    def _report(self, level: Health, why: str) -> None:
        """Print a failure that has lasted for a while, and its end."""
        now_s = time.monotonic()
        if level is Health.OK:
            self._well_s = now_s
            if self._reported:
                print(f"slipctl: the {self._what} is sent again", file=sys.stderr, flush=True)
            self._reported = ""
        elif why != self._reported and now_s - self._well_s > OBSTACLE_S:
            print(f"slipctl: no {self._what} is sent: {why}", file=sys.stderr, flush=True)
            self._reported = why


class OrientationFeed(RosFeed):
    """Sends the orientation while it is known; the daemon forgets it 0.25 s after the last one.

    Args:
        client: Sends the requests, from this thread alone.
        source: Where the orientation comes from.
        pads: Orientation of each pad in the gripper's frame.
    """

    def __init__(self, client: GripClient, source: ArmSource, pads: Mapping[str, Sequence[float]]) -> None:
        super().__init__("orientation")
        self._client, self._source, self._pads = client, source, pads

    def _send(self) -> tuple[Health, str]:
        try:
            gripper = self._source.orientation(time.monotonic())
        except OrientationUnknown as error:
            return Health.STALE, str(error)
        refused: ClientError | None = None
        for finger, pad in self._pads.items():
            try:
                self._client.gravity_set(finger, gravity_of(product(gripper, pad)))
            except ClientError as error:
                refused = error
        return (Health.OK, "") if refused is None else (Health.ERROR, str(refused))


LOOK_S = 0.05
"""Longest wait for a message before the feed checks whether it has ended, s."""

QUEUE = 50
"""Readings that wait for a daemon that is busy; those of a daemon that is not there are dropped."""


class ArmPort(NamedTuple):
    """Where the readings go.

    Attributes:
        endpoint: ``port`` of ``[grasp.arm]``.
        sensor: ``sensor`` of it.
    """

    endpoint: str
    sensor: str


def arm_port(config: Mapping[str, Any], span_s: float) -> ArmPort | None:
    """Return where the readings go; None where the config has no ``[grasp.arm]`` that programs push.

    Args:
        config: Tables of the daemon's config.
        span_s: Span of the filter.

    Raises:
        CallError: The table is wrong, or readings would be stale by the delay of the filter.
    """
    arm = config["grasp"].get("arm")
    if arm is None or arm.get("device") != "external":
        return None
    try:
        rate_hz, port = float(arm["rate_hz"]), ArmPort(str(arm["port"]), str(arm["sensor"]))
        stale_s = float(arm.get("stale_s", max(3.0 / rate_hz, 0.02)))
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise CallError("[grasp.arm] must have port, sensor and rate_hz; check it: slipd check") from error
    if stale_s < span_s:
        raise CallError(
            f"stale_s of [grasp.arm] must be at least {span_s:g}, got {stale_s:g}: the filter of the acceleration "
            f"delays the readings by {span_s / 2:g} s"
        )
    return port


class ArmFeed(RosFeed):
    """Pushes every motion; where it stops, the daemon's stream becomes stale.

    Args:
        participant: Of the domain.
        port: Where the readings go.
        source: Where the motion comes from.

    Raises:
        CallError: The port is not an endpoint.
    """

    def __init__(self, participant: DomainParticipant, port: ArmPort, source: ArmSource) -> None:
        super().__init__("motion of the arm")
        self._port, self._source = port, source
        self._numbers = itertools.count()
        self._pushed_s = -math.inf
        states = ViewState.Any | InstanceState.Any | SampleState.NotRead
        self._arrival = ReadCondition(source.reader, states)
        self._arrivals = WaitSet(participant)
        self._arrivals.attach(self._arrival)
        self._socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.PUSH)
        for option, value in ((zmq.LINGER, 0), (zmq.IMMEDIATE, 1), (zmq.SNDHWM, QUEUE)):
            self._socket.setsockopt(option, value)
        try:
            self._socket.connect(port.endpoint)
        except zmq.ZMQError as error:
            self._socket.close()
            raise CallError(f"port of [grasp.arm] must be an endpoint, got {port.endpoint!r:.80}: {error}") from error

    def stop(self) -> None:
        """End the thread, and close the connection."""
        super().stop()
        self._socket.close()

    def _wait(self) -> bool:
        self._arrivals.wait(duration(seconds=LOOK_S))
        return self._ended.is_set()

    def _send(self) -> tuple[Health, str]:
        now_s = time.monotonic()
        trouble = ""
        for newest_ns, motion in self._source.read(now_s):
            try:
                offset_ns = clock_offset_ns(newest_ns, time.time_ns(), time.monotonic_ns())
            except OrientationUnknown as error:
                trouble = str(error)
                continue
            if motion is not None and self._push(motion, offset_ns):
                self._pushed_s = now_s
            elif motion is not None:
                trouble = f"no daemon takes it at {self._port.endpoint}"
        if now_s - self._pushed_s <= STALE_S:
            return Health.OK, ""
        return Health.STALE, trouble or self._source.trouble

    def _push(self, motion: ArmReading, offset_ns: int) -> bool:
        reading = {
            "stream": self._port.sensor,
            "t_ns": motion.stamp_ns + offset_ns,
            "seq": next(self._numbers),
            "gravity_mps2": motion.gravity_mps2,
            "angular_velocity_radps": motion.angular_velocity_radps,
            "angular_acceleration_radps2": motion.angular_acceleration_radps2,
        }
        try:
            self._socket.send(encode(reading), zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True
