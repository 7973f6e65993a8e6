"""Messages of the daemon on their way to ROS topics: names, rates, and what is published while the daemon is silent."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from slipd_client.messages.names import Health
from slipd_client.ros.conversion import RosMessage, ros_messages
from slipd_client.ros.diagnostics import Entry, entry, stale_diagnostics
from slipd_client.ros.pad_frames import PARENT, PadFrames
from slipd_client.ros.slipd_types import time_of
from slipd_client.ros.topic_names import DIAGNOSTICS_TOPIC, NAMESPACE, TRANSFORMS_TOPIC


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
        self._period_ns = 0 if wrench_rate_hz is None else round(1e9 / wrench_rate_hz)
        self._due_ns: dict[str, int] = {}
        self._own_entry = own_entry
        self._diagnostics: dict[str, Any] = {"status": [entry("daemon", Health.STALE, "", "", {})]}

    def forward(self, topic: str, body: Mapping[str, Any]) -> None:
        """Publish what is made of a message of the daemon."""
        if self._period_ns and topic.startswith("wrench.") and not self._due(topic, body["t_ns"]):
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

    def _due(self, topic: str, t_ns: int) -> bool:
        due_ns = self._due_ns.get(topic, t_ns)
        if t_ns < due_ns <= t_ns + self._period_ns:
            return False
        late = t_ns >= due_ns + self._period_ns or t_ns < due_ns  # a pause, or another clock
        self._due_ns[topic] = (t_ns if late else due_ns) + self._period_ns
        return True


def hand_transform(hand: str) -> dict[str, Any]:
    """Return the ``TFMessage`` that joins the robot's tree of frames to slipd's: ``gripper`` is at ``hand``."""
    transform = {
        "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }
    header = {"stamp": time_of(time.time_ns()), "frame_id": hand}
    return {"transforms": [{"header": header, "child_frame_id": PARENT, "transform": transform}]}
