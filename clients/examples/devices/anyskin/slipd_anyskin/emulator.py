"""An emulated AnySkin board: frames at 100 Hz, the field of magnets at rest, and what a load adds to it."""

from __future__ import annotations

import numpy as np

from slipd.tools.sim.emulators import EmulatedTactile, ReadingStream
from slipd_anyskin import MAGNETOMETERS, encode_frame

REST_UT = np.array((600.0, 150.0, 9400.0))
NOISE_UT = 3.0


class Board(EmulatedTactile):
    """The board as seen from its line; a load adds to the field, µT.

    Args:
        seed: Seed of the noise.
        rate_hz: Frames per second.
        magnetometers: Number of magnetometers.
    """

    def __init__(self, seed: int, rate_hz: float = 100.0, magnetometers: int = MAGNETOMETERS) -> None:
        super().__init__(
            ReadingStream(seed, rate_hz, (magnetometers, 3), NOISE_UT), rate_hz, magnetometers=magnetometers
        )

    def opened(self, t_ns: int) -> None:
        """Begin to send, as the firmware does once the port is open."""
        self._stream.start(t_ns)

    def advance(self, t_ns: int) -> list[bytes]:
        """Return the frames due by ``t_ns``."""
        return [encode_frame(REST_UT + self._stream.reading()) for _ in self._stream.times(t_ns)]


make = Board
