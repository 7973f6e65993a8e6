"""Frames of a PapillArray with known forces."""

from __future__ import annotations

from typing import Any

import numpy as np

from slipd.devices import papillarray
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.tools.sim import emulated_papillarray as sim

DISPLACED_MM = 0.125
"""Displacement of every pillar along each axis; it cannot be mistaken for a force."""


def forces(number: int, pillars: int = 9) -> np.ndarray:
    drawn = 3.0 + np.random.default_rng(number % 1000).normal(size=(pillars, 3))
    return drawn.astype(np.float32).astype(np.float64)


def pillars(*pads: np.ndarray) -> tuple[int, sim.Item]:
    """Return the block of the forces on the pillars of each sensor, N."""
    return sim.encode_pillars(pads, [np.full_like(pad, DISPLACED_MM) for pad in pads])


def make(number: int, pads: list[np.ndarray], *, width: int = 2, slip: bool = False) -> bytes:
    blocks = [
        sim.encode_hub(number, 1000 * (number % 100_000)),
        pillars(*pads),
        sim.encode_totals([pad.sum(axis=0) for pad in pads]),
    ]
    if slip:
        blocks += sim.encode_slip([len(pad) for pad in pads])
    return sim.encode_blocks(blocks, width)


def frame(number: int, *, sensors: int = 1, **others: Any) -> bytes:
    return make(number, [forces(number + sensor) for sensor in range(sensors)], **others)


def resum(body: bytes) -> bytes:
    """Return a frame with the body and its sum."""
    return frames.START + body + (sum(body) & 0xFFFF).to_bytes(2, "little") + frames.END


def decode(stream: bytes) -> tuple[list[int], papillarray.Decoder]:
    """Return the numbers of the decoded frames, after checking their forces, and the decoder."""
    decoder = papillarray.Decoder()
    numbers = []
    for sample in decoder.receive(stream, 0):
        assert sample.device_time_ns is not None
        number = sample.device_time_ns // 1_000_000
        np.testing.assert_array_equal(sample.values, forces(number + int(sample.source)))
        numbers.append(number)
    return numbers, decoder
