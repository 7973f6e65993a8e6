"""Links to the devices of a rig, and what is reported of their streams."""

from __future__ import annotations

from typing import Any

import pytest
from engine_rig import RIG
from fixture_types import Parse

from slipd import config
from slipd.devices import bota
from slipd.events import WallClock
from slipd.links.device_link import DeviceLink, make_links
from slipd.publish.message_sequencer import MessageSequencer
from slipd.publish.status_publisher import StatusPublisher
from slipd.publish.stream_health import link_condition
from slipd.requests.handlers import RecordingState
from slipd.rig import Rig
from slipd_client.messages import Health


@pytest.fixture
def links(left: str, right: str, gripper: str, parse: Parse) -> dict[str, DeviceLink]:
    twin = right.replace("finger.right", "finger.third").replace('"2"', '"1"')
    return make_links(parse(left + right + twin + gripper))


def frame(t_ns: int) -> bytes:
    return bota.encode_frame((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), t_ns // 1000)


def health(link: DeviceLink, t_ns: int, source: str = "") -> tuple[Health, str]:
    return link_condition(link, link.streams[source], t_ns)


def status(link: DeviceLink, t_ns: int, source: str = "") -> dict[str, Any]:
    """What ``status`` says of a stream, beside what its finger knows."""
    rig = Rig(config.parse(RIG, "rig.toml"), "boot", WallClock(0))
    recordings = RecordingState(rig.boot, rig.wall)
    publisher = StatusPublisher(rig, recordings, {}, MessageSequencer(rig.boot, rig.config.config_id, rig.wall))
    stream = link.streams[source]
    name, stream.name = stream.name, "alone"
    body = publisher._stream_body(link, stream, t_ns)
    stream.name = name
    return body
