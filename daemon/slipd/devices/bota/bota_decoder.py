"""Binary frames of Bota sensors: byte layout, decoder and encoder.

A frame has 37 bytes, little-endian: ``AA``, status (u16), force x y z in N and torque x y z in N·m (6 × f32), device
time in µs (u32), temperature in °C (f32), CRC-16/X-25 of everything after ``AA``.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from slipd.devices.shared import crc
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.frame_scanner import FixedLengthScanner
from slipd.types.arrays import Array
from slipd.types.samples import WrenchSample

FRAME_LENGTH = 37

US_SPAN = 1 << 32
"""The device time wraps after this many µs."""

_HEADER = b"\xaa"
_FRAME = struct.Struct("<BH6fIf")  # header, status, force, torque, device time, temperature; the CRC follows
_RESERVED_STATUS = 0xFFF0
_STATUS_NAMES = ("skipped", "overload", "invalid", "raw")
_STATUS = tuple(tuple(name for bit, name in enumerate(_STATUS_NAMES) if status >> bit & 1) for status in range(1 << 4))
_TEXT = bytes(range(0x20, 0x7F)) + b"\r\n\t"


class Decoder:
    """Decode binary frames to wrench samples; skip text between the frames.

    ``device_time_ns`` is the sensor's microsecond counter as sent: it wraps every 2^32 µs (71.6 min) and is not
    unwrapped here. The frames have no sequence number, so `health.lost` stays 0: gaps show in the device time.

    Status names: "skipped" (the sensor drops samples because its sinc length is too short), "overload" (out of range),
    "invalid" (the sensor reports it, or a value is not finite), "raw" (gauge values: the sensor's calibration is off).

    Attributes:
        text_passed: Whether the bytes received last may have contained text.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.text_passed = False
        self._frames = FixedLengthScanner(_HEADER, FRAME_LENGTH, _checksum_matches, self.health, text=_TEXT)

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete, in the sensor's frame."""
        buffer, found = self._frames.receive(data)
        self.text_passed = len(found) * FRAME_LENGTH != len(buffer)
        samples: list[WrenchSample] = []
        for at, in_sync in found:
            _, status, *values, time_us, _ = _FRAME.unpack_from(buffer, at)
            if status & _RESERVED_STATUS and not in_sync:
                # In noise, a 16-bit checksum matches after one header byte in 65,536. Out of sync, the reserved status
                # bits must be zero as well; frames of a device that sets them are accepted from the second one on.
                self.health.bad += 1
                continue
            names = _STATUS[status & 0xF]
            if not math.isfinite(sum(values)) and "invalid" not in names:
                names = (*names, "invalid")
            samples.append(WrenchSample(t_ns, time_us * 1000, values[:3], values[3:], names))
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a partial frame, because the line was closed."""
        self._frames.forget()


def _checksum_matches(buffer: bytes, at: int) -> bool:
    return crc.x25_matches(buffer[at + 1 : at + FRAME_LENGTH])


def encode_frame(
    force_n: Sequence[float] | Array,
    torque_nm: Sequence[float] | Array,
    device_time_us: int,
    *,
    temperature_c: float = 25.0,
    status: int = 0,
) -> bytes:
    """Return one 37-byte frame as the sensor sends it.

    Args:
        force_n: Force, shape (3,), N.
        torque_nm: Torque, shape (3,), N·m.
        device_time_us: Device time, µs; sent modulo 2^32.
        temperature_c: Temperature, °C.
        status: The 16 status bits.
    """
    body = _FRAME.pack(_HEADER[0], status, *force_n, *torque_nm, device_time_us % US_SPAN, temperature_c)
    return body + crc.x25(body[1:]).to_bytes(2, "little")
