"""The vendor's server of two XELA uSkin pads as seen from its WebSocket: a welcome, then messages with both images."""

from __future__ import annotations

import json

import numpy as np

from slipd.devices import xela
from slipd.tools.sim.emulators import EmulatedTactile, TactileStream

SENSORS = ("1", "2")
TAXELS = 16
RATE_HZ = 100.0
NOISE_COUNTS = 3.0
REST_COUNTS = 1 << 15
"""Reading of an axis of a taxel without load."""

N_PER_COUNT = 1e-3
BEGAN_S = 1_700_000_000.0
"""Unix time of the server at its start, s."""

_FULL_SCALE = (1 << 16) - 1


class Server(EmulatedTactile):
    """The server on its connection; its caller passes the time.

    Args:
        seed: Seed of the noise.
        taxels: Number of taxels of each pad.
    """

    def __init__(self, seed: int, taxels: int = TAXELS) -> None:
        super().__init__(TactileStream(seed, RATE_HZ, (taxels, 3), NOISE_COUNTS), RATE_HZ)
        self._stream.start(0)
        self._number = 0
        self._welcome: list[bytes] = []

    def opened(self, t_ns: int) -> None:
        """Send a welcome to the new client."""
        self._welcome = [json.dumps({"message": "Welcome"}).encode()]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the messages due by then."""
        output, self._welcome = self._welcome, []
        return output + [self._message(taken_ns) for taken_ns in self._stream.times(t_ns)]

    def _message(self, taken_ns: int) -> bytes:
        self._number += 1
        pads = {key: self._stream.image(key) for key in SENSORS}
        raw = {key: np.clip(np.rint(pad + REST_COUNTS), 0, _FULL_SCALE) for key, pad in pads.items()}
        forces = {key: np.round(N_PER_COUNT * pad, 4) for key, pad in pads.items()}
        return xela.encode_message(self._number, raw, BEGAN_S + taken_ns * 1e-9, forces)


make = Server
