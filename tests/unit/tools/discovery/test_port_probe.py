"""Serial ports by their most stable names, and which device answers at one."""

from __future__ import annotations

import asyncio
import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from slipd.devices import DEVICES
from slipd.tools.discovery import port_probe
from slipd.tools.discovery.port_probe import (
    NUMBER,
    SAME_SOCKET,
    SerialPort,
    identify_port,
    list_ports,
    recognise,
)
from slipd.tools.sim.emulate import emulated, run
from slipd.tools.sim.emulators import Emulator, make_emulator

ATTEMPTS = 10
SERIAL = [name for name, device in DEVICES.items() if "serial" in device.transports]


async def identify(folder: Path, devices: dict[str, Emulator], attempts: int = 1) -> dict[str, Any]:
    """Identify emulated devices, all at once; what a busy machine answers too late is asked again."""
    plan = [(name, device, str(folder / name)) for name, device in devices.items()]
    async with emulated(plan) as lines:
        running = asyncio.create_task(run(lines))
        found: dict[str, Any] = {}
        for _ in range(attempts):
            names = [name for name in devices if found.get(name) is None]
            found |= zip(
                names, await asyncio.gather(*(identify_port(str(folder / name)) for name in names)), strict=True
            )
        running.cancel()
    return found


async def test_every_serial_device_is_identified_on_a_real_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(port_probe, "LISTEN_S", 0.35)
    monkeypatch.setattr(port_probe, "ASK_S", 0.35)
    devices = {name: make_emulator(name, 1) for name in SERIAL}
    results = await identify(tmp_path, devices, ATTEMPTS)
    assert {name: found and found.device for name, found in results.items()} == {name: name for name in SERIAL}
    pvdf, tsf85, robotous = (results[name] for name in ("pvdf", "tsf85", "robotous"))
    assert (pvdf.rows, pvdf.taxels, tsf85.sensors, robotous.identity) == (8, 128, ("0", "1"), "RFT40-SA01-D")


async def test_asking_writes_no_setting_and_moves_no_gripper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(port_probe, "LISTEN_S", 0.05)
    devices = {name: make_emulator(name, 1) for name in ("robotous", "robotiq_2f")}
    received: list[bytes] = []
    gripper = devices["robotiq_2f"]
    receive = gripper.receive

    def note(data: bytes, t_ns: int) -> list[bytes]:
        received.append(data)
        return receive(data, t_ns)

    gripper.receive = note  # type: ignore[method-assign]
    assert (await identify(tmp_path, devices, ATTEMPTS))["robotiq_2f"] is not None
    assert {data[1] for data in received} <= {3, 4}, "only function codes that read registers"
    assert devices["robotous"].writes == 0  # type: ignore[attr-defined]


async def test_a_port_that_is_silent_or_missing_is_none_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(port_probe, "LISTEN_S", 0.02)
    monkeypatch.setattr(port_probe, "ASK_S", 0.02)
    silent = make_emulator("robotiq_2f")
    silent.receive = lambda data, t_ns: []  # type: ignore[method-assign]
    assert await identify(tmp_path, {"robotiq_2f": silent}) == {"robotiq_2f": None}
    with pytest.raises(OSError, match="No such file"):
        await identify_port(str(tmp_path / "missing"))
    with pytest.raises(OSError, match="null"):
        await identify_port("/dev/tty\0")


def test_noise_is_no_device() -> None:
    noise = random.Random(1)
    long = [(k * 1_000_000, noise.randbytes(200)) for k in range(12)]
    assert [recognise(heard) for heard in (long, [], [(0, b"a few bytes")])] == [None] * 3


@pytest.fixture
def terminals() -> Iterator[list[str]]:
    """Names of four pseudo-terminals."""
    pairs = [os.openpty() for _ in range(4)]
    yield [os.ttyname(slave) for _, slave in pairs]
    for pair in pairs:
        for end in pair:
            os.close(end)


def test_every_port_is_listed_once_by_its_most_stable_name(tmp_path: Path, terminals: list[str]) -> None:
    dev, by_id, by_path = tmp_path / "dev", tmp_path / "id", tmp_path / "path"
    for folder in (dev, by_id, by_path):
        folder.mkdir()
    for name, terminal in zip(("ttyUSB0", "ttyUSB1", "ttyACM0", "tty1"), terminals, strict=True):
        (dev / name).symlink_to(terminal)
    (by_id / "usb-Bota").symlink_to(dev / "ttyUSB0")
    (by_id / "usb-gone").symlink_to(dev / "ttyUSB9")
    (by_path / "pci-0").symlink_to(dev / "ttyUSB0")
    (by_path / "pci-1").symlink_to(dev / "ttyACM0")
    assert list_ports(by_id, by_path, dev) == [
        SerialPort(by_id / "usb-Bota"),
        SerialPort(by_path / "pci-1", SAME_SOCKET),
        SerialPort(dev / "ttyUSB1", NUMBER),
    ]


def test_a_file_that_is_no_port_is_left_out(tmp_path: Path, terminals: list[str]) -> None:
    """An emulated rig has its config and the socket of its hand beside the ports."""
    (tmp_path / "rig.toml").touch()
    (tmp_path / "left-wrench").symlink_to(terminals[0])
    nowhere = tmp_path / "nowhere"
    assert list_ports(tmp_path, nowhere, nowhere) == [SerialPort(tmp_path / "left-wrench")]
