"""``slipctl serve ros2``: messages as ROS 2 topics, and the arm's motion for the daemon, until interrupted."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from cyclonedds.domain import DomainParticipant

from slipd_client.errors import CallError, Silence
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.messages.names import Health
from slipd_client.motion import MotionAdvisor
from slipd_client.quaternions import IDENTITY, unit
from slipd_client.ros.arm_motion import IMU_SPAN_S, POSE_SPAN_S, ArmSource, Imu, Transforms
from slipd_client.ros.conversion import (
    DIAGNOSTICS_TOPIC,
    NAMESPACE,
    PARENT,
    TRANSFORMS_TOPIC,
    Entry,
    PadFrames,
    RosMessage,
    entry,
    pads_of,
    read_config,
    ros_messages,
    stale_diagnostics,
)
from slipd_client.ros.dds import RosPublisher, joined, ros_environment, ros_reader
from slipd_client.ros.feeds import ArmFeed, OrientationFeed, RosFeed, arm_port
from slipd_client.ros.motion_advice import PLAN, PlanCheck, SpeedScaling
from slipd_client.ros.slipd_types import time_of
from slipd_client.subscriber import Subscriber
from slipd_client.topic_limit import TopicLimit


class RosForwarder:
    """Turns messages of the daemon into ROS messages, and publishes them.

    Args:
        publish: Sends a ROS message.
        prefix: Replaces ``/slipd`` at the beginning of topics.
        transforms_topic: Replaces ``/tf``.
        pads: Places of the pads; None: they are not known, and ``/tf`` is not published.
        wrench_rate_hz: Most messages per second of each finger's wrench; readings between them are left out. None: all.
        own_entry: Returns an entry that ``/diagnostics`` has beside those of the daemon, or None.
    """

    def __init__(
        self,
        publish: Callable[[RosMessage], None],
        *,
        prefix: str = NAMESPACE,
        transforms_topic: str = TRANSFORMS_TOPIC,
        pads: PadFrames | None = None,
        wrench_rate_hz: float | None = None,
        own_entry: Callable[[], Entry | None] = lambda: None,
    ) -> None:
        self._publish = publish
        self._prefix = prefix
        self._transforms_topic = transforms_topic
        self._pads = pads
        self._wrenches = TopicLimit(wrench_rate_hz)
        self._own_entry = own_entry
        self._diagnostics: dict[str, Any] = {"status": [entry("daemon", Health.STALE, "", "", {})]}

    def forward(self, topic: str, body: Mapping[str, Any]) -> None:
        """Publish what is made of a message of the daemon."""
        if topic.startswith("wrench.") and not self._wrenches.passes(topic, b"", body["t_ns"] * 1e-9):
            return
        for message in ros_messages(topic, body, self._pads):
            if message.topic == DIAGNOSTICS_TOPIC:
                self._diagnostics = message.value
                self._publish_diagnostics(message.value)
            else:
                self._publish(message._replace(topic=self._named(message.topic)))

    def silent(self, why: str) -> None:
        """Report in ``/diagnostics`` that the daemon is silent: every entry is STALE, because of ``why``."""
        header = {"stamp": time_of(time.time_ns()), "frame_id": ""}
        self._publish_diagnostics(stale_diagnostics(self._diagnostics, header, why))

    def _publish_diagnostics(self, value: dict[str, Any]) -> None:
        own = self._own_entry()
        status = value["status"] if own is None else [*value["status"], own]
        self._publish(RosMessage(DIAGNOSTICS_TOPIC, "diagnostic_msgs/DiagnosticArray", {**value, "status": status}))

    def _named(self, topic: str) -> str:
        return self._transforms_topic if topic == TRANSFORMS_TOPIC else self._prefix + topic.removeprefix(NAMESPACE)


def hand_transform(hand: str) -> dict[str, Any]:
    """Return the ``TFMessage`` that joins the robot's tree of frames to slipd's: ``gripper`` is at ``hand``."""
    transform = {"translation": dict.fromkeys("xyz", 0.0), "rotation": dict(zip("xyzw", IDENTITY, strict=True))}
    header = {"stamp": time_of(time.time_ns()), "frame_id": hand}
    return {"transforms": [{"header": header, "child_frame_id": PARENT, "transform": transform}]}


LATCHED_WARNINGS = 10
"""Number of past warnings that a new subscriber receives."""


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command.

    Raises:
        CallError: An argument or an environment variable is wrong, a file cannot be read, or DDS cannot start.
    """
    _check(chosen)
    environment = ros_environment(os.environ, chosen.domain)
    pads = None if chosen.config is None else pads_of(chosen.config)
    with contextlib.ExitStack() as stack:
        subscriber = stack.enter_context(Subscriber(chosen.publish, ("",), keys=keys))
        participant = stack.enter_context(joined(environment))
        feed = None if pads is None else _feed(chosen, keys, participant, pads, stack)
        _advise(chosen, keys, participant, stack)
        static_transforms = f"{chosen.tf_topic}_static"
        publisher = RosPublisher(participant, {static_transforms: 1, f"{chosen.prefix}/warning": LATCHED_WARNINGS})
        forwarder = RosForwarder(
            publisher.publish,
            prefix=chosen.prefix,
            transforms_topic=chosen.tf_topic,
            pads=pads,
            wrench_rate_hz=chosen.wrench_rate,
            own_entry=lambda: None if feed is None else feed.entry,
        )
        if chosen.hand not in (None, PARENT):
            publisher.publish(RosMessage(static_transforms, "tf2_msgs/TFMessage", hand_transform(chosen.hand)))
        print(f"ros2: domain {environment.domain}, topics {chosen.prefix}/…", flush=True)
        if environment.warning:
            print(f"slipctl: {environment.warning}", file=sys.stderr, flush=True)
        _serve(subscriber, forwarder)


def _feed(
    chosen: argparse.Namespace,
    keys: Keys | None,
    participant: DomainParticipant,
    pads: PadFrames,
    stack: contextlib.ExitStack,
) -> RosFeed | None:
    """Begin to send the daemon the motion of the arm, or its orientation; None: neither is asked for."""
    if not (chosen.imu or chosen.orientation_from):
        return None
    source = _source(participant, chosen)
    port = arm_port(read_config(chosen.config), IMU_SPAN_S if chosen.imu else POSE_SPAN_S)
    if port is not None:
        feed: RosFeed = ArmFeed(participant, port, source)
    else:
        client = stack.enter_context(GripClient(chosen.requests, keys=keys))
        feed = OrientationFeed(client, source, pads.orientations)
    stack.enter_context(feed)
    return feed


def _advise(
    chosen: argparse.Namespace, keys: Keys | None, participant: DomainParticipant, stack: contextlib.ExitStack
) -> None:
    """Begin to publish how fast the arm may go, and to check planned motions, where that is asked for."""
    if chosen.speed_scaling is not None:
        advisor = stack.enter_context(MotionAdvisor(chosen.publish, chosen.requests, keys=keys))
        controller = RosPublisher(participant, {chosen.speed_scaling: 1})
        stack.enter_context(SpeedScaling(controller.publish, chosen.speed_scaling, advisor, chosen.speed_floor))
    if chosen.check_plans is not None:
        client = stack.enter_context(GripClient(chosen.requests, keys=keys))
        stack.enter_context(
            PlanCheck(
                ros_reader(participant, chosen.check_plans, PLAN, reliable=True),
                RosPublisher(participant, {}).publish,
                f"{chosen.prefix}/motion_check",
                client.motion_check,
                chosen.plan_frame or chosen.orientation_from,
                chosen.hand or PARENT,
            )
        )


def _serve(subscriber: Subscriber, forwarder: RosForwarder) -> None:
    reported = False
    for arrived in subscriber.follow():
        if isinstance(arrived, Silence):
            if not reported:
                print(f"slipctl: {arrived}", file=sys.stderr, flush=True)
            forwarder.silent(str(arrived))
        else:
            forwarder.forward(arrived.topic, arrived.raw)
        reported = isinstance(arrived, Silence)


def _check(chosen: argparse.Namespace) -> None:
    """Check that the arguments go together.

    Raises:
        CallError: They do not.
    """
    for wrong, rule in (
        (
            chosen.orientation_from is not None and None in (chosen.hand, chosen.config),
            "--orientation-from needs --hand FRAME, whose orientation is sent, and --config FILE, which has the "
            "orientation of the pads in it",
        ),
        (
            chosen.imu is not None and chosen.config is None,
            "--imu needs --config FILE, which has the orientation of the pads in the gripper's frame",
        ),
        (
            (chosen.speed_scaling is None) is not (chosen.speed_floor is None),
            "--speed-scaling needs --speed-floor, the factor while the speed that holds is not known",
        ),
        (
            chosen.check_plans is not None and not (chosen.plan_frame or chosen.orientation_from),
            "--check-plans needs --plan-frame FRAME, in which the poses of the plans are",
        ),
        (chosen.imu_mount is not None and chosen.imu is None, "--imu-mount belongs to --imu"),
        (chosen.imu_at is not None and chosen.imu is None, "--imu-at belongs to --imu"),
    ):
        if wrong:
            raise CallError(rule)
    if chosen.imu_mount is not None:
        unit(chosen.imu_mount, "--imu-mount")


def _source(participant: DomainParticipant, chosen: argparse.Namespace) -> ArmSource:
    if chosen.imu:
        mount, place_m = tuple(chosen.imu_mount or IDENTITY), tuple(chosen.imu_at or (0.0, 0.0, 0.0))
        return Imu(participant, chosen.imu, mount, place_m)
    return Transforms(participant, chosen.tf_topic, chosen.orientation_from, chosen.hand)
