"""Emulated sensors as unkind as real ones: `Unkind` wraps the emulator of any sensor.

Each sensor has its own clock, taxels that differ, leak to their neighbours, lag and creep, a force that drifts and
couples, and a line that bunches, drops and repeats. All of it is drawn from a seed. The sizes are those that owners and
makers report; docs/emulation.md names them.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from slipd.tools.sim.emulators import Emulator
from slipd.types.arrays import Array

OFFSET_NS, JITTER_NS = 5_000_000, 500_000
"""Most that a clock starts late, and standard deviation of the lag of the line."""

CRYSTAL, RATE = 2e-4, 0.01
"""Most by which the clock of a device is wrong, and the rate of one of the sensors that a server reads."""

BUNCH_SHARE, BUNCH_NS = 0.002, 16_000_000
"""Share of the looks at the line at which it begins to hold back everything for so long, as a USB adapter does."""

DROPPED, REPEATED = 0.002, 0.01
"""Share of the messages that never come, and of those that come twice."""

GAIN_SPREAD, NEIGHBOURS, AXES, PLAY, CREEP, CREEP_S = 0.08, 0.05, 0.03, 0.03, 0.06, 3.0
"""Of taxels: spread of the gains, share of the load that reaches all neighbours together, coupling of the axes, lag
over the largest load so far, growth under a load that stays, and its time constant."""

COUPLING, WANDER_N, WANDER_NM = 0.01, 0.005, 5e-5
"""Of force/torque sensors: coupling of the components; drift after a second, standard deviation."""

UPDATE_NS = 5_000_000
"""The load that a sensor reads follows that on it so often."""


class SensorClock:
    """The clock of one sensor.

    Args:
        rng: Source of offset, drift and jitter.
        drift: Most by which its rate is wrong.
    """

    def __init__(self, rng: np.random.Generator, drift: float = RATE) -> None:
        self._rng = rng
        self._offset_ns = float(rng.uniform(0.0, OFFSET_NS))
        self._drift = float(rng.uniform(-drift, drift))

    def time_ns(self, t_ns: int) -> int:
        """Return the time that this clock shows, without jitter."""
        return round(t_ns * (1.0 + self._drift) - self._offset_ns)

    def lag_ns(self) -> int:
        """Draw and return the next delay of the line."""
        return round(abs(self._rng.normal(0.0, JITTER_NS)))

    def age_ns(self, t_ns: int, period_ns: int) -> int:
        """Return how old the newest reading of this sensor is for a server that sends at its own times."""
        return round((self._offset_ns - self._drift * t_ns) % period_ns) + self.lag_ns()


class Unkind:
    """A sensor on its line; all that is not here is that of the emulator.

    Args:
        emulator: Of a force/torque or tactile sensor.
        seed: Seed of all that is drawn.
        cols: Columns of its pads.
    """

    def __init__(self, emulator: Emulator, seed: int, cols: int = 4) -> None:
        self._emulator, self._cols, self._rng = emulator, cols, np.random.default_rng(seed)
        self._clock = SensorClock(self._rng, 0.0 if hasattr(emulator, "began_ns") else CRYSTAL)
        self._sensors: dict[str, SensorClock] = {}
        self._pads: dict[str | None, UnkindPad] = {}
        self._wrenches: dict[str | None, UnkindWrench] = {}
        self._local_ns = self._held_until_ns = 0
        self._updated_ns = -UPDATE_NS

    def __getattr__(self, name: str) -> Any:
        """Return what only the emulator has, such as the answer to an inquiry."""
        return getattr(self._emulator, name)

    @property
    def began_ns(self) -> int:
        """When the emulation began, for a device whose readings carry the time of this host."""
        return int(self._emulator.began_ns)  # type: ignore[attr-defined]

    @began_ns.setter
    def began_ns(self, began_ns: int) -> None:
        self._emulator.began_ns = began_ns  # type: ignore[attr-defined]

    def feel(self, force_n: Array, torque_nm: Array, sensor: str | None = None) -> None:
        """Set the load on a force/torque sensor from now on."""
        wrench = np.concatenate((force_n, torque_nm))
        self._wrenches.setdefault(sensor, UnkindWrench(self._rng)).load = wrench

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load on the taxels from now on; the first one is that at rest."""
        pad = self._pads.get(sensor)
        if pad is None:
            pad = self._pads[sensor] = UnkindPad(self._rng, np.asarray(values, dtype=np.float64), self._cols)
        pad.load = np.asarray(values, dtype=np.float64)

    def opened(self, t_ns: int) -> None:
        """Handle the opening of the line."""
        self._emulator.opened(self._local(t_ns))

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; answers come as they are."""
        return self._emulator.receive(data, self._local(t_ns))

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return what gets through."""
        self._update(t_ns)
        if t_ns < self._held_until_ns:
            return []
        if self._rng.random() < BUNCH_SHARE:
            self._held_until_ns = t_ns + BUNCH_NS
        sent: list[bytes] = []
        for piece in self._emulator.advance(self._local(t_ns - self._clock.lag_ns())):
            chance = self._rng.random()
            if chance >= DROPPED:
                sent += [self._own_times(piece, t_ns)] * (2 if chance > 1.0 - REPEATED else 1)
        return sent

    def _local(self, t_ns: int) -> int:
        """Return the time of the device, which never runs back."""
        self._local_ns = max(self._local_ns, self._clock.time_ns(t_ns))
        return self._local_ns

    def _update(self, t_ns: int) -> None:
        """Update the loads on the sensors."""
        if t_ns - self._updated_ns < UPDATE_NS:
            return
        device: Any = self._emulator
        span_s, self._updated_ns = min(t_ns - self._updated_ns, 1_000_000_000) * 1e-9, t_ns
        for sensor, pad in self._pads.items():
            device.press(pad.reading(span_s), **_named(sensor))
        for sensor, wrench in self._wrenches.items():
            felt = wrench.reading(span_s)
            device.feel(felt[:3], felt[3:], **_named(sensor))

    def _own_times(self, piece: bytes, t_ns: int) -> bytes:
        """Give each sensor of a JSON message with several of them the time of its own newest reading."""
        if not piece.startswith(b'{"message"'):
            return piece
        message, period_ns = json.loads(piece), round(1e9 / self.rate_hz)
        for key, sensor in message.items():
            if isinstance(sensor, dict) and "time" in sensor:
                clock = self._sensors.setdefault(key, SensorClock(self._rng))
                sensor["time"] -= clock.age_ns(t_ns, period_ns) * 1e-9
        return json.dumps(message, separators=(",", ":")).encode()


def _named(sensor: str | None) -> dict[str, str]:
    return {} if sensor is None else {"sensor": sensor}


class UnkindPad:
    """Taxels of one pad; ``load`` is what acts on them, in the unit of the device."""

    def __init__(self, rng: np.random.Generator, rest: Array, cols: int) -> None:
        self.load, self._rest = rest, rest
        taxels, axes = len(rest), rest[0].size
        self._gain = 1.0 + GAIN_SPREAD * rng.standard_normal((taxels, 1))
        self._axes = np.eye(axes) + AXES * rng.standard_normal((taxels, axes, axes))
        place = np.stack(np.divmod(np.arange(taxels), cols))
        near = np.abs(place[:, :, None] - place[:, None, :]).sum(axis=0) == 1
        self._leak = NEIGHBOURS * near / np.maximum(near.sum(axis=0), 1) + (1.0 - NEIGHBOURS) * np.eye(taxels)
        self._lagging, self._slow, self._most = np.zeros((3, taxels, axes))

    def reading(self, span_s: float) -> Array:
        """Return what the taxels read after a time."""
        pressed = self._leak @ (self.load - self._rest).reshape(self._slow.shape)
        self._most = np.maximum(self._most, np.abs(pressed))
        self._lagging = np.clip(self._lagging, pressed - PLAY * self._most, pressed + PLAY * self._most)
        crept = -np.expm1(-span_s / CREEP_S)
        self._lagging += (pressed - self._lagging) * crept
        self._slow += (pressed - self._slow) * crept
        mixed = np.einsum("tij,tj->ti", self._axes, self._lagging + CREEP * self._slow)
        return np.asarray(self._rest + (self._gain * mixed).reshape(self._rest.shape))


class UnkindWrench:
    """One force/torque sensor; ``load`` is what acts on it, N and N·m."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.load, self._rng, self._zero = np.zeros(6), rng, np.zeros(6)
        scale = np.array((1.0, 1.0, 1.0, 0.01, 0.01, 0.01))
        self._mix = np.eye(6) + COUPLING * rng.standard_normal((6, 6)) * scale[:, None] / scale
        self._mix[:, 3:] = np.eye(6)[:, 3:]  # of a torque nothing couples over
        self._step = np.repeat((WANDER_N, WANDER_NM), 3)

    def reading(self, span_s: float) -> Array:
        """Return what the sensor reads after a time."""
        self._zero += self._step * self._rng.standard_normal(6) * span_s**0.5
        return np.asarray(self._mix @ self.load + self._zero)
