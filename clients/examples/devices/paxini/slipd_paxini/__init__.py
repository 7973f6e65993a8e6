"""PaXini GEN3 tactile modules on USB serial: the resultant force of one module, polled.

A request is ``55 AA 09 00``, address (module + 1), ``00 FB F0 03 00 00 03 00``, and the negated sum of all bytes. The
reply begins with ``AA 55``; its payload of three bytes follows after 14: x and y signed, z unsigned, each 0.1 N.
Sources: github.com/adnan-saood/paxini_ros2, ``helper_scripts/UI_sensor.py`` (the maker's program: commands, payload,
10 ms between polls) and ``paxini_hardware/src/tactile_sensor.cpp`` (a driver on top of it).

Not shown by the sources, and not used: what is in the bytes between header and payload, and whether the reply ends with
a checksum (one byte more is accepted); so a damaged value is not detected. The distributed forces are not read, because
the places of the taxels are published for two models only, and are no grid. slipd never sends the maker's calibration.
"""

from __future__ import annotations

import struct

from slipd.devices import DecoderHealth, Device
from slipd.devices.shared.sensor_session import PolledSession
from slipd.types.samples import WrenchSample

HEADER = b"\xaa\x55"
PREFIX = 14
LENGTH = PREFIX + 3
N_PER_COUNT = 0.1
POLL_NS = 10_000_000
REPLY_TIMEOUT_NS = 250_000_000


class Decoder:
    """Decode replies into forces, N. The modules measure no torque."""

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._buffer = b""
        self._spare = 0  # bytes that may follow a reply

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Return the readings that bytes received at ``t_ns`` complete, in the frame of the module."""
        buffer, at = self._buffer + data, 0
        samples = []
        while (found := buffer.find(HEADER, at)) >= 0 and len(buffer) - found >= LENGTH:
            self._skip(found - at)
            samples.append(_sample(buffer[found + PREFIX : found + LENGTH], t_ns))
            self._spare = 1
            at = found + LENGTH
        rest = found if found >= 0 else len(buffer) - buffer.endswith(HEADER[:1])
        rest = max(rest, at)
        self._skip(rest - at)
        self._buffer = buffer[rest:]
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Discard an incomplete reply: the line was closed, or the next poll is sent."""
        self._skip(len(self._buffer))
        self._buffer = b""

    def _skip(self, count: int) -> None:
        wrong = max(count - self._spare, 0)
        self._spare -= min(count, self._spare)
        self.health.bad_bytes += wrong
        self.health.bad += wrong > 0


def _sample(payload: bytes, t_ns: int) -> WrenchSample:
    x, y, z = struct.unpack("bbB", payload)
    full = z == 255 or any(value in (-128, 127) for value in (x, y))
    return WrenchSample(t_ns, None, [N_PER_COUNT * value for value in (x, y, z)], None, ("overload",) if full else ())


class Session(PolledSession[Decoder]):
    """Poll one module in its period.

    Args:
        module: Number of the module on the board, 0 to 7.

    Raises:
        ValueError: There is no such module.
    """

    def __init__(self, module: int = 0) -> None:
        if module not in range(8):
            raise ValueError(f"module must be from 0 to 7, got {module}")
        super().__init__(Decoder(), encode_request(module), REPLY_TIMEOUT_NS, POLL_NS)


def encode_request(module: int) -> bytes:
    """Encode the request for the resultant force of a module."""
    frame = bytes((0x55, 0xAA, 0x09, 0x00, module + 1, 0x00, 0xFB, 0xF0, 0x03, 0x00, 0x00, 0x03, 0x00))
    return frame + bytes((-sum(frame) & 0xFF,))


ABOUT = """\
PaXini GEN3 tactile modules on their USB board, 921600 8N1: the resultant force of one module.

    [finger.left.wrench]
    device = "paxini"
    package = "slipd-paxini"
    port = "/dev/serial/by-id/usb-1a86_USB_Serial-if00-port0"
    rate_hz = 100.0
    range_n = 25.4             # the z force has one byte of 0.1 N
    sign = 1
    # z grows when the pad is pressed; which way x and y point is not published. MEASURE (`slipd commission`)
    pad_from_sensor = { xyz_m = [0.0, 0.0, 0.0], quat_xyzw = [1.0, 0.0, 0.0, 0.0] }
    options = { module = 0 }

What slipd can do: friction ratio, slip along the pad, and the grip needed, in steps of 0.1 N. What it cannot: the
modules report no torque, so a rotation is not observed, and the finger is never "stable". One module for each port:
slipd does not poll two.
"""

DEVICE = Device(
    "paxini",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1.0, 1e9 / POLL_NS),
    baud=921_600,
    frame="a reply of a PaXini module",
    evidence="maker",
    emulator="slipd_paxini.emulator",
    about=ABOUT,
    interface=1,
)
