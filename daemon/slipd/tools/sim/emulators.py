"""The emulated devices by name, and what they share; the caller of an emulator passes the time and the load."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from slipd.devices import DEVICES
from slipd.types.arrays import Array


class Emulator(Protocol):
    """A device as seen from its line, in pieces of bytes; it has no line of its own.

    A force/torque sensor also has ``feel(force_n, torque_nm)``, which sets the load in the frame of the sensor, N and
    N·m. A tactile sensor has ``press(values)``, which sets the load of shape (taxels,) or (taxels, 3) in its own units.

    Attributes:
        options: Options for the decoder or session that reads it.
        rate_hz: Readings per second when it runs.
    """

    options: dict[str, Any]
    rate_hz: float

    def opened(self, t_ns: int) -> None:
        """Handle the opening of the line at ``t_ns``, ns since the emulator was created."""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; return the answers."""

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the pieces that the device sends unasked: frames, messages or datagrams."""


class EmulatedDevice:
    """Base of the emulators: a device that reads nothing and sends nothing; a subclass says what it does.

    Args:
        rate_hz: Readings per second when it runs.
        options: Options for the decoder or session that reads it.
    """

    def __init__(self, rate_hz: float, **options: Any) -> None:
        self.rate_hz = rate_hz
        self.options = options
        self._received = b""  # bytes of the host that are no whole request yet

    def opened(self, t_ns: int) -> None:
        """Drop the bytes of the previous user of the line."""
        self._received = b""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Ignore bytes from the host."""
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Send nothing unasked."""
        return []


def make_emulator(device: str, seed: int = 0, **options: Any) -> Emulator:
    """Return the emulator of a device, which the ``make`` of its module returns.

    Args:
        device: Name in the list of devices.
        seed: Seed of its noise.
        options: Other arguments of its ``make``, such as ``wiring`` of a device whose protocol depends on the line.

    Raises:
        ValueError: The device is of another package and has no emulator.
    """
    emulator: Emulator = _module(device).make(seed, **options)
    return emulator


def accepted(device: str, settings: dict[str, Any]) -> dict[str, Any]:
    """Return those settings that the ``make`` of a device has arguments for."""
    return {name: settings[name] for name in inspect.signature(_module(device).make).parameters if name in settings}


def _module(device: str) -> Any:
    known = DEVICES[device]
    if not known.emulator and known.interface is not None:
        raise ValueError(f"{device} cannot be emulated: its package has no emulator")
    return import_module(known.emulator or f"slipd.tools.sim.emulated_{device}")


_NOISE_BLOCK = 1024


class Timer:
    """Times of readings at a rate.

    Args:
        rate_hz: Readings per second.

    Attributes:
        rate_hz: Present rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._begun_ns: int | None = None
        self._sent = 0

    def start(self, t_ns: int, rate_hz: float | None = None) -> None:
        """Send readings from ``t_ns`` on, the first after one period, optionally at another rate."""
        self.rate_hz = rate_hz or self.rate_hz
        self._begun_ns, self._sent = t_ns, 0

    def stop(self) -> None:
        """Send no more readings."""
        self._begun_ns = None

    def times(self, t_ns: int) -> Iterator[int]:
        """Yield the time of each reading due by ``t_ns``."""
        while self._begun_ns is not None:
            next_ns = self._begun_ns + round((self._sent + 1) * 1e9 / self.rate_hz)
            if next_ns > t_ns:
                return
            self._sent += 1
            yield next_ns


class WrenchStream(Timer):
    """Readings at a rate: the load on the sensor, or the motion of an arm, with noise.

    Args:
        seed: Seed or source of the noise.
        rate_hz: Readings per second.
        noise_n: Standard deviation of each force component, N; of an arm's gravity, m/s².
        noise_nm: Standard deviation of each torque component, N·m; of an arm's angular velocity, rad/s.
    """

    def __init__(
        self, seed: int | np.random.Generator, rate_hz: float, noise_n: float = 0.02, noise_nm: float = 0.0005
    ) -> None:
        super().__init__(rate_hz)
        self._ideal = np.zeros(6)
        self._rng = np.random.default_rng(seed)
        self._sigma = np.repeat((noise_n, noise_nm), 3)
        self._noise: list[Array] = []

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load on the sensor from now on, in the frame of the sensor, N and N·m."""
        self._ideal = np.concatenate((force_n, torque_nm))

    def due(self, t_ns: int) -> Iterator[tuple[int, Array]]:
        """Yield the time of each reading due by ``t_ns``, and its force and torque, shape (6,)."""
        for taken_ns in self.times(t_ns):
            yield taken_ns, self._ideal + self.next_noise()

    def next_noise(self) -> Array:
        """Return the noise of one reading; drawn in blocks, because a draw costs as much as a block of some hundred."""
        if not self._noise:
            self._noise = [*self._sigma * self._rng.standard_normal((_NOISE_BLOCK, 6))][::-1]
        return self._noise.pop()


def whole(values: Array, bits: int) -> list[int]:
    """Round values to counts, clipped to signed integers of ``bits`` bits."""
    most = (1 << bits - 1) - 1
    return [min(max(round(value), -most - 1), most) for value in values.tolist()]


class EmulatedWrench(EmulatedDevice):
    """Base of the emulated force/torque sensors.

    Args:
        stream: Its readings.
        rate_hz: See `EmulatedDevice`.
        options: See `EmulatedDevice`.
    """

    def __init__(self, stream: WrenchStream, rate_hz: float, **options: Any) -> None:
        super().__init__(rate_hz, **options)
        self._stream = stream

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load on the sensor from now on, in the frame of the sensor, N and N·m."""
        self._stream.feel(force_n, torque_nm)


class TactileStream(Timer):
    """Images at a rate: the load on the sensor with noise.

    Args:
        seed: Seed or source of the noise.
        rate_hz: Images per second.
        shape: Shape of an image, (taxels,) or (taxels, 3).
        noise: Standard deviation of each value.
    """

    def __init__(self, seed: int | np.random.Generator, rate_hz: float, shape: tuple[int, ...], noise: float) -> None:
        super().__init__(rate_hz)
        self._rng = np.random.default_rng(seed)
        self._ideal = np.zeros(shape)
        self._of_sensor: dict[str, Array] = {}
        self._noise = noise

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load on each taxel from now on, in the units of the sensor.

        Args:
            values: The loads, of the shape of an image.
            sensor: Name of one of several sensors with images of this shape; None: all of them.

        Raises:
            ValueError: The shape is not that of an image.
        """
        values = np.asarray(values, dtype=np.float64)
        if values.shape != self._ideal.shape:
            raise ValueError(f"an image must have shape {self._ideal.shape}, got {values.shape}")
        if sensor is None:
            self._ideal = values
            self._of_sensor.clear()
        else:
            self._of_sensor[sensor] = values

    def due(self, t_ns: int) -> Iterator[tuple[int, Array]]:
        """Yield the time of each image due by ``t_ns``, and the image."""
        for taken_ns in self.times(t_ns):
            yield taken_ns, self.image()

    def image(self, sensor: str = "") -> Array:
        """Return an image of the present load on one sensor with new noise."""
        return self._of_sensor.get(sensor, self._ideal) + self._noise * self._rng.standard_normal(self._ideal.shape)


class EmulatedTactile(EmulatedDevice):
    """Base of the emulated tactile sensors.

    Args:
        stream: Its images.
        rate_hz: See `EmulatedDevice`.
        options: See `EmulatedDevice`.
    """

    def __init__(self, stream: TactileStream, rate_hz: float, **options: Any) -> None:
        super().__init__(rate_hz, **options)
        self._stream = stream

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load on each taxel of one sensor or all from now on, of the shape of an image, in its own units."""
        self._stream.press(values, sensor)
