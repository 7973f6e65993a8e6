"""An emulated PaXini module: it answers polls with the load on it, rounded to 0.1 N."""

from __future__ import annotations

import numpy as np

from slipd.tools.sim.emulators import EmulatedDevice
from slipd.types.arrays import Array
from slipd_paxini import HEADER, N_PER_COUNT, PREFIX, encode_request

NOISE_N = 0.05


class Module(EmulatedDevice):
    """The module as seen from its line.

    Args:
        seed: Seed of the noise.
        module: Its number.
    """

    def __init__(self, seed: int, module: int = 0) -> None:
        super().__init__(100.0, module=module)
        self._request = encode_request(module)
        self._rng = np.random.default_rng(seed)
        self._force_n = np.zeros(3)

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the force on the module, N; torque is not measured."""
        self._force_n = np.asarray(force_n)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Answer every complete request."""
        *requests, self._received = (self._received + data).split(self._request)
        self._received = self._received[-len(self._request) :]
        return [self._reply() for _ in requests]

    def _reply(self) -> bytes:
        counts = np.rint((self._force_n + NOISE_N * self._rng.standard_normal(3)) / N_PER_COUNT)
        x, y, z = (int(count) for count in np.clip(counts, (-128, -128, 0), (127, 127, 255)))
        frame = HEADER + bytes(PREFIX - len(HEADER)) + bytes((x & 0xFF, y & 0xFF, z))
        return frame + bytes((-sum(frame) & 0xFF,))


make = Module
