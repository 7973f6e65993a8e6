"""Decode Wacoh-Tech DynPick force/torque sensors: ASCII on a serial line, one poll per reading.

Source: the vendor's commands as public drivers use them; not tried on hardware.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from slipd.devices import Device
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.sensor_session import PolledSession
from slipd.types.samples import WrenchSample

ASK = b"R"
REPLY_LENGTH = 27
ZERO = 8192
SENSITIVITY = (32.765, 32.765, 32.765, 1639.0, 1639.0, 1639.0)
REPLY_TIMEOUT_NS = 50_000_000
"""A reply takes a millisecond; a poll without a reply for this long was lost."""

_REPLY = re.compile(rb"[0-9][0-9A-Fa-f]{24}\r\n")
_FULL_SCALE = (0, (1 << 14) - 1)
"""Ends of the converter's range; a force beyond the range reads as one of them."""


class Decoder(FrameDecoder):
    """Decode every reply into a wrench sample. The meaning of the counter digit is unpublished: `health.lost` stays 0.

    Args:
        sensitivity: Counts per N (3) and per N·m (3), from the data sheet of the sensor.

    Raises:
        ValueError: There are not six sensitivities, or one is not positive.
    """

    def __init__(self, sensitivity: Sequence[float] = SENSITIVITY) -> None:
        if len(sensitivity) != 6 or min(sensitivity) <= 0.0:
            raise ValueError(f"sensitivity must be six positive numbers, got {sensitivity}")
        super().__init__()
        self._sensitivity = np.array(sensitivity)
        # a reply has no first byte of its own: every place is tried
        self._frames = FrameScanner(b"", _measure, REPLY_LENGTH, self.health, least=REPLY_LENGTH)

    def _readings(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        buffer, found = self._frames.receive(data)
        return [self._sample(buffer[at : at + REPLY_LENGTH], t_ns) for at, _ in found]

    def _sample(self, reply: bytes, t_ns: int) -> WrenchSample:
        counts = [int(reply[at : at + 4], 16) for at in range(1, 25, 4)]
        status = ("overload",) if any(not _FULL_SCALE[0] < count < _FULL_SCALE[1] for count in counts) else ()
        values = ((np.array(counts) - ZERO) / self._sensitivity).tolist()
        return WrenchSample(t_ns, None, values[:3], values[3:], status)


def _measure(buffer: bytes, at: int) -> int:
    return REPLY_LENGTH if _REPLY.match(buffer, at) else NO_FRAME


class Session(PolledSession[Decoder]):
    """Poll the sensor; every reading makes the next poll due.

    Args:
        sensitivity: See `Decoder`.
    """

    def __init__(self, sensitivity: Sequence[float] = SENSITIVITY) -> None:
        super().__init__(Decoder(sensitivity), ASK, REPLY_TIMEOUT_NS)


def encode_reply(counts: Sequence[int], tick: int = 0) -> bytes:
    """Encode a reply as the sensor sends it: the counter digit and six 16-bit counts."""
    return b"%d" % (tick % 10) + b"".join(b"%04X" % count for count in counts) + b"\r\n"


ABOUT = """\
Wacoh-Tech DynPick on a serial line, 921600 8N1. Not confirmed: the meaning of the counter digit.

    [finger.left.wrench]
    device = "dynpick"
    package = "slipd-dynpick"
    port = "/dev/serial/by-id/usb-Wacoh-Tech_DynPick-if00-port0"
    rate_hz = 1000.0
    options = { sensitivity = [32.765, 32.765, 32.765, 1639.0, 1639.0, 1639.0] }  # MEASURE: on the sensor's data sheet
"""

DEVICE = Device(
    "dynpick",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1.0, 1000.0),
    baud=921_600,
    frame="a reply of a DynPick",
    evidence="document",
    emulator="slipd_dynpick.emulator",
    about=ABOUT,
    interface=1,
)
