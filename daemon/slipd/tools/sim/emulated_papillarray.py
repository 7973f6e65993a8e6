"""A Contactile PTS controller with two PapillArray pads as seen from its line: it streams unasked.

Not emulated: the zeroing of the sensors, and their slip detection.
"""

from __future__ import annotations

import re

import numpy as np

from slipd.devices.papillarray import RATES_HZ
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.tools.sim.emulators import EmulatedTactile, TactileStream

POWER_ON_HZ = 1000.0
NOISE_N = 0.005
STIFFNESS_N_PER_MM = np.array([4.0, 4.0, 6.0])
RESTING_N = (0.0, 0.0, 0.1)
"""Load on each pillar until another is set."""

_COMMAND = re.compile(rb"f(\d{1,4})\n")
_LONGEST_COMMAND = 6


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
            frames.encode_hub(self._counter, round(taken_ns * self._clock_us_per_ns)),
            frames.encode_pillars(pads, [pad / STIFFNESS_N_PER_MM for pad in pads]),
            frames.encode_totals([pad.sum(axis=0) for pad in pads]),
            *frames.encode_slip([frames.PILLARS] * frames.SENSORS),
        ]
        self._counter += 1
        return frames.encode_blocks(blocks)


make = Controller
