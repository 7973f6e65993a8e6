"""Images of an emulated tactile sensor, and their times."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slipd.types.arrays import Array


class TactileStream:
    """Images at a rate: the load on the sensor with noise.

    Args:
        seed: Seed of the noise.
        rate_hz: Images per second.
        shape: Shape of an image, (taxels,) or (taxels, 3).
        noise: Standard deviation of each value.

    Attributes:
        rate_hz: Present rate.
    """

    def __init__(self, seed: int, rate_hz: float, shape: tuple[int, ...], noise: float) -> None:
        self.rate_hz = rate_hz
        self._rng = np.random.default_rng(seed)
        self._ideal = np.zeros(shape)
        self._of_sensor: dict[str, Array] = {}
        self._noise = noise
        self._begun_ns: int | None = None
        self._sent = 0

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load on each taxel from now on, in the units of the sensor.

        Args:
            values: The loads, of the shape of an image.
            sensor: Name of one of several sensors with images of this shape; None: all of them.

        Raises:
            ValueError: The shape is not that of an image.
        """
        values = np.asarray(values, dtype=np.float64)
        if values.shape != self._ideal.shape:
            raise ValueError(f"an image must have shape {self._ideal.shape}, got {values.shape}")
        if sensor is None:
            self._ideal = values
            self._of_sensor.clear()
        else:
            self._of_sensor[sensor] = values

    def start(self, t_ns: int, rate_hz: float | None = None) -> None:
        """Send images from ``t_ns`` on, the first after one period, optionally at another rate."""
        self.rate_hz = rate_hz or self.rate_hz
        self._begun_ns, self._sent = t_ns, 0

    def stop(self) -> None:
        """Send no more images."""
        self._begun_ns = None

    def due(self, t_ns: int) -> Iterator[int]:
        """Yield the time of each image due by ``t_ns``."""
        while self._begun_ns is not None:
            next_ns = self._begun_ns + round((self._sent + 1) * 1e9 / self.rate_hz)
            if next_ns > t_ns:
                return
            self._sent += 1
            yield next_ns

    def image(self, sensor: str = "") -> Array:
        """Return an image of the present load on one sensor with new noise."""
        return self._of_sensor.get(sensor, self._ideal) + self._noise * self._rng.standard_normal(self._ideal.shape)
