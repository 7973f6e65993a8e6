from __future__ import annotations

from pathlib import Path

from slipd.discovery.serial_ports import NUMBER, SAME_SOCKET, SerialPort, list_ports


def test_every_port_is_listed_once_by_its_most_stable_name(tmp_path: Path) -> None:
    dev, by_id, by_path = tmp_path / "dev", tmp_path / "id", tmp_path / "path"
    for folder in (dev, by_id, by_path):
        folder.mkdir()
    for name in ("ttyUSB0", "ttyUSB1", "ttyACM0", "tty1"):
        (dev / name).touch()
    (by_id / "usb-Bota").symlink_to(dev / "ttyUSB0")
    (by_id / "usb-gone").symlink_to(dev / "ttyUSB9")
    (by_path / "pci-0").symlink_to(dev / "ttyUSB0")
    (by_path / "pci-1").symlink_to(dev / "ttyACM0")
    assert list_ports(by_id, by_path, dev) == [
        SerialPort(by_id / "usb-Bota"),
        SerialPort(by_path / "pci-1", SAME_SOCKET),
        SerialPort(dev / "ttyUSB1", NUMBER),
    ]


def test_without_the_folders_there_is_no_port(tmp_path: Path) -> None:
    assert list_ports(tmp_path / "a", tmp_path / "b", tmp_path / "c") == []
