"""List the serial ports of this machine by names that stay the same."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

BY_ID, BY_PATH, DEV = Path("/dev/serial/by-id"), Path("/dev/serial/by-path"), Path("/dev")
NUMBERED = ("ttyUSB*", "ttyACM*")

SAME_SOCKET = "the name is that of the USB socket: keep the device in it, because it reports no serial number"
NUMBER = "the number belongs to whichever device is plugged in first; give it a name by a udev rule"


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port.

    Attributes:
        path: Its most stable name.
        warning: Why the name may belong to another device after a restart; "" if it will not.
    """

    path: Path
    warning: str = ""


def list_ports(by_id: Path = BY_ID, by_path: Path = BY_PATH, dev: Path = DEV) -> list[SerialPort]:
    """Return every serial port once, by id if it has one, else by path, else by its number.

    Other files of the folders, such as those beside the ports of an emulated rig, are left out.

    Args:
        by_id: Folder of links named after vendor, product and serial number.
        by_path: Folder of links named after the socket.
        dev: Folder of the numbered ports.
    """
    numbered = [path for pattern in NUMBERED for path in sorted(dev.glob(pattern))] if dev.is_dir() else []
    ports: dict[Path, SerialPort] = {}
    for folder, warning in ((by_id, ""), (by_path, SAME_SOCKET)):
        for path in sorted(folder.iterdir()) if folder.is_dir() else []:
            if path.is_char_device():
                ports.setdefault(path.resolve(), SerialPort(path, warning))
    for path in numbered:
        ports.setdefault(path.resolve(), SerialPort(path, NUMBER))
    return list(ports.values())
