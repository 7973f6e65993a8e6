"""Sends the daemon the arm's orientation that ROS nodes publish: ``gravity.set`` at 10 Hz for each finger."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence

from slipd_client.errors import ClientError
from slipd_client.gravity_feed import OBSTACLE_S, PERIOD_S, gravity_of
from slipd_client.grip import GripClient
from slipd_client.messages.names import Health
from slipd_client.quaternions import product
from slipd_client.ros.conversion import Entry, entry
from slipd_client.ros2.arm_sources import ArmSource
from slipd_client.ros2.background import Background
from slipd_client.ros2.orientation import OrientationUnknown


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
        self._told = ""

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
            self._tell(*self._state)

    def _wait(self) -> bool:
        """Wait until there is something to send; return whether the feed has ended."""
        return self._ended.wait(PERIOD_S)

    def _send(self) -> tuple[Health, str]:
        """Send what is new; return the state and the reason for it."""
        raise NotImplementedError

    def _tell(self, level: Health, why: str) -> None:
        """Print a failure that has lasted for a while, and its end."""
        now_s = time.monotonic()
        if level is Health.OK:
            self._well_s = now_s
            if self._told:
                print(f"slipctl: the {self._what} is sent again", file=sys.stderr, flush=True)
            self._told = ""
        elif why != self._told and now_s - self._well_s > OBSTACLE_S:
            print(f"slipctl: no {self._what} is sent: {why}", file=sys.stderr, flush=True)
            self._told = why


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
