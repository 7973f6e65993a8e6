"""Tactile sensors of two pads as seen from their line: Contactile's PapillArray, Robotiq's TSF-85, XELA's server.

Not emulated: zeroing and slip detection of the PapillArray; the asynchronous stream, single readings, and signals of
the inertial sensors of the TSF-85.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from slipd.devices import papillarray, tsf85, xela
from slipd.devices.papillarray import RATES_HZ
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import FrameScanner
from slipd.tools.sim.emulators import EmulatedTactile, ReadingStream, device_us
from slipd.types.arrays import Array

POWER_ON_HZ = 1000.0
NOISE_N = 0.005
STIFFNESS_N_PER_MM = np.array([4.0, 4.0, 6.0])
RESTING_N = (0.0, 0.0, 0.1)
"""Load on each pillar of a PapillArray until another is set."""

CLOCK_PPM = 20.0
"""Rate error of the clock of a PapillArray, parts per million."""

_COMMAND = re.compile(rb"f(\d{1,4})\n")
_LONGEST_COMMAND = 6


Item: TypeAlias = "bytes | Sequence[Item]"
"""Content of a block or of an array, for the encoders: an entry, or an array of items."""


def encode_blocks(blocks: Sequence[tuple[int, Item]], width: int = 2) -> bytes:
    """Return a frame of blocks.

    Args:
        blocks: Type and content of each; a list is an array.
        width: Bytes of an offset.
    """
    at = 1 + len(blocks) * (2 + width) + len(papillarray.INDEX_END)
    index, contents = bytes((width,)), b""
    for kind, content in blocks:
        index += kind.to_bytes(2, "little") + (at + len(contents)).to_bytes(width, "little")
        contents += _encode_item(content, at + len(contents), width)
    body = index + papillarray.INDEX_END + contents
    return papillarray.START + body + (sum(body) & 0xFFFF).to_bytes(papillarray.SUM_LENGTH, "little") + papillarray.END


def _encode_item(item: Item, at: int, width: int) -> bytes:
    """Return an item that begins at ``at``."""
    if isinstance(item, bytes):
        return item
    table, contents = len(item).to_bytes(2, "little"), b""
    at += len(table) + len(item) * width
    for each in item:
        table += (at + len(contents)).to_bytes(width, "little")
        contents += _encode_item(each, at + len(contents), width)
    return table + contents


def encode_hub(counter: int, time_us: int) -> tuple[int, Item]:
    """Return the block with sequence number and device time; the counter is sent modulo 2^32."""
    return papillarray.HUB, papillarray.HUB_FIELDS.pack(counter % (1 << 32), time_us)


def encode_vectors(first: Array | Sequence[float], second: Array | Sequence[float]) -> bytes:
    """Return an entry of two vectors, each of shape (3,): force (N) and displacement (mm) or torque (N mm)."""
    return papillarray.VECTORS_FIELDS.pack(papillarray.VECTORS_TYPE, *first, *second)


def encode_pillars(forces_n: Sequence[Array], displacements_mm: Sequence[Array]) -> tuple[int, Item]:
    """Return the block of the pillars: for each sensor force and displacement, each of shape (pillars, 3)."""
    pads = zip(forces_n, displacements_mm, strict=True)
    return papillarray.PILLAR_FORCES, [[encode_vectors(*pillar) for pillar in zip(*pad, strict=True)] for pad in pads]


def encode_totals(totals_n: Sequence[Array]) -> tuple[int, Item]:
    """Return the block of the total force of each sensor, N, shape (3,); its torques are zero."""
    return papillarray.TOTALS, [encode_vectors(total_n, (0, 0, 0)) for total_n in totals_n]


def encode_slip(pillars: Sequence[int]) -> list[tuple[int, Item]]:
    """Return the two blocks of a slip detection that is switched off, for sensors with these numbers of pillars."""
    idle = papillarray.PILLAR_SLIP_FIELDS.pack(papillarray.SLIP_TYPE, 0, 0.0)
    off = papillarray.SENSOR_SLIP_FIELDS.pack(papillarray.SLIP_TYPE, 0, 0.0, -1.0)
    return [
        (papillarray.PILLAR_SLIP, [[idle] * count for count in pillars]),
        (papillarray.SENSOR_SLIP, [off] * len(pillars)),
    ]


class PapillArrays(EmulatedTactile):
    """A PTS controller with two PapillArray pads; it streams unasked.

    Args:
        seed: Seed of the noise.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(ReadingStream(seed, POWER_ON_HZ, (papillarray.PILLARS, 3), NOISE_N), 500.0)
        self._stream.press(np.tile(RESTING_N, (papillarray.PILLARS, 1)))
        self._stream.start(0)
        self._counter = 0

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; there is no answer."""
        self._received += data
        for command in _COMMAND.finditer(self._received):
            if int(command[1]) in RATES_HZ:
                self._stream.start(t_ns, int(command[1]))
        self._received = self._received[self._received.rfind(b"\n") + 1 :][-_LONGEST_COMMAND:]
        return []

    def _frame(self, taken_ns: int) -> bytes:
        pads = [self._stream.reading(str(sensor)) for sensor in range(papillarray.SENSORS)]
        blocks = [
            encode_hub(self._counter, device_us(taken_ns, CLOCK_PPM)),
            encode_pillars(pads, [pad / STIFFNESS_N_PER_MM for pad in pads]),
            encode_totals([pad.sum(axis=0) for pad in pads]),
            *encode_slip([papillarray.PILLARS] * papillarray.SENSORS),
        ]
        self._counter += 1
        return encode_blocks(blocks)


FIRMWARE = b"1.1.8"
REFRESH_HZ = 60.0
FINGERTIP_NOISE, FINGERTIP_REST = 2.0, 30
"""Noise of a taxel, and its reading without load, counts."""

FULL_SCALE = (1 << 16) - 1
"""Largest count of a fingertip and of an axis of a uSkin taxel."""

_HEAD_LENGTH = 4
_LENGTH_AT = 3


def _measure(buffer: bytes, at: int) -> int:
    """Return the length of the request to the fingertips at ``at``, 0 if it is incomplete."""
    length = _HEAD_LENGTH + buffer[at + _LENGTH_AT]
    return length if at + length <= len(buffer) else 0


def encode_block(kind: int, finger: int, values: Array | list[int]) -> bytes:
    """Return one tagged block of a sensor packet.

    Args:
        kind: Type: a type of `tsf85`, such as `tsf85.STATIC`.
        finger: 0 or 1.
        values: 28, 1 or 3 integers of 16 bits, unsigned for a static block; one of 64 bits for a time.
    """
    word = {tsf85.STATIC: ">u2", tsf85.TIMESTAMP: ">u8"}.get(kind, ">i2")
    return bytes((kind | finger << 2,)) + np.asarray(values).astype(word).tobytes()


class Fingertips(EmulatedTactile):
    """TSF-85 fingertips: packets at a period, with arrays that change 60 times per second.

    Args:
        seed: Seed of the noise.
        timestamp_unit_ns: Unit of its timestamp.
    """

    def __init__(self, seed: int, timestamp_unit_ns: int = 1000) -> None:
        stream = ReadingStream(seed, 1000.0, (tsf85.TAXELS,), FINGERTIP_NOISE)
        super().__init__(stream, REFRESH_HZ, timestamp_unit_ns=timestamp_unit_ns)
        self._requests = FrameScanner(b"\x9a", _measure, _HEAD_LENGTH, DecoderHealth(), least=_HEAD_LENGTH)
        self._unit_ns = timestamp_unit_ns
        self._refresh = -1
        self._arrays = b""

    def _obey(self, buffer: bytes, at: int, t_ns: int) -> list[bytes]:
        command, content = buffer[at + 2], buffer[at + _HEAD_LENGTH :][: buffer[at + _LENGTH_AT]]
        if command == tsf85.VERSION:
            return [tsf85.encode_packet(tsf85.VERSION, FIRMWARE)]
        if command == tsf85.AUTOSEND and content and content[0]:
            self._stream.start(t_ns, 1000.0 / content[0])
            self._refresh = -1
        elif command == tsf85.AUTOSEND:
            self._stream.stop()
        return []

    def _frame(self, taken_ns: int) -> bytes:
        refresh = int(taken_ns * REFRESH_HZ // 1e9)
        fresh, self._refresh = refresh != self._refresh, refresh
        if fresh:
            images = (self._stream.reading(str(finger)) + FINGERTIP_REST for finger in range(tsf85.FINGERS))
            counts = [np.clip(np.rint(image), 0, FULL_SCALE) for image in images]
            self._arrays = b"".join(encode_block(tsf85.STATIC, finger, each) for finger, each in enumerate(counts))
        blocks = self._arrays
        for finger in range(tsf85.FINGERS):
            blocks += encode_block(tsf85.DYNAMIC, finger, [0])
            blocks += encode_block(tsf85.ACCELEROMETER, finger, [0, 0, 16384])
            blocks += encode_block(tsf85.TIMESTAMP, finger, [taken_ns // self._unit_ns])
        return tsf85.encode_packet(tsf85.AUTOSEND, blocks)


USKINS = ("1", "2")
TAXELS = 16
USKIN_HZ = 100.0
USKIN_NOISE = 3.0
REST_COUNTS = 1 << 15
"""Reading of an axis of a uSkin taxel without load."""

N_PER_COUNT = 1e-3
BEGAN_S = 1_700_000_000.0
"""Unix time of the server at its start, s."""


def encode_message(
    number: int, sensors: Mapping[str, ArrayLike], time_s: float, calibrated: Mapping[str, ArrayLike] | None = None
) -> bytes:
    """Return one message as the server sends it.

    Args:
        number: The server's sequence number.
        sensors: Raw readings per sensor key ("1", "2", …), integers of 16 bits, shape (taxels, 3).
        time_s: Unix time, s.
        calibrated: Calibrated forces per sensor key, same shape; optional.
    """
    message: dict[str, Any] = {"message": number, "type": "routine"}
    for key, values in sensors.items():
        raw = np.asarray(values, dtype=np.uint16).reshape(-1, xela.AXES)
        message[key] = {
            "sensor": key,
            "model": "uSPa44",
            "taxels": len(raw),
            "time": time_s,
            "data": ",".join(f"{word:04X}" for word in raw.ravel().tolist()),
        }
        if calibrated and key in calibrated:
            forces = np.asarray(calibrated[key], dtype=np.float64)
            message[key]["calibrated"] = forces.ravel().tolist()
    return json.dumps(message, separators=(",", ":")).encode()


class XelaServer(EmulatedTactile):
    """The vendor's server of two XELA uSkin pads on its WebSocket: a welcome, then messages with both images.

    Args:
        seed: Seed of the noise.
        taxels: Number of taxels of each pad.
    """

    def __init__(self, seed: int, taxels: int = TAXELS) -> None:
        super().__init__(ReadingStream(seed, USKIN_HZ, (taxels, 3), USKIN_NOISE), USKIN_HZ)
        self._stream.start(0)
        self._number = 0
        self._welcome: list[bytes] = []

    def opened(self, t_ns: int) -> None:
        """Send a welcome to the new client."""
        self._welcome = [json.dumps({"message": "Welcome"}).encode()]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the messages due by then."""
        output, self._welcome = self._welcome, []
        return output + super().advance(t_ns)

    def _frame(self, taken_ns: int) -> bytes:
        self._number += 1
        pads = {key: self._stream.reading(key) for key in USKINS}
        raw = {key: np.clip(np.rint(pad + REST_COUNTS), 0, FULL_SCALE) for key, pad in pads.items()}
        forces = {key: np.round(N_PER_COUNT * pad, 4) for key, pad in pads.items()}
        return encode_message(self._number, raw, BEGAN_S + taken_ns * 1e-9, forces)
