"""An emulated DynPick: it answers polls with the load on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slipd.tools.sim.emulators import EmulatedDevice
from slipd.types.arrays import Array
from slipd_dynpick import ASK, SENSITIVITY, ZERO, encode_reply

NOISE_COUNTS = 2.0


class Sensor(EmulatedDevice):
    """The sensor as seen from its line: it waits for polls, and sends nothing unasked.

    Args:
        seed: Seed of the noise.
        sensitivity: See `slipd_dynpick.Decoder`.
    """

    def __init__(self, seed: int, sensitivity: Sequence[float] = SENSITIVITY) -> None:
        super().__init__(1000.0, sensitivity=list(sensitivity))
        self._sensitivity = np.array(sensitivity)
        self._rng = np.random.default_rng(seed)
        self._load = np.zeros(6)
        self._tick = 0

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load, N and N·m."""
        self._load = np.concatenate((force_n, torque_nm))

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Answer each poll."""
        return [self._reply() for _ in range(data.count(ASK))]

    def _reply(self) -> bytes:
        counts = ZERO + self._load * self._sensitivity + NOISE_COUNTS * self._rng.standard_normal(6)
        self._tick += 1
        return encode_reply([int(count) for count in np.clip(np.rint(counts), 0, 2 * ZERO - 1)], self._tick)


make = Sensor
