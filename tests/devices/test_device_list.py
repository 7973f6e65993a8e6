"""The list of devices: what it promises holds for every one."""

from __future__ import annotations

import random
import subprocess
import sys

import pytest

from slipd.devices import DEVICES, Device

devices = pytest.mark.parametrize("device", list(DEVICES.values()), ids=list(DEVICES))


def test_the_list_names_each_device_once_with_its_kind_and_transports() -> None:
    assert {name: (device.kind, device.transports, device.baud, device.axes) for name, device in DEVICES.items()} == {
        "bota": ("wrench", ("serial",), 460_800, 0),
        "dsacon32": ("tactile", ("serial", "tcp"), 115_200, 1),
        "external": ("any", ("external",), None, 0),
        "gauges": ("wrench", ("serial",), 921_600, 0),
        "netft": ("wrench", ("udp",), None, 0),
        "optoforce": ("wrench", ("serial", "udp"), 1_000_000, 0),
        "papillarray": ("tactile", ("serial",), 115_200, 3),
        "pvdf": ("tactile", ("serial",), 921_600, 1),
        "robotiq_2f": ("gripper", ("serial",), 115_200, 0),
        "robotous": ("wrench", ("serial",), 115_200, 0),
        "tsf85": ("tactile", ("serial",), 115_200, 1),
        "wts": ("tactile", ("serial",), 115_200, 1),
        "xela": ("tactile", ("websocket",), None, 3),
    }
    assert all(name == device.name for name, device in DEVICES.items())
    silent = {"external", "gauges", "pvdf", "xela"}
    assert {name for name, device in DEVICES.items() if device.session is None} == silent
    assert len(DEVICES) == 13


def test_a_file_that_devices_share_is_no_device() -> None:
    for name in ("framing", "crc", "health", "no_such_device", "", "bota.py", "../errors"):
        assert name not in DEVICES
    with pytest.raises(KeyError, match="framing"):
        DEVICES["framing"]


@devices
def test_no_decoder_raises_or_reads_anything_in_noise(device: Device) -> None:
    rng = random.Random(device.name)
    decoder = device.decoder()
    for size in (0, 1, 7, 100, 5000):
        for _ in range(50):
            assert list(decoder.receive(rng.randbytes(size), 0)) == []
    assert decoder.health.good == 0
    assert decoder.health.bad_bytes > 0


@devices
def test_an_unknown_option_is_refused(device: Device) -> None:
    for make in filter(None, (device.decoder, device.session)):
        with pytest.raises(TypeError, match="colour"):
            make(colour="red")


@devices
def test_a_session_starts_reads_noise_and_stops(device: Device) -> None:
    if device.session is None:
        return
    session = device.session()
    assert session.state == "closed"
    assert session.next_deadline() is None
    session.start(0)
    for now_ns in range(0, 20_000_000_000, 100_000_000):
        due = session.next_deadline()
        assert due is not None
        if due <= now_ns:
            session.on_time(now_ns)
        assert session.receive(bytes(range(256)), now_ns) == []
    session.stop()
    assert session.next_deadline() is None


def test_asking_for_a_device_loads_that_one_alone() -> None:
    code = (
        "import sys; from slipd.devices import DEVICES; DEVICES['xela'];"
        "print([m for m in ('slipd.devices.bota', 'slipd.devices.xela') if m in sys.modules])"
    )
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "['slipd.devices.xela']"
