"""What an emulated tactile sensor measures, and when it sends it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slipd.samples import Array


class TactileStream:
    """Images at a rate: what presses on the sensor, and noise.

    Args:
        seed: Of the noise.
        rate_hz: Images a second.
        shape: Of an image, (taxels,) or (taxels, 3).
        noise: Standard deviation of each value.

    Attributes:
        rate_hz: As it is now.
    """

    def __init__(self, seed: int, rate_hz: float, shape: tuple[int, ...], noise: float) -> None:
        self.rate_hz = rate_hz
        self._rng = np.random.default_rng(seed)
        self._ideal = np.zeros(shape)
        self._noise = noise
        self._begun_ns: int | None = None
        self._sent = 0

    def press(self, values: Array) -> None:
        """Take what presses on each taxel from now on, in the sensor's own units.

        Raises:
            ValueError: The shape is not that of an image.
        """
        values = np.asarray(values, dtype=np.float64)
        if values.shape != self._ideal.shape:
            raise ValueError(f"an image of shape {values.shape}: this sensor has {self._ideal.shape}")
        self._ideal = values

    def start(self, t_ns: int, rate_hz: float | None = None) -> None:
        """Send images from ``t_ns`` on, the first after one period; at another rate where one is given."""
        self.rate_hz = rate_hz or self.rate_hz
        self._begun_ns, self._sent = t_ns, 0

    def stop(self) -> None:
        """Send none from now on."""
        self._begun_ns = None

    def due(self, t_ns: int) -> Iterator[int]:
        """Yield when each image due by ``t_ns`` was taken."""
        while self._begun_ns is not None:
            next_ns = self._begun_ns + round((self._sent + 1) * 1e9 / self.rate_hz)
            if next_ns > t_ns:
                return
            self._sent += 1
            yield next_ns

    def image(self) -> Array:
        """Return an image as it is taken now; each call has noise of its own."""
        return self._ideal + self._noise * self._rng.standard_normal(self._ideal.shape)
