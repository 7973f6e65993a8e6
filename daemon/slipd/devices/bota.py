"""Bota Systems Rokubi, SensONE and MiniONE force/torque sensors on a serial line (binary format).

The sensor boots with a text banner, is configured by short text commands, and then pushes 37-byte frames.
Acknowledgements and banner travel in the same stream as the frames. Source: Bota serial example and driver.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

import numpy as np

from slipd.devices import crc
from slipd.devices.framing import FixedFrames
from slipd.devices.health import DecoderHealth
from slipd.samples import Array, WrenchSample

FRAME_LENGTH = 37

_HEADER = b"\xaa"
_FRAME = struct.Struct("<BH6fIf")  # header, status, force, torque, device time µs, temperature; CRC
_US_SPAN = 1 << 32
_RESERVED_STATUS = 0xFFF0
_STATUS_NAMES = ("skipped", "overload", "invalid", "raw")
_STATUS = tuple(tuple(name for bit, name in enumerate(_STATUS_NAMES) if status >> bit & 1) for status in range(1 << 4))
_TEXT = bytes(range(0x20, 0x7F)) + b"\r\n\t"


class Decoder:
    """Makes wrench samples of the binary frames; text between the frames is passed over.

    ``device_time_ns`` is the sensor's microsecond counter as sent: it wraps every 2^32 µs (71.6 min), and
    unwrapping it is not done here. The frames carry no number, so `health.lost` stays 0: gaps show in the
    device's time.

    Status names: "skipped" (the sensor drops samples: its sinc length is too short), "overload" (out of
    range), "invalid" (the sensor says so, or a value is not finite), "raw" (gauge values: the sensor's
    calibration is off).
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._frames = FixedFrames(_HEADER, FRAME_LENGTH, _checksum_holds, self.health, text=_TEXT)

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete, in the sensor's frame."""
        buffer, found = self._frames.receive(data)
        samples: list[WrenchSample] = []
        for at, in_step in found:
            _, status, fx, fy, fz, mx, my, mz, time_us, _ = _FRAME.unpack_from(buffer, at)
            if status & _RESERVED_STATUS and not in_step:
                # A 16-bit checksum passes one header byte in 65,536 of a noise. Out of step a frame needs the
                # reserved bits as well; a device that sets them is believed from its second frame on.
                self.health.bad += 1
                continue
            names = _STATUS[status & 0xF]
            if not math.isfinite(fx + fy + fz + mx + my + mz) and "invalid" not in names:
                names = (*names, "invalid")
            values = np.array((fx, fy, fz, mx, my, mz))
            samples.append(WrenchSample(t_ns, time_us * 1000, values[:3], values[3:], names))
        self.health.good += len(samples)
        return samples


def _checksum_holds(buffer: bytes, at: int) -> bool:
    return crc.x25_holds(buffer[at + 1 : at + FRAME_LENGTH])


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
        device_time_us: The sensor's clock, µs; sent modulo 2^32.
        temperature_c: Temperature, °C.
        status: The 16 status bits.
    """
    body = _FRAME.pack(_HEADER[0], status, *force_n, *torque_nm, device_time_us % _US_SPAN, temperature_c)
    return body + crc.x25(body[1:]).to_bytes(2, "little")
