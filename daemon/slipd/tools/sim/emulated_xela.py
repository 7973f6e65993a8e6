"""The vendor's server of two XELA uSkin pads as seen from its WebSocket: a welcome, then messages with both images."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

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


def encode_message(
    number: int,
    sensors: Mapping[str, ArrayLike],
    time_s: float,
    calibrated: Mapping[str, ArrayLike] | None = None,
    *,
    model: str = "uSPa44",
) -> bytes:
    """Return one message as the server sends it.

    Args:
        number: The server's sequence number.
        sensors: Raw readings per sensor key ("1", "2", …), integers of 16 bits, shape (taxels, 3).
        time_s: Unix time, s.
        calibrated: Calibrated forces per sensor key, same shape; optional.
        model: Model name of all sensors.
    """
    message: dict[str, Any] = {"message": number, "type": "routine"}
    for key, values in sensors.items():
        raw = np.asarray(values, dtype=np.uint16).reshape(-1, xela.AXES)
        message[key] = {
            "sensor": key,
            "model": model,
            "taxels": len(raw),
            "time": time_s,
            "data": ",".join(f"{word:04X}" for word in raw.ravel().tolist()),
        }
        if calibrated and key in calibrated:
            forces = np.asarray(calibrated[key], dtype=np.float64)
            message[key]["calibrated"] = forces.ravel().tolist()
    return json.dumps(message, separators=(",", ":")).encode()


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
        return encode_message(self._number, raw, BEGAN_S + taken_ns * 1e-9, forces)


make = Server
