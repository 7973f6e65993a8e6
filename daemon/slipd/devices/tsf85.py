"""Robotiq TSF-85 tactile fingertips: two fingers of 7 × 4 taxels on one USB port, streamed in tagged packets.

A packet is ``9A``, checksum (u8), command (u8), length of the data (u8), data. The data of a sensor packet are blocks:
a tag (u8, type | finger << 2) and big-endian values. The arrays are refreshed sixty times per second, but may come in
each of 1,000 packets per second. The checksum's polynomial is not published, and the manufacturer's own code neither
fills nor checks it, so only its structure distinguishes a packet from noise.

Source: the maker's public repository robotiq/tactile_sensors at 8cb0219: ``sensor_quickstart/protocol.py`` (layout),
``README.md`` lines 5 and 6 (1 kHz, arrays at 60 Hz), ``sensor_quickstart/README.md`` line 74 (160 kB/s at 1 kHz: more
than packets without arrays have).
"""

from __future__ import annotations

import numpy as np

from slipd.devices import Device
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.sensor_session import SensorSession, Step
from slipd.types.samples import TactileSample

FINGERS = 2
TAXELS = 28
LONGEST_PERIOD_MS = 255
"""The period is sent in one byte."""
REPEAT_NS = 20_000_000
"""An equal array within this time, a little more than the period of 60 Hz, is the same image once more."""

STATIC, DYNAMIC, ACCELEROMETER, GYROSCOPE, MAGNETOMETER, TEMPERATURE, TIMESTAMP = range(0x10, 0x80, 0x10)
"""Types of a tag."""
AUTOSEND, AUTOSEND_ASYNC, READ, VERSION = 0x58, 0x59, 0x61, 0xE3
"""Commands; E2, which starts the bootloader, is missing because it is never sent."""

_SYNC = b"\x9a"
_HEAD_LENGTH = 4  # sync, checksum, command, length of the data
_TYPICAL_LENGTH = 48  # both fingers without their arrays
_SENSORS = frozenset((AUTOSEND, AUTOSEND_ASYNC, READ))
_SIZES = {STATIC: 2 * TAXELS, DYNAMIC: 2, ACCELEROMETER: 6, GYROSCOPE: 6, MAGNETOMETER: 6, TEMPERATURE: 2, TIMESTAMP: 8}
_BLOCK_BYTES = {kind | finger << 2: size for kind, size in _SIZES.items() for finger in range(FINGERS)}
_TEXT = frozenset(range(0x20, 0x7F)) | frozenset(b"\0\r\n")
_STOP_PAUSE_NS = 20_000_000  # for packets that are still on the line after the stop


class Decoder(FrameDecoder):
    """Return a tactile sample of every static block; ``source`` is the finger, "0" or "1".

    ``values`` has shape (28,), raw counts, row by row: 7 rows of 4 columns. The dynamic taxel, the inertial sensors and
    the temperature are ignored. Packets without a static block give no sample, and neither does a repeated array, which
    is the image of the same refresh. `health.good` counts samples. The packets have no sequence number, so
    `health.lost` stays 0.

    After bytes that belong to no packet, a packet is unconfirmed: it is decoded when another packet follows it without
    a gap, and dropped and counted as bad if none does. So noise is accepted only if it forms two packets in a row. A
    deleted byte may hide the beginning of the next packet; that costs one packet.

    Args:
        timestamp_unit_ns: Unit of the sensor's timestamp, ns, which the manufacturer does not specify. None: the
            timestamp is not used.

    Raises:
        ValueError: The unit is not a positive integer.
    """

    def __init__(self, timestamp_unit_ns: int | None = None) -> None:
        if timestamp_unit_ns is not None and not (isinstance(timestamp_unit_ns, int) and timestamp_unit_ns > 0):
            raise ValueError(f"timestamp_unit_ns must be a positive integer, got {timestamp_unit_ns!r}")
        super().__init__()
        self._unit_ns = timestamp_unit_ns
        self._unconfirmed: tuple[bytes, int] | None = None
        self._newest: dict[int, tuple[bytes, int]] = {}  # by finger: array of the last sample, and its time of receipt
        self._frames = FrameScanner(_SYNC, _measure, _TYPICAL_LENGTH, self.health, least=_HEAD_LENGTH)

    def _readings(self, data: bytes, t_ns: int) -> list[TactileSample]:
        buffer, found = self._frames.receive(data)
        samples: list[TactileSample] = []
        for at, in_sync in found:
            packet = buffer[at : at + _HEAD_LENGTH + buffer[at + 3]]
            if in_sync:
                if self._unconfirmed is not None:
                    samples += self._decode(*self._unconfirmed)
                samples += self._decode(packet, t_ns)
                self._unconfirmed = None
            else:
                self.health.bad += self._unconfirmed is not None
                self._unconfirmed = packet, t_ns
        return samples

    def forget(self) -> None:
        """Drop a partial and an unconfirmed packet, because the line was closed."""
        super().forget()
        self.health.bad += self._unconfirmed is not None
        self._unconfirmed = None
        self._newest.clear()

    def _decode(self, packet: bytes, t_ns: int) -> list[TactileSample]:
        content = packet[_HEAD_LENGTH:]
        if packet[2] != VERSION:
            return self._samples(content, t_ns)
        self.replies.append((VERSION, content))
        return []

    def _samples(self, content: bytes, t_ns: int) -> list[TactileSample]:
        """Return the images in the data of a valid packet."""
        blocks = _blocks(content, len(content)) or {}
        samples: list[TactileSample] = []
        for finger in range(FINGERS):
            static = blocks.get(STATIC | finger << 2)
            before, before_ns = self._newest.get(finger, (b"", 0))
            if static is None or (static == before and t_ns - before_ns < REPEAT_NS):
                continue
            self._newest[finger] = static, t_ns
            stamp, unit_ns = blocks.get(TIMESTAMP | finger << 2), self._unit_ns
            time_ns = None if stamp is None or unit_ns is None else int.from_bytes(stamp, "big") * unit_ns
            values = np.frombuffer(static, ">u2").astype(np.float64)
            samples.append(TactileSample(t_ns, time_ns, values, source=str(finger)))
        return samples


def _measure(buffer: bytes, at: int) -> int:
    """Measure a packet for `FrameScanner`; reject it as soon as a byte after its head is impossible."""
    begin = at + _HEAD_LENGTH
    head = buffer[at:begin]
    end = begin + head[3]
    if end == begin or not (head[2] in _SENSORS or head[2] == VERSION):
        return NO_FRAME
    content = buffer[begin:end]
    is_valid = _TEXT.issuperset(content) if head[2] == VERSION else _blocks(content, head[3]) is not None
    if not is_valid:
        return NO_FRAME
    return end - at if end <= len(buffer) else 0


def _blocks(received: bytes, size: int) -> dict[int, bytes] | None:
    """Return the values in the data of a sensor packet by tag, as far as received.

    None if they are not known tags, each once, that fill the data of this size exactly.
    """
    blocks: dict[int, bytes] = {}
    at = 0
    while at < len(received):
        tag = received[at]
        if tag not in _BLOCK_BYTES or tag in blocks:
            return None
        end = at + 1 + _BLOCK_BYTES[tag]
        blocks[tag] = received[at + 1 : end]
        at = end
    return blocks if at <= size else None


def encode_packet(command: int, data: bytes = b"") -> bytes:
    """Return a packet of either direction, with checksum 0 like the manufacturer's code."""
    return bytes((*_SYNC, 0, command, len(data))) + data


class Session(SensorSession[Decoder]):
    """Stop the sensor, request its firmware version, and start packets at a fixed period.

    `state` is "closed", "waiting", "configuring", "running" or "no answer to start"; a sensor that does not report its
    firmware is started nevertheless. `identity` is the firmware version, "" if unknown.

    Args:
        period_ms: Time from one packet to the next, 1 to 255 ms. The array is refreshed sixty times per second; a
            period of 1 ms delivers it with the least delay.
        timestamp_unit_ns: See `Decoder`.

    Raises:
        ValueError: An option is out of range.
    """

    def __init__(self, period_ms: int = 1, timestamp_unit_ns: int | None = None) -> None:
        check_integer("period_ms", period_ms, 1, LONGEST_PERIOD_MS)
        stop = encode_packet(AUTOSEND, b"\0")
        steps = [
            Step("stop", stop, "none", _STOP_PAUSE_NS),
            Step("version", encode_packet(VERSION), "optional", reply=VERSION, handle=self._handle_version),
            Step("start", encode_packet(AUTOSEND, bytes((period_ms,))), "none"),
        ]
        super().__init__(Decoder(timestamp_unit_ns), steps, stop)

    def _handle_version(self, content: bytes) -> None:
        self.identity = content.decode("ascii").strip("\0\r\n ")


DEVICE = Device(
    "tsf85",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_PERIOD_MS, 1000.0),
    baud=115_200,
    axes=1,
    taxels=TAXELS,
    shared=True,
    sensors=tuple(map(str, range(FINGERS))),
    frame="a TSF-85 packet",
    evidence="maker",
)
