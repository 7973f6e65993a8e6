"""Base of the emulated Weiss tactile controllers: a clock, cells with noise, images pushed at a period."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipd.devices.shared.weiss_packets import Packet, PacketScanner
from slipd.devices.shared.weiss_tactile import FULL_SCALE
from slipd.types.arrays import Array


class WeissController(ABC):
    """A controller on its line; its caller passes the time.

    Args:
        cells: Number of its cells.
        requests: Parser of the requests of the host.
        rng: Source of its noise.
        noise_counts: Standard deviation of each reading.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    rate_hz: float

    def __init__(
        self, cells: int, requests: PacketScanner, rng: np.random.Generator, noise_counts: float, clock_ppm: float
    ) -> None:
        self.options: dict[str, Any] = {}
        self._ideal = np.zeros(cells)
        self._requests = requests
        self._rng = rng
        self._noise_counts = noise_counts
        self._clock = (1.0 + clock_ppm * 1e-6) * 1e-6  # its ms per ns
        self._period_ns: int | None = None
        self._next_ns = 0

    def opened(self, t_ns: int) -> None:
        """Drop an incomplete request of the previous user of the line."""
        self._requests.forget()

    def press(self, values: Array) -> None:
        """Set the load on the cells from now on, shape (cells,), counts.

        Raises:
            ValueError: The number of values is not the number of cells.
        """
        if np.shape(values) != self._ideal.shape:
            raise ValueError(f"values must have shape {self._ideal.shape}, got {np.shape(values)}")
        self._ideal = np.asarray(values, dtype=np.float64)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the answers."""
        return [self._obey(request, t_ns) for request in self._requests.packets(data)]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the images due until then."""
        output = []
        while self._period_ns is not None and self._next_ns <= t_ns:
            output.append(self._frame(self._cells(), self._time_ms(self._next_ns)))
            self._next_ns += self._period_ns
        return output

    def _cells(self) -> NDArray[np.uint16]:
        """Return the cells as they read now."""
        noisy = self._ideal + self._noise_counts * self._rng.standard_normal(self._ideal.size)
        return np.clip(np.rint(noisy), 0, FULL_SCALE).astype(np.uint16)

    def _time_ms(self, t_ns: int) -> int:
        return round(t_ns * self._clock)

    def _push(self, period_ns: int | None, t_ns: int) -> None:
        """Send an image every ``period_ns`` from now on; None: send no more."""
        self._period_ns = period_ns
        self._next_ns = t_ns + (period_ns or 0)

    @abstractmethod
    def _obey(self, request: Packet, t_ns: int) -> bytes: ...

    @abstractmethod
    def _frame(self, cells: NDArray[np.uint16], time_ms: int) -> bytes: ...
