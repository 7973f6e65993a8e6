"""An emulated AnySkin board: frames at 100 Hz, the field of magnets at rest, and what a load adds to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from slipd.tools.sim.tactile_stream import TactileStream
from slipd.types.arrays import Array
from slipd_anyskin import MAGNETOMETERS, encode_frame

REST_UT = np.array((600.0, 150.0, 9400.0))
NOISE_UT = 3.0


class Board:
    """The board as seen from its line.

    Args:
        seed: Seed of the noise.
        rate_hz: Frames per second.
        magnetometers: Number of magnetometers.
    """

    def __init__(self, seed: int, rate_hz: float, magnetometers: int) -> None:
        self.options: dict[str, Any] = {"magnetometers": magnetometers}
        self.rate_hz = rate_hz
        self._images = TactileStream(seed, rate_hz, (magnetometers, 3), NOISE_UT)

    def press(self, values: Array) -> None:
        """Set what the load adds to the field, shape (magnetometers, 3), µT."""
        self._images.press(values)

    def opened(self, t_ns: int) -> None:
        """Begin to send, as the firmware does once the port is open."""
        self._images.start(t_ns)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Ignore what the host writes."""
        del data, t_ns
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Return the frames due by ``t_ns``."""
        return [encode_frame(REST_UT + self._images.image()) for _ in self._images.due(t_ns)]


def make(seed: int, rate_hz: float = 100.0, magnetometers: int = MAGNETOMETERS) -> Board:
    """Return a board."""
    return Board(seed, rate_hz, magnetometers)
