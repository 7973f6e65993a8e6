"""A program that pushes the readings of force/torque sensors, pads and an arm, each a stream of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from slipd.devices.external import encode_reading
from slipd.tools.sim.emulators import EmulatedDevice, TactileStream, WrenchStream
from slipd.types.arrays import Array

WRENCH, PAD = "left.wrench", "left.pad"
"""Names of the streams."""

RATE_HZ = 500.0
PAD_EVERY = 5
"""Wrench readings per image."""

TAXELS = 16
NOISE = 0.01
"""Standard deviation of each taxel."""

ARM_NOISE = 0.02, 0.002
"""Standard deviation of each component of an arm's gravity, m/s², and angular velocity, rad/s."""


class Pusher(EmulatedDevice):
    """The program that pushes; its caller passes the time.

    Args:
        seed: Seed of the noise.
        wrenches: Names of the streams of force/torque sensors.
        pads: Names of the streams of pads, each with the shape of its image, (taxels,) or (taxels, 3).
        arms: Names of the streams of the arm's motion.
        rates_hz: Rate of a stream by its name, Hz; by default 500 for a sensor or arm, and 100 for a pad.

    Attributes:
        began_ns: CLOCK_MONOTONIC of the start; the times of its readings count from it.
    """

    def __init__(
        self,
        seed: int,
        wrenches: Sequence[str] = (WRENCH,),
        pads: Mapping[str, tuple[int, ...]] = {PAD: (TAXELS,)},
        arms: Sequence[str] = (),
        rates_hz: Mapping[str, float] = {},
    ) -> None:
        super().__init__(RATE_HZ)
        self.began_ns = 0
        self._wrenches = {name: WrenchStream(seed + k, rates_hz.get(name, RATE_HZ)) for k, name in enumerate(wrenches)}
        self._images = {
            name: TactileStream(seed + k, rates_hz.get(name, RATE_HZ / PAD_EVERY), shape, NOISE)
            for k, (name, shape) in enumerate(pads.items())
        }
        self._arms = {
            name: WrenchStream(seed + k, rates_hz.get(name, RATE_HZ), *ARM_NOISE) for k, name in enumerate(arms)
        }
        self._streams: dict[str, WrenchStream | TactileStream] = {**self._wrenches, **self._images, **self._arms}
        for stream in self._streams.values():
            stream.start(0)
        self._sent = dict.fromkeys(self._streams, 0)

    def feel(self, force_n: Array, torque_nm: Array, sensor: str = WRENCH) -> None:
        """Set the load on a sensor from now on, in the frame of the sensor, N and N·m."""
        self._wrenches[sensor].feel(force_n, torque_nm)

    def press(self, values: Array, sensor: str = PAD) -> None:
        """Set the load on each taxel of a pad from now on, of the shape of its image."""
        self._images[sensor].press(values)

    def carry(self, gravity_mps2: Array, velocity_radps: Array, sensor: str) -> None:
        """Set the motion of an arm from now on: apparent gravity, m/s², and angular velocity, rad/s."""
        self._arms[sensor].feel(gravity_mps2, velocity_radps)

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the messages due by then, in the order of their times."""
        readings = [(t, name, values) for name, stream in self._streams.items() for t, values in stream.due(t_ns)]
        return [self._message(*reading) for reading in sorted(readings, key=lambda reading: reading[0])]

    def _message(self, taken_ns: int, stream: str, values: Array) -> bytes:
        fields: dict[str, Any] = {"force_n": values[:3], "torque_nm": values[3:]}
        if stream in self._images:
            fields = {"values": values}
        elif stream in self._arms:
            fields = {"gravity_mps2": values[:3], "angular_velocity_radps": values[3:]}
        self._sent[stream] += 1
        return encode_reading(stream, self.began_ns + taken_ns, seq=self._sent[stream] - 1, **fields)


make = Pusher
