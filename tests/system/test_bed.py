"""A daemon that reads every device on every kind of line, with the emulated devices at the other ends."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from emulation_thread import emulation
from rig_parts import PATIENCE_S, endpoints_of, part, wait_for

from slipd import config
from slipd.config.model import transport_of
from slipd.devices import DEVICES
from slipd.tools.sim.touched_devices import TouchedDevices
from slipd_client.errors import NoAnswer, RequestRefused
from slipd_client.grip import GripClient

pytestmark = pytest.mark.process

KEEPS_UP_S = 30.0
"""A machine on which streams are still late after so long cannot keep up with all devices."""

POLL_S = 0.25
OK, ERROR, STALE = 0, 2, 3
BUSY = ("within 10 s", "the daemon was late by", "adapter buffer them?")
"""Health messages that a busy machine causes."""

PAD = "pitch_m = 0.003\nelectrode_m = 0.0015\naxis_scale = [0.001]\n"
PAD_3D = PAD.replace("[0.001]", "[0.001, 0.001, 0.001]")
BOTA = '[finger.bota.wrench]\ndevice = "bota"\nport = "/dev/bota"\nrate_hz = 100.0\noptions = { sinc_length = 512 }\n'
SENSORS = f"""
[rates]
slip_hz = 10.0
wrench_hz = 10.0
tactile_hz = 1.0

{BOTA}
[finger.gauges.wrench]
device = "gauges"
port = "/dev/gauges"
rate_hz = 100.0

[finger.netft.wrench]
device = "netft"
port = "udp://192.168.1.21:49152"
rate_hz = 100.0
options = {{ calibration = "tcp" }}

[finger.optoforce.wrench]
device = "optoforce"
port = "/dev/optoforce"
rate_hz = 100.0
options = {{ period_ms = 10, counts_per_n = [80.0, 80.0, 20.0], counts_per_nm = [2500.0, 2500.0, 4000.0] }}

[finger.converter.wrench]
device = "optoforce"
port = "udp://192.168.1.1:49152"
rate_hz = 100.0
options = {{ period_ms = 10 }}

[finger.robotous.wrench]
device = "robotous"
port = "/dev/robotous"
rate_hz = 333.0
options = {{ torque_divider = 2000.0 }}

[finger.external.wrench]
device = "external"
port = "ipc:///run/slipd/readings.ipc"
sensor = "wrench"
rate_hz = 100.0

[finger.bota.pad]
device = "pvdf"
port = "/dev/pvdf"
rate_hz = 50.0
rows = 8
cols = 16
{PAD}
[finger.gauges.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "1"
rate_hz = 100.0
rows = 4
cols = 4
{PAD_3D}
[finger.netft.pad]
device = "dsacon32"
port = "/dev/dsacon32"
sensor = "0"
rate_hz = 30.0
rows = 2
cols = 42
{PAD}
[finger.optoforce.pad]
device = "dsacon32"
port = "tcp://192.168.1.2:2000"
sensor = "0"
rate_hz = 30.0
rows = 2
cols = 42
{PAD}
[finger.converter.pad]
device = "papillarray"
port = "/dev/papillarray"
sensor = "0"
rate_hz = 100.0
options = {{ rate_hz = 100 }}
rows = 3
cols = 3
{PAD_3D}
[finger.robotous.pad]
device = "tsf85"
port = "/dev/tsf85"
sensor = "0"
rate_hz = 60.0
options = {{ period_ms = 1 }}
rows = 7
cols = 4
{PAD}
[finger.external.pad]
device = "wts"
port = "/dev/wts"
rate_hz = 100.0
rows = 14
cols = 6
{PAD}
"""
TABLES = "force_table = [[0, 3.0], [255, 30.0]]\nwidth_table = [[0.0, 0.085], [1.0, 0.0]]\n"
GRIPPER = '[gripper]\ndevice = "{}"\nport = "{}"\nrate_hz = 50.0\n'
RIGS = {
    "all sensors": SENSORS + GRIPPER.format("external_gripper", "unix:///run/slipd/gripper"),
    "robotiq_2f": BOTA + GRIPPER.format("robotiq_2f", "/dev/gripper") + TABLES,
    "wsg": BOTA + GRIPPER.format("wsg", "tcp://192.168.1.20:1000"),
}
"""A rig has one gripper."""


def test_the_rigs_have_every_device_on_every_kind_of_line() -> None:
    streams = [stream for text in RIGS.values() for stream in config.parse(text, "rig.toml").streams().values()]
    lines = {(name, transport) for name, device in DEVICES.items() for transport in device.transports}
    assert {(stream.device, transport_of(stream.port)) for stream in streams} == lines


def is_well(stream: dict[str, Any], *, keeps_up: bool) -> bool:
    """Return whether readings come at their rate, although a busy machine interrupts them for some milliseconds.

    On a machine that cannot keep up some are late or lost, and the daemon says so.
    """
    busy = any(words in stream["message"] for words in BUSY)
    at_rate = stream["rate_hz"] == pytest.approx(stream["expected_hz"], rel=0.2)
    return (busy or stream["health"] == OK) and (
        at_rate or (busy and not keeps_up and stream["samples"] > stream["bad"])
    )


def is_missed(stream: dict[str, Any], *, keeps_up: bool) -> bool:
    return stream["health"] in (STALE, ERROR)


def remaining(client: GripClient, settled: Callable[..., bool]) -> dict[str, str]:
    """Wait until each stream has settled; return the messages of those that did not."""
    bad, begin_s = wait_for(lambda: client.status()["streams"]), time.monotonic()
    while bad and time.monotonic() < begin_s + PATIENCE_S:
        time.sleep(POLL_S)
        keeps_up = time.monotonic() < begin_s + KEEPS_UP_S
        with suppress(NoAnswer, RequestRefused):  # the machine is busy
            streams = client.status()["streams"]
            bad = {name: streams[name] for name in bad if not settled(streams[name], keeps_up=keeps_up)}
    return {name: stream["message"] for name, stream in bad.items()}


@pytest.mark.parametrize("text", RIGS.values(), ids=RIGS)
def test_L5_L6_all_devices_go_away_and_come_back(text: str, tmp_path: Path) -> None:
    devices = TouchedDevices(config.parse(text, "rig.toml"), tmp_path)
    rig = tmp_path / "rig.toml"
    rig.write_text(devices.config_text(), encoding="utf-8")
    with (
        part(tmp_path, "slipd", "run", "--config", str(rig)) as daemon,
        GripClient(endpoints_of(daemon).requests, timeout_s=PATIENCE_S) as client,
    ):
        for _ in range(2):
            again = TouchedDevices(config.parse(text, "rig.toml"), tmp_path)  # switched on
            lines = zip(again.devices, devices.addresses.values(), strict=True)
            with emulation([(name, emulator, address) for (name, emulator, _), address in lines], again.advance):
                assert remaining(client, is_well) == {}
            assert remaining(client, is_missed) == {}
