"""A capture: what a device sent and was sent, with times, as a text file that can be sent and replayed as a test.

The first line is a map: format, versions, device, line and options. Each further line is a list: ns since the line was
opened, "in" (from the device) or "out", and the bytes in hexadecimal. The file names no port, host or user; the bytes
are as they came, and may contain the serial number of the device.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from slipd import __version__
from slipd.errors import SlipdError

FORMAT = 1
SUFFIX = ".capture"
Direction = Literal["in", "out"]


class Piece(NamedTuple):
    """Bytes of one read or write.

    Attributes:
        t_ns: Time since the line was opened.
        direction: "in" from the device, "out" to it.
        data: The bytes.
    """

    t_ns: int
    direction: Direction
    data: bytes


@dataclass(frozen=True, slots=True)
class Capture:
    """What went over a line.

    Attributes:
        device: Name of the device that was expected.
        package: Package that provides it, with its version.
        transport: Kind of the line.
        baud: Speed of a serial line, bit/s; 0 for others.
        options: Options of its decoder or session.
        seconds: Time for which the line was read.
        pieces: The bytes, in the order of their times.
        slipd: Version of slipd that wrote it.
    """

    device: str
    package: str
    transport: str
    baud: int
    options: Mapping[str, Any]
    seconds: float
    pieces: list[Piece] = field(default_factory=list)
    slipd: str = __version__

    def text(self) -> str:
        """Return the file."""
        head = {"capture": FORMAT} | {name: getattr(self, name) for name in _HEAD}
        lines: Iterable[object] = (head, *((t_ns, way, data.hex()) for t_ns, way, data in self.pieces))
        return "".join(json.dumps(line) + "\n" for line in lines)


_HEAD = ("slipd", "device", "package", "transport", "baud", "options", "seconds")


def read_capture(path: Path) -> Capture:
    """Read a capture.

    Raises:
        SlipdError: The file cannot be read, or is not a capture.
    """
    try:
        first, *lines = path.read_text(encoding="utf-8").splitlines()
        head = json.loads(first)
        if head["capture"] != FORMAT:
            raise SlipdError(f"{path}: must be a capture of format {FORMAT}, got {head['capture']}")
        pieces = [Piece(int(t_ns), way, bytes.fromhex(data)) for t_ns, way, data in map(json.loads, lines)]
        return Capture(**{name: head[name] for name in _HEAD}, pieces=pieces)
    except OSError as error:
        raise SlipdError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise SlipdError(f"{path}: is not a capture of slipd doctor ({type(error).__name__}: {error})") from error
