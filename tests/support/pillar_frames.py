"""Frames of a PapillArray whose forces add up to a load, and a decoder that knows their layout."""

from __future__ import annotations

from typing import Any

import numpy as np

from slipd.devices import papillarray
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.papillarray.papillarray_layout import DISPLACEMENT_FIRST, FORCE_FIRST, FRAMES

DISPLACED_MM = 0.125
"""Displacement of every pillar along each axis; the sum cannot be mistaken for a force."""


LAYOUTS = [DISPLACEMENT_FIRST, FORCE_FIRST]


def forces(number: int, pillars: int = 9) -> np.ndarray:
    """Return forces whose sum is a load."""
    drawn = 3.0 + np.random.default_rng(number % 1000).normal(size=(pillars, 3))
    return drawn.astype(np.float32).astype(np.float64)


def entries(forces_n: np.ndarray, layout: int = DISPLACEMENT_FIRST) -> np.ndarray:
    displaced = np.full_like(forces_n, DISPLACED_MM)
    return np.column_stack((forces_n, displaced) if layout == FORCE_FIRST else (displaced, forces_n))


def make(
    number: int,
    pads: list[np.ndarray],
    *,
    width: int = 2,
    layout: int = DISPLACEMENT_FIRST,
    slip: bool = False,
    index_end: bool = True,
    type_bytes: int = 1,
    totals: list[np.ndarray] | None = None,
) -> bytes:
    blocks = [
        frames.encode_hub(number, 1000 * (number % 100_000)),
        frames.encode_pillars([entries(pad, layout) for pad in pads], width),
    ]
    blocks.append(frames.encode_totals([pad.sum(axis=0) for pad in pads] if totals is None else totals, width))
    if slip:
        blocks += frames.encode_slip([len(pad) for pad in pads], width, type_bytes=type_bytes)
    return frames.encode_blocks(blocks, width, index_end=index_end)


def frame(number: int, *, sensors: int = 1, **others: Any) -> bytes:
    return make(number, [forces(number + sensor) for sensor in range(sensors)], **others)


def ready(first: int = 0, layout: int = DISPLACEMENT_FIRST) -> papillarray.Decoder:
    """Return a decoder that knows the layout and has counted no readings; the next frame is ``first``."""
    decoder = papillarray.Decoder()
    for number in range(first - FRAMES, first):
        decoder.receive(make(number, [forces(1, 1)], layout=layout), 0)
    assert decoder.health.good == 1
    decoder.health.good = 0
    return decoder


def resum(body: bytes) -> bytes:
    """Return a frame with the body and its sum."""
    return frames.START + body + (sum(body) & 0xFFFF).to_bytes(2, "little") + frames.END


def decode(stream: bytes, first: int = 0) -> tuple[list[int], papillarray.Decoder]:
    """Return the numbers of the decoded frames, after checking their forces, and the decoder."""
    decoder = ready(first)
    numbers = []
    for sample in decoder.receive(stream, 0):
        assert sample.device_time_ns is not None
        number = sample.device_time_ns // 1_000_000
        np.testing.assert_array_equal(sample.values, forces(number + int(sample.source)))
        numbers.append(number)
    return numbers, decoder
