"""What a link reports of a device that is silent or sends something else: what arrives, and what to check."""

from __future__ import annotations

import numpy as np
import pytest
from device_links import health
from fixture_types import Parse
from nanoseconds import T0

from slipd.config import transport_of
from slipd.devices import DEVICES
from slipd.events import LinkSpec
from slipd.links.device_link import make_links
from slipd.publish.stream_health import why_silent
from slipd.tools.sim.emulated_pads import encode_message
from slipd_client.messages import Health

LATER = T0 + 2_000_000_000


@pytest.mark.parametrize(
    ("name", "source", "junk", "message"),
    [
        (
            "left.wrench",
            "",
            b"\xaa" * 500,
            "bytes arrive, none is a Bota frame: is the baud rate 460800? is it another device?",
        ),
        (
            "left.pad",
            "",
            b"\xaa" * 500,
            "bytes arrive, none is a frame of a PVDF pad: is the baud rate 57600 (the default is 921600)?"
            " is it another device?",
        ),
        (
            "right.pad",
            "2",
            b"hello",
            "bytes arrive, none is a message of a XELA server: is ws://127.0.0.1:5000 its address?"
            " is it another device?",
        ),
        ("left.wrench", "", b"r,0,C,1\r\n", "bytes arrive, but no reading (waiting)"),
        ("left.wrench", "", b"", "open, but no bytes arrive: is it powered? is it connected to this port?"),
        ("right.pad", "2", b"", "open, but no bytes arrive: is it powered? is it connected to ws://127.0.0.1:5000?"),
        ("right.pad", "2", b'{"message":1}', "bytes arrive, but no reading"),
        (
            "right.pad",
            "2",
            encode_message(1, {"1": np.full((4, 3), 1000)}, 1.7e9),
            "readings arrive, none of sensor '2': is it plugged in? is `sensor` right?",
        ),
    ],
)
def test_a_silent_link_reports_what_arrives_and_what_to_check(
    name: str, source: str, junk: bytes, message: str, left: str, right: str, parse: Parse
) -> None:
    twin = right.replace("finger.right", "finger.third").replace('"2"', '"1"')
    links = make_links(parse(left.replace("rate_hz = 100.0", "rate_hz = 100.0\nbaud = 57600") + right + twin))
    link = links[name]
    link.open("port", T0)
    if junk:
        link.receive(junk, LATER)
    assert health(link, LATER, source) == (Health.STALE, message)


@pytest.mark.parametrize(
    ("device", "port", "words"),
    [
        ("external", "ipc:///run/slipd/push", "does it push to ipc:///run/slipd/push?"),
        ("external_gripper", "unix:///run/slipd/gripper", "does it register the gripper?"),
    ],
)
def test_silence_of_a_program_is_explained_as_such(device: str, port: str, words: str) -> None:
    spec = LinkSpec("left.wrench", transport_of(port), port)
    assert words in why_silent(DEVICES[device], spec, "", bytes_come=False, garbled=False, state="")
    garbled = why_silent(DEVICES[device], spec, "", bytes_come=True, garbled=True, state="")
    assert garbled.endswith("does the driver pack them as docs/devices.md says?")
    others = why_silent(DEVICES[device], spec, "", bytes_come=True, garbled=False, others=True, state="")
    assert others.endswith(" does its `seq` count up?") == (device == "external")
