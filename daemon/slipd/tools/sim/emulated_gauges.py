"""Six strain gauges on a beam as seen from the line of their amplifier; it sends unasked and never reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slipd.devices import gauges
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream, whole
from slipd.types.arrays import Array

FULL_SCALE = (1 << 23) - 1
"""Largest count of a 24-bit converter."""

COUNTS_PER_UNIT = np.array(
    (
        (9000.0, 300.0, -200.0, 1500.0, 200_000.0, -9000.0),
        (-8500.0, 250.0, 150.0, -1200.0, 210_000.0, 7000.0),
        (200.0, 9200.0, 180.0, -205_000.0, 1100.0, 8000.0),
        (-300.0, -8800.0, 220.0, -195_000.0, -900.0, -6000.0),
        (150.0, -120.0, 4000.0, 2500.0, -1800.0, 160_000.0),
        (-180.0, 140.0, 4200.0, -2200.0, 1900.0, -150_000.0),
    )
)
"""Counts per N and N·m of each channel for each component, of an invented beam that bends more than it stretches."""
OFFSET = np.array((1200.0, -800.0, 450.0, -2300.0, 90.0, 3100.0))


class GaugeAmplifier(EmulatedWrench):
    """The amplifier on its line; its caller passes the time.

    Args:
        seed: Seed of its noise.
        rate_hz: Frames per second.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
        noise_n: Standard deviation of each force component, N.
        noise_nm: Standard deviation of each torque component, N·m.
        matrix: N and N·m per count, (6, 6), as in the config of its daemon; None: the inverse of ``COUNTS_PER_UNIT``.
        offset: Counts of each channel without load.
    """

    def __init__(
        self,
        seed: int,
        rate_hz: float = 1000.0,
        clock_ppm: float = 30.0,
        *,
        noise_n: float = 0.02,
        noise_nm: float = 0.0005,
        matrix: Sequence[Sequence[float]] | None = None,
        offset: Sequence[float] = tuple(OFFSET.tolist()),
    ) -> None:
        self._counts_per_unit = COUNTS_PER_UNIT if matrix is None else np.linalg.inv(np.array(matrix))
        self._offset = np.array(offset)
        matrix = np.linalg.inv(COUNTS_PER_UNIT).tolist() if matrix is None else matrix
        stream = WrenchStream(seed, rate_hz, noise_n, noise_nm)
        super().__init__(stream, rate_hz, matrix=matrix, offset=list(offset))
        self._stream.start(0)
        self._clock_us_per_ns = 1e-3 + clock_ppm * 1e-9
        self._sequence = 0

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the frames due by then."""
        return [
            self._frame(taken_ns, self._counts_per_unit @ values + self._offset)
            for taken_ns, values in self._stream.due(t_ns)
        ]

    def _frame(self, taken_ns: int, counts: Array) -> bytes:
        channels = whole(counts, 24)
        saturated = sum([1 << channel for channel, count in enumerate(channels) if abs(count) >= FULL_SCALE])
        device_us = round(taken_ns * self._clock_us_per_ns)
        self._sequence += 1
        return gauges.encode_frame(channels, self._sequence - 1, device_us, saturated)


make = GaugeAmplifier
