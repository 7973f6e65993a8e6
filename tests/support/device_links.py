"""Links to the devices of a rig, and what they report of their streams."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from slipd.config import Config
from slipd.devices import bota
from slipd.engine.device_link import DeviceLink, make_links
from slipd.engine.status_reader import _status_of
from slipd.publish.status_publisher import StreamStatus
from slipd_client.messages import Health

MS = 1_000_000
T0 = 100_000_000_000
Parse = Callable[[str], Config]


@pytest.fixture
def links(left: str, right: str, gripper: str, parse: Parse) -> dict[str, DeviceLink]:
    twin = right.replace("finger.right", "finger.third").replace('"2"', '"1"')
    return make_links(parse(left + right + twin + gripper))


def frame(t_ns: int) -> bytes:
    return bota.encode_frame((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), t_ns // 1000)


def health(link: DeviceLink, t_ns: int, source: str = "") -> tuple[Health, str]:
    return link.condition(link.streams[source], t_ns)


def status(link: DeviceLink, t_ns: int, source: str = "") -> StreamStatus:
    return _status_of(link, link.streams[source], t_ns, [], None)


S = 1_000_000_000
