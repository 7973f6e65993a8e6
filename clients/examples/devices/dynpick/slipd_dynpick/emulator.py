"""An emulated DynPick: it answers polls with the load on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from slipd_dynpick import ASK, SENSITIVITY, ZERO, encode_reply

NOISE_COUNTS = 2.0


class Sensor:
    """The sensor as seen from its line."""

    rate_hz = 1000.0

    def __init__(self, seed: int, sensitivity: Sequence[float]) -> None:
        self.options: dict[str, Any] = {"sensitivity": list(sensitivity)}
        self._sensitivity = np.array(sensitivity)
        self._rng = np.random.default_rng(seed)
        self._load = np.zeros(6)
        self._tick = 0

    def feel(self, force_n: ArrayLike, torque_nm: ArrayLike) -> None:
        """Set the load, N and N·m."""
        self._load = np.concatenate((force_n, torque_nm))

    def opened(self, t_ns: int) -> None:
        """Do nothing: the sensor waits for polls."""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Answer each poll."""
        return [self._reply() for _ in range(data.count(ASK))]

    def advance(self, t_ns: int) -> list[bytes]:
        """Return nothing: the sensor sends nothing unasked."""
        return []

    def _reply(self) -> bytes:
        counts = ZERO + self._load * self._sensitivity + NOISE_COUNTS * self._rng.standard_normal(6)
        self._tick += 1
        return encode_reply([int(count) for count in np.clip(np.rint(counts), 0, 2 * ZERO - 1)], self._tick)


def make(seed: int, sensitivity: Sequence[float] = SENSITIVITY) -> Sensor:
    """Return a sensor."""
    return Sensor(seed, sensitivity)
