from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from slipd.tools.discovery.port_probe import NUMBER, SAME_SOCKET, SerialPort, list_ports


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
