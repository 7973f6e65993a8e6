"""Readings of an emulated force/torque sensor, and their times."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slipd.types.arrays import Array

_NOISE_BLOCK = 1024


class WrenchStream:
    """Readings at a rate: the load on the sensor with noise.

    Args:
        seed: Seed of the noise.
        rate_hz: Readings per second.
        noise_n: Standard deviation of each force component, N.
        noise_nm: Standard deviation of each torque component, N·m.
    """

    def __init__(self, seed: int, rate_hz: float, noise_n: float = 0.02, noise_nm: float = 0.0005) -> None:
        self.rate_hz = rate_hz
        self._rng = np.random.default_rng(seed)
        self._ideal = np.zeros(6)
        self._sigma = np.repeat((noise_n, noise_nm), 3)
        self._noise: Array = np.empty((0, 6))
        self._drawn = 0
        self._begun_ns: int | None = None
        self._sent = 0

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load on the sensor from now on, in the frame of the sensor, N and N·m."""
        self._ideal = np.concatenate((force_n, torque_nm))

    def start(self, t_ns: int, rate_hz: float | None = None) -> None:
        """Send readings from ``t_ns`` on, the first after one period, optionally at another rate."""
        self.rate_hz = rate_hz or self.rate_hz
        self._begun_ns, self._sent = t_ns, 0

    def stop(self) -> None:
        """Send no more readings."""
        self._begun_ns = None

    def due(self, t_ns: int) -> Iterator[tuple[int, Array]]:
        """Yield the time of each reading due by ``t_ns``, and its force and torque, shape (6,)."""
        while self._begun_ns is not None:
            next_ns = self._begun_ns + round((self._sent + 1) * 1e9 / self.rate_hz)
            if next_ns > t_ns:
                return
            self._sent += 1
            yield next_ns, self._ideal + self._next_noise()

    def play(self, loads: Array) -> tuple[list[int], Array]:
        """Return the times of the next readings, ns, and the readings of the load at each, both of shape (n, 6)."""
        begun_ns, first = self._begun_ns or 0, self._sent + 1
        self._sent += len(loads)
        times_ns = [begun_ns + round(number * 1e9 / self.rate_hz) for number in range(first, self._sent + 1)]
        return times_ns, loads + [self._next_noise() for _ in loads]

    def _next_noise(self) -> Array:
        """Return the noise of one reading; drawn in blocks, because a draw costs as much as a block of some hundred."""
        if self._drawn == len(self._noise):
            self._noise = self._sigma * self._rng.standard_normal((_NOISE_BLOCK, 6))
            self._drawn = 0
        self._drawn += 1
        noise: Array = self._noise[self._drawn - 1]
        return noise


def whole(values: Array, bits: int) -> list[int]:
    """Round values to counts, clipped to signed integers of ``bits`` bits."""
    most = (1 << bits - 1) - 1
    return [min(max(round(value), -most - 1), most) for value in values.tolist()]
