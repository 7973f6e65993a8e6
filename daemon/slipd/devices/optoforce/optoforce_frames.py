"""Frames and records of OptoForce sensors: byte layout, what is asked of a DAQ, and the decoder.

Every frame of a DAQ's serial line begins with a header of four bytes, the last of which is the length of the body, and
ends with a 16-bit sum of all bytes before it; all numbers are big-endian. The body of a reading is counter (u16),
status (u16), and 3, 6 or 12 counts (i16). Source: OptoForce General DAQ manual.

The step of the counter depends on the DAQ: one per frame, or one per millisecond; the frames show which. Sources: the
DAQ in a capture of a three-axis sensor (alknemeyer/optoforce at 88cfbf5, ``tests/test-data.bin``) counts 1 per frame;
that of a six-axis sensor at 100 Hz (shadow-robot/optoforce#31) counts 10.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth, check_choice, check_integer
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.samples import WrenchSample

ONE_3_AXIS, ONE_6_AXIS, FOUR_3_AXIS = b"\xaa\x07\x08\x0a", b"\xaa\x07\x08\x10", b"\xaa\x07\x08\x1c"
ACK, SERIAL_NUMBER = b"\xaa\x00\x50\x01", b"\xaa\x00\x12\x08"
NOMINAL, SENSITIVITY = b"\xaa\x01\x5e\x0e", b"\xaa\x01\xc2\x0e"
"""Frames of seven u16 that a six-axis DAQ sends among its readings (shadow-robot/optoforce#31).

No document that explains them was found, so this is unconfirmed. The first fits the nominal loads of a HEX-E, Fx Fy Fz
in N and Tx Ty Tz in N mm, and the second the counts at these loads, the two parts of a sensitivity report. The seventh
of each may be Fz in the other direction.
"""
_SYNC = b"\xaa"
HEADER = 4
_TYPICAL_LENGTH = 22
"""Length of a frame of one six-axis sensor, bytes."""

GET_SERIAL_NUMBER = b"\xab\x00\x12\x08\x00\xc5"

_SUM = 2
_ANSWERS = frozenset((ACK, SERIAL_NUMBER, NOMINAL, SENSITIVITY))
_LENGTHS = {header: HEADER + header[3] + _SUM for header in (ONE_3_AXIS, ONE_6_AXIS, FOUR_3_AXIS, *_ANSWERS)}
_REPORT = struct.Struct(">7H")
CONFIGURE = b"\xaa\x00\x32\x03"
_NO_TARE = 0


def _measure(buffer: bytes, at: int) -> int:
    """Return the length of the valid frame from the DAQ at ``at``, 0 if it is incomplete, else `NO_FRAME`."""
    length = _LENGTHS.get(buffer[at : at + HEADER], NO_FRAME)
    if at + length > len(buffer):
        return 0
    return length if length > 0 and sum_matches(buffer[at : at + length]) else NO_FRAME


def encode_frame(header: bytes, body: bytes) -> bytes:
    """Return a frame of header, body and their sum."""
    frame = header + body
    return frame + (sum(frame) & 0xFFFF).to_bytes(2, "big")


def parse_report(nominal: bytes, counts: bytes) -> list[float]:
    """Return counts per N of x y z and per N·m of x y z from the bodies of `NOMINAL` and `SENSITIVITY`."""
    loads = [load * (1.0 if axis < 3 else 1e-3) for axis, load in enumerate(_REPORT.unpack(nominal)[:6])]
    return [count / load if load else 0.0 for count, load in zip(_REPORT.unpack(counts)[:6], loads, strict=True)]


def encode_configuration(period_ms: int, filter_code: int) -> bytes:
    """Return the request that sets period (0: no frames) and filter; it removes a tare and never sets one."""
    return encode_frame(CONFIGURE, bytes((period_ms, filter_code, _NO_TARE)))


def sum_matches(frame: bytes) -> bool:
    """Return whether a frame ends with its sum."""
    return sum(frame[:-_SUM]) & 0xFFFF == int.from_bytes(frame[-_SUM:], "big")


STEPS = (1, 3, 10, 33, 100)
"""Steps of the counter: one per frame, or one per millisecond at each documented period."""

_SPAN = 1 << 16
_FRAMES = 1 << 32


class FrameCounter:
    """Track the counter of one stream; two equal differences in a row show its step.

    Args:
        health: Receives ``lost``, ``duplicates`` and ``restarts``; nothing is lost until the step is known.
    """

    def __init__(self, health: DecoderHealth) -> None:
        self._sequence = SequenceTracker(_FRAMES, health, first=_FRAMES, in_order=True)
        self.forget()

    def forget(self) -> None:
        """Start again: the next number follows nothing, and the step is unknown."""
        self._sequence.forget()
        self._step = 0
        self._difference = 0  # between the two numbers received last
        self._last: int | None = None
        self._number = self._frame = 0  # number and index of the frame that was accepted last

    def accept(self, number: int) -> bool:
        """Track the number of a reading; return False if the reading is old and must be dropped."""
        if self._last is None:
            self._last = self._number = number
        difference = (number - self._last) % _SPAN
        if difference == self._difference and difference in STEPS:
            self._step = difference
        self._difference, self._last = difference, number
        frame = self._frame + self._frames_since(number)
        accepted = self._sequence.accept(frame % _FRAMES)
        if accepted:
            self._number, self._frame = number, frame
        return accepted

    def _frames_since(self, number: int) -> int:
        """Return how many frames after the one accepted last this is; negative if it is older."""
        ahead = (number - self._number + _SPAN // 2) % _SPAN - _SPAN // 2
        return round(ahead / (self._step or max(abs(ahead), 1)))


CHANNELS = 4

UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM = 10_000.0, 100_000.0

_HEAD = struct.Struct(">HH")  # counter, status; the counts follow
_COUNTS_AT = HEADER + _HEAD.size
_THREE_COUNTS, _SIX_COUNTS = struct.Struct(">3h"), struct.Struct(">6h")
_RAILS = frozenset((-(1 << 15), (1 << 15) - 1))
_UDP_TICK_NS = 1_000_000
_UDP_RESERVED = 0xFFFF_0000
_SCALE_TOLERANCE = 0.15
"""Relative difference of the sensor's own scale that is no mistake: that of tension and compression."""

_OVERLOAD = 0x03F0
_SENSOR_ERRORS = {1: ("not_detected", "invalid"), 2: ("sensor_failure", "invalid"), 4: ("temperature",)}
_DAQ_ERRORS = {1: ("daq_error", "invalid"), 2: ("daq_communication", "invalid")}


class Decoder(FrameDecoder):
    """Decode frames or records to wrench samples; ``torque_nm`` is None for a three-axis sensor.

    On the serial line the sensor's sensitivity report defines its counts; by default one count is 1 N or 1 N·m. The
    converter sends N and N·m. Its records carry the converter's millisecond counter as ``device_time_ns``; serial
    frames have no time.

    Some six-axis DAQs send what looks like the sensitivity report. The decoder does not use it, because no document
    explains it; `health.note` names its scales if the options differ.

    Status names: "overload" (on any axis, because the manuals disagree which bit is which; or a count at the end of its
    range), "invalid" with "not_detected", "sensor_failure", "sensor_error", "daq_error" or "daq_communication",
    "temperature"; "sensor_<n>" and "several_sensors" tell whose error it is; "unknown" is a reserved bit.

    Args:
        wiring: "serial", or "udp" for the Ethernet converter.
        counts_per_n: Counts per newton of each axis, x y z, from the sensor's sensitivity report: counts at nominal
            load divided by nominal load; serial only. A negative number reverses the axis. With 1, readings are counts.
        counts_per_nm: Counts per newton metre of each axis of a six-axis sensor; serial only.
        channel: The sensor of a four-channel DAQ to read, 0 to 3; other DAQs have only one.
        counted: Whether the counter of the serial frames shows losses; see `FrameCounter`.

    Raises:
        ValueError: An option is out of range or unknown.
    """

    def __init__(
        self,
        wiring: str = "serial",
        counts_per_n: Sequence[float] = (1.0, 1.0, 1.0),
        counts_per_nm: Sequence[float] = (1.0, 1.0, 1.0),
        channel: int = 0,
        counted: bool = True,
    ) -> None:
        check_choice("wiring", wiring, ("serial", "udp"))
        check_integer("channel", channel, 0, CHANNELS - 1)
        for name, scales in (("counts_per_n", counts_per_n), ("counts_per_nm", counts_per_nm)):
            if len(scales) != 3 or not all(math.isfinite(scale) and scale for scale in scales):
                raise ValueError(f"{name} must be three finite numbers, none of them zero, got {list(scales)}")
        super().__init__()
        self._counts_per_unit = np.array([*counts_per_n, *counts_per_nm], dtype=np.float64)
        self._nominal = b""  # body of the frame of this name
        self._channel_at = _COUNTS_AT + channel * _THREE_COUNTS.size
        self._sequence = FrameCounter(self.health) if counted else None
        self._records = rdt.RecordScanner(self.health, _UDP_RESERVED)
        self._frames, self._decode = self._records, self._decode_records
        if wiring == "serial":
            self._frames = FrameScanner(_SYNC, _measure, _TYPICAL_LENGTH, self.health, least=HEADER)
            self._decode = self._decode_frames

    def forget(self) -> None:
        """Drop a partial frame and the expected sequence number, because the line was closed."""
        super().forget()
        self._nominal, self.health.note = b"", ""
        if self._sequence:
            self._sequence.forget()

    def _readings(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        return self._decode(data, t_ns)

    def _decode_records(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        heads, counts = self._records.records(data)
        forces, torques = (counts[:, :3] / UDP_COUNTS_PER_N).tolist(), (counts[:, 3:] / UDP_COUNTS_PER_NM).tolist()
        return [
            WrenchSample(t_ns, ticks * _UDP_TICK_NS, force, torque, _status_names(status))
            for (ticks, status), force, torque in zip(heads, forces, torques, strict=True)
        ]

    def _decode_frames(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        buffer, found = self._frames.receive(data, t_ns)
        samples: list[WrenchSample] = []
        for at, _ in found:
            header = buffer[at : at + HEADER]
            if header in _ANSWERS:
                self._handle_answer(header, buffer[at + HEADER : at + HEADER + header[3]])
                continue
            counter, status = _HEAD.unpack_from(buffer, at + HEADER)
            if self._sequence and not self._sequence.accept(counter):
                continue
            if header == ONE_6_AXIS:
                counts = _SIX_COUNTS.unpack_from(buffer, at + _COUNTS_AT)
            else:
                counts_at = self._channel_at if header == FOUR_3_AXIS else _COUNTS_AT
                counts = _THREE_COUNTS.unpack_from(buffer, at + counts_at)
            if not _RAILS.isdisjoint(counts):
                status |= rdt.AT_RAIL
            values = (np.array(counts) / self._counts_per_unit[: len(counts)]).tolist()
            torque = values[3:] if len(values) > 3 else None
            samples.append(WrenchSample(t_ns, None, values[:3], torque, _status_names(status)))
        return samples

    def _handle_answer(self, header: bytes, body: bytes) -> None:
        if header == NOMINAL:
            self._nominal = body
        elif header != SENSITIVITY:
            self.replies.append((header, body))
        elif self._nominal:
            self._compare_scales(parse_report(self._nominal, body))

    def _compare_scales(self, sent: list[float]) -> None:
        """Name the scales that the sensor sends if those of the options differ."""
        scales = np.abs(self._counts_per_unit)
        away = np.abs(scales - sent) > _SCALE_TOLERANCE * scales
        per_n, per_nm = (", ".join(f"{scale:.4g}" for scale in part) for part in (sent[:3], sent[3:]))
        text = f"the sensor seems to have {per_n} counts/N and {per_nm} counts/N·m: compare counts_per_n, counts_per_nm"
        self.health.note = text if away.any() else ""


@lru_cache(maxsize=64)  # a condition lasts for many readings, and few exist at a time
def _status_names(status: int) -> tuple[str, ...]:
    names: list[str] = []
    if status & (_OVERLOAD | rdt.AT_RAIL):
        names.append("overload")
    if sensor_error := status >> 10 & 7:
        names += _SENSOR_ERRORS.get(sensor_error, ("sensor_error", "invalid"))
    if daq_error := status >> 13 & 7:
        names += _DAQ_ERRORS.get(daq_error, ("daq_error", "invalid"))
    if number := status & 7:
        names.append(f"sensor_{number}")
    if status & 8:
        names.append("several_sensors")
    if status & _UDP_RESERVED:
        names.append("unknown")
    return tuple(dict.fromkeys(names))
