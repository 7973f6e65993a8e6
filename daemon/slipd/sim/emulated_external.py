"""A program that pushes the readings of a force/torque sensor and of a pad, each a stream of its own."""

from __future__ import annotations

from typing import Any

from slipd.arrays import Array
from slipd.devices.external import encode_reading
from slipd.sim.tactile_stream import TactileStream
from slipd.sim.wrench_stream import WrenchStream

WRENCH, PAD = "left.wrench", "left.pad"
"""Names of the streams."""

RATE_HZ = 500.0
PAD_EVERY = 5
"""Wrench readings per image."""

TAXELS = 16


class Pusher:
    """The program that pushes; its caller passes the time.

    Args:
        seed: Seed of the noise.

    Attributes:
        began_ns: CLOCK_MONOTONIC of the start; the times of its readings count from it.
    """

    def __init__(self, seed: int) -> None:
        self.options: dict[str, Any] = {}
        self.rate_hz = RATE_HZ
        self.began_ns = 0
        self._wrenches = WrenchStream(seed, RATE_HZ)
        self._images = TactileStream(seed, RATE_HZ / PAD_EVERY, (TAXELS,), 0.01)
        self._wrenches.start(0)
        self._images.start(0)
        self._sent = {WRENCH: 0, PAD: 0}

    def opened(self, t_ns: int) -> None:
        """Do nothing: the program pushes all the time."""

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load on the sensor from now on, in the frame of the sensor, N and N·m."""
        self._wrenches.feel(force_n, torque_nm)

    def press(self, values: Array) -> None:
        """Set the load on each taxel from now on, shape (16,)."""
        self._images.press(values)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Ignore all bytes."""
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the messages due by then, in the order of their times."""
        wrenches = [(t, WRENCH, values) for t, values in self._wrenches.due(t_ns)]
        images = [(t, PAD, self._images.image()) for t in self._images.due(t_ns)]
        return [self._message(*reading) for reading in sorted(wrenches + images, key=lambda reading: reading[0])]

    def _message(self, taken_ns: int, stream: str, values: Array) -> bytes:
        number = self._sent[stream]
        self._sent[stream] += 1
        t_ns = self.began_ns + taken_ns
        if stream == PAD:
            return encode_reading(stream, t_ns, seq=number, values=values)
        return encode_reading(stream, t_ns, seq=number, force_n=values[:3], torque_nm=values[3:])


def make(seed: int) -> Pusher:
    """Return the emulator with seeded noise."""
    return Pusher(seed)
