"""Robotiq TSF-85 tactile fingertips: two fingers of 7 × 4 taxels on one USB port, streamed in tagged packets.

A packet carries what is new of each finger: of 1,000 packets a second, some sixty carry the array.
The checksum's polynomial is not published and the maker's own code neither fills nor checks it, so all that tells a
packet from noise is its structure. Source: Robotiq tactile sensor SDK and quick-start protocol.
"""

from __future__ import annotations

import numpy as np

from slipd.devices import Device
from slipd.devices.conversation import Conversation, Step, TalkingSession
from slipd.devices.framing import Frames
from slipd.devices.health import DecoderHealth
from slipd.samples import Array, TactileSample

FINGERS = 2
TAXELS = 28
LONGEST_PERIOD_MS = 255
"""The period is sent in one byte."""
IMAGES_HZ = 60.0
"""Packets come faster, but so often one brings an image."""

STATIC, DYNAMIC, ACCELEROMETER, GYROSCOPE, MAGNETOMETER, TEMPERATURE, TIMESTAMP = range(0x10, 0x80, 0x10)
"""Types of a tag."""
AUTOSEND, AUTOSEND_ASYNC, READ, VERSION = 0x58, 0x59, 0x61, 0xE3
"""Commands; E2, which enters the bootloader, is not among them and is never sent."""

_SYNC = b"\x9a"
_HEAD_LENGTH = 4  # sync, checksum, command, length of the data
_TYPICAL_LENGTH = 48  # both fingers without their arrays
_SENSORS = frozenset((AUTOSEND, AUTOSEND_ASYNC, READ))
_SIZES = {STATIC: 2 * TAXELS, DYNAMIC: 2, ACCELEROMETER: 6, GYROSCOPE: 6, MAGNETOMETER: 6, TEMPERATURE: 2, TIMESTAMP: 8}
_BYTES_BEHIND = {kind | finger << 2: size for kind, size in _SIZES.items() for finger in range(FINGERS)}
_TEXT = frozenset(range(0x20, 0x7F)) | frozenset(b"\0\r\n")
_STOP_PAUSE_NS = 20_000_000  # what is still on its way when the sensor was told to stop


class Decoder:
    """Makes a tactile sample of every static block; ``source`` is the finger, "0" or "1".

    ``values`` has shape (28,), raw counts, row by row: 7 rows of 4 columns. The dynamic taxel, the inertial sensors and
    the temperature are passed over; packets without a static block give no sample. `health.good` counts samples. The
    packets carry no number, so `health.lost` stays 0.

    Behind bytes that belong to no packet, a packet is in doubt: it is handed on with the packet that follows it
    without a gap, and dropped and counted bad where none does. So noise is believed only if it makes two packets in a
    row. A deleted byte may swallow the begin of the next packet unseen: it costs that one, and no other.

    Args:
        timestamp_unit_ns: What one count of the sensor's timestamp is worth, ns, which its maker does not say. None
            leaves ``device_time_ns`` None.

    Raises:
        ValueError: The unit is not a positive integer.

    Attributes:
        firmware: What the last bytes answered to the question for the version; "" where they did not.
    """

    def __init__(self, timestamp_unit_ns: int | None = None) -> None:
        if timestamp_unit_ns is not None and not (isinstance(timestamp_unit_ns, int) and timestamp_unit_ns > 0):
            raise ValueError(f"timestamp_unit_ns {timestamp_unit_ns!r} is no unit: a positive number of ns is")
        self.health = DecoderHealth()
        self.firmware = ""
        self._unit_ns = timestamp_unit_ns
        self._doubted: tuple[bytes, int] | None = None
        self._frames = Frames(_SYNC, _measure, _TYPICAL_LENGTH, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Take bytes received at ``t_ns`` and return the images they complete."""
        buffer, found = self._frames.receive(data)
        samples: list[TactileSample] = []
        self.firmware = ""
        for at, in_step in found:
            packet = buffer[at : at + _HEAD_LENGTH + buffer[at + 3]]
            if in_step:
                if self._doubted is not None:
                    samples += self._take(*self._doubted)
                samples += self._take(packet, t_ns)
                self._doubted = None
            else:
                self.health.bad += self._doubted is not None
                self._doubted = packet, t_ns
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._frames.forget()
        self.health.bad += self._doubted is not None
        self._doubted = None

    def _take(self, packet: bytes, t_ns: int) -> list[TactileSample]:
        content = packet[_HEAD_LENGTH:]
        if packet[2] != VERSION:
            return self._images(content, t_ns)
        self.firmware = content.decode("ascii").strip("\0\r\n ")
        return []

    def _images(self, content: bytes, t_ns: int) -> list[TactileSample]:
        """Return the images in the data of a valid packet."""
        blocks: dict[int, bytes] = {}
        at = 0
        while at < len(content):
            size = _BYTES_BEHIND[content[at]]
            blocks[content[at]] = content[at + 1 : at + 1 + size]
            at += 1 + size
        samples: list[TactileSample] = []
        for finger in range(FINGERS):
            static = blocks.get(STATIC | finger << 2)
            if static is None:
                continue
            time_ns = self._time_ns(blocks.get(TIMESTAMP | finger << 2))
            values = np.frombuffer(static, ">u2").astype(np.float64)
            samples.append(TactileSample(t_ns, time_ns, values, source=str(finger)))
        return samples

    def _time_ns(self, stamp: bytes | None) -> int | None:
        if stamp is None or self._unit_ns is None:
            return None
        return int.from_bytes(stamp, "big") * self._unit_ns


def _measure(buffer: bytes, at: int) -> int:
    """As `Frames` asks for; a packet is refused as soon as one byte of it cannot be right."""
    here = buffer[at : at + _HEAD_LENGTH]
    if len(here) > 2 and here[2] not in _SENSORS and here[2] != VERSION:
        return -1
    if len(here) < _HEAD_LENGTH:
        return 0
    begin = at + _HEAD_LENGTH
    end = begin + here[3]
    if end == begin:
        return -1
    well = _is_text(buffer[begin:end]) if here[2] == VERSION else _tags_fit(buffer, begin, end)
    if not well:
        return -1
    return end - at if end <= len(buffer) else 0


def _is_text(content: bytes) -> bool:
    return _TEXT.issuperset(content)


def _tags_fit(buffer: bytes, begin: int, end: int) -> bool:
    """Say whether known tags, none of them twice, fill the data exactly, as far as it has come."""
    seen: set[int] = set()
    at, come = begin, min(end, len(buffer))
    while at < come:
        tag = buffer[at]
        if tag not in _BYTES_BEHIND or tag in seen:
            return False
        seen.add(tag)
        at += 1 + _BYTES_BEHIND[tag]
    return at <= end


def encode_packet(command: int, data: bytes = b"") -> bytes:
    """Return a packet of either direction, with the checksum left 0 as the maker's code leaves it."""
    return bytes((*_SYNC, 0, command, len(data))) + data


def encode_block(kind: int, finger: int, values: Array | list[int]) -> bytes:
    """Return one tagged block of a sensor packet.

    Args:
        kind: Its type: `STATIC`, `DYNAMIC`, `ACCELEROMETER`, `GYROSCOPE`, `MAGNETOMETER`, `TEMPERATURE`, `TIMESTAMP`.
        finger: 0 or 1.
        values: 28, 1 or 3 integers of 16 bits, unsigned for `STATIC`; one of 64 bits for `TIMESTAMP`.
    """
    word = {STATIC: ">u2", TIMESTAMP: ">u8"}.get(kind, ">i2")
    return bytes((kind | finger << 2,)) + np.asarray(values).astype(word).tobytes()


class Session(TalkingSession[TactileSample]):
    """Stops the sensor, asks for its firmware, and lets it send packets at a period.

    `state` is "closed", "waiting", "configuring", "running" or "no answer to start"; a sensor that does not answer
    to the question for its firmware is started all the same. `identity` is the firmware's text, "" while unknown.

    Args:
        period_ms: Time from one packet to the next, 1 to 255 ms. The array itself is refreshed sixty times a second;
            a packet a millisecond hands it on soonest.
        timestamp_unit_ns: As of `Decoder`.

    Raises:
        ValueError: An option is out of range.
    """

    decoder: Decoder

    def __init__(self, period_ms: int = 1, timestamp_unit_ns: int | None = None) -> None:
        if not (isinstance(period_ms, int) and 1 <= period_ms <= LONGEST_PERIOD_MS):
            raise ValueError(f"period_ms {period_ms!r} is no period: an integer from 1 to {LONGEST_PERIOD_MS} is")
        stop = encode_packet(AUTOSEND, b"\0")
        steps = [
            Step("stop", stop, "none", _STOP_PAUSE_NS),
            Step("version", encode_packet(VERSION), "optional"),
            Step("start", encode_packet(AUTOSEND, bytes((period_ms,))), "none"),
        ]
        super().__init__(Decoder(timestamp_unit_ns), Conversation(steps), stop)

    def _hear(self, now_ns: int) -> None:
        if self.decoder.firmware:
            self.identity = self.decoder.firmware
            self._talk.answered(now_ns)


DEVICE = Device(
    "tsf85",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_PERIOD_MS, IMAGES_HZ),
    baud=115_200,
    axes=1,
    taxels=TAXELS,
    shared=True,
    sensors=tuple(map(str, range(FINGERS))),
    frame="a TSF-85 packet",
)
