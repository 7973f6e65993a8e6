"""A Contactile PTS controller with two PapillArray pads as seen from its line: it streams unasked.

Not emulated: the zeroing of the sensors, and their slip detection.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from slipd.devices.papillarray import RATES_HZ
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.tools.sim.emulators import EmulatedTactile, TactileStream
from slipd.types.arrays import Array

POWER_ON_HZ = 1000.0
NOISE_N = 0.005
STIFFNESS_N_PER_MM = np.array([4.0, 4.0, 6.0])
RESTING_N = (0.0, 0.0, 0.1)
"""Load on each pillar until another is set."""

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
    at = 1 + len(blocks) * (2 + width) + len(frames.INDEX_END)
    index, contents = bytes((width,)), b""
    for kind, content in blocks:
        index += kind.to_bytes(2, "little") + (at + len(contents)).to_bytes(width, "little")
        contents += _encode_item(content, at + len(contents), width)
    body = index + frames.INDEX_END + contents
    return frames.START + body + (sum(body) & 0xFFFF).to_bytes(frames.SUM_LENGTH, "little") + frames.END


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
    return frames.HUB, frames.HUB_FIELDS.pack(counter % (1 << 32), time_us)


def encode_vectors(first: Array | Sequence[float], second: Array | Sequence[float]) -> bytes:
    """Return an entry of two vectors, each of shape (3,): force (N) and displacement (mm) or torque (N mm)."""
    return frames.VECTORS_FIELDS.pack(frames.VECTORS_TYPE, *first, *second)


def encode_pillars(forces_n: Sequence[Array], displacements_mm: Sequence[Array]) -> tuple[int, Item]:
    """Return the block of the pillars: for each sensor force and displacement, each of shape (pillars, 3)."""
    pads = zip(forces_n, displacements_mm, strict=True)
    return frames.PILLAR_FORCES, [[encode_vectors(*pillar) for pillar in zip(*pad, strict=True)] for pad in pads]


def encode_totals(totals_n: Sequence[Array]) -> tuple[int, Item]:
    """Return the block of the total force of each sensor, N, shape (3,); its torques are zero."""
    return frames.TOTALS, [encode_vectors(total_n, (0, 0, 0)) for total_n in totals_n]


def encode_slip(pillars: Sequence[int]) -> list[tuple[int, Item]]:
    """Return the two blocks of a slip detection that is switched off, for sensors with these numbers of pillars."""
    idle = frames.PILLAR_SLIP_FIELDS.pack(frames.SLIP_TYPE, 0, 0.0)
    off = frames.SENSOR_SLIP_FIELDS.pack(frames.SLIP_TYPE, 0, 0.0, -1.0)
    return [(frames.PILLAR_SLIP, [[idle] * count for count in pillars]), (frames.SENSOR_SLIP, [off] * len(pillars))]


class Controller(EmulatedTactile):
    """The controller on its line; its caller passes the time.

    Args:
        seed: Seed of the noise.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    def __init__(self, seed: int, clock_ppm: float = 20.0) -> None:
        super().__init__(TactileStream(seed, POWER_ON_HZ, (frames.PILLARS, 3), NOISE_N), 500.0)
        self._stream.press(np.tile(RESTING_N, (frames.PILLARS, 1)))
        self._stream.start(0)
        self._clock_us_per_ns = 1e-3 + clock_ppm * 1e-9
        self._counter = 0

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; there is no answer."""
        self._received += data
        for command in _COMMAND.finditer(self._received):
            if int(command[1]) in RATES_HZ:
                self._stream.start(t_ns, int(command[1]))
        self._received = self._received[self._received.rfind(b"\n") + 1 :][-_LONGEST_COMMAND:]
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the frames due by then."""
        return [self._frame(taken_ns) for taken_ns in self._stream.times(t_ns)]

    def _frame(self, taken_ns: int) -> bytes:
        pads = [self._stream.image(str(sensor)) for sensor in range(frames.SENSORS)]
        blocks = [
            encode_hub(self._counter, round(taken_ns * self._clock_us_per_ns)),
            encode_pillars(pads, [pad / STIFFNESS_N_PER_MM for pad in pads]),
            encode_totals([pad.sum(axis=0) for pad in pads]),
            *encode_slip([frames.PILLARS] * frames.SENSORS),
        ]
        self._counter += 1
        return encode_blocks(blocks)


make = Controller
