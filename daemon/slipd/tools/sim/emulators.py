"""The emulated devices by name, and what they share; the caller of an emulator passes the time and the load."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from pkgutil import resolve_name
from typing import Any, Protocol, cast

import numpy as np

from slipd.devices import DEVICES
from slipd.devices.shared.frame_scanner import FrameScanner
from slipd.types.arrays import Array

EMULATORS = {
    "bota": "emulated_wrenches:BotaSensor",
    "dsacon32": "emulated_weiss:Dsacon32",
    "external": "emulated_external:Pusher",
    "external_gripper": "emulated_external:Driver",
    "gauges": "emulated_wrenches:GaugeAmplifier",
    "netft": "emulated_rdt:NetftSensor",
    "optoforce": "emulated_rdt:make_optoforce",
    "papillarray": "emulated_pads:PapillArrays",
    "pvdf": "emulated_pvdf:PvdfPad",
    "robotiq_2f": "emulated_robotiq_2f:GripperLine",
    "robotous": "emulated_wrenches:RobotousSensor",
    "tsf85": "emulated_pads:Fingertips",
    "wsg": "emulated_wsg:Gripper",
    "wts": "emulated_weiss:WtsModule",
    "xela": "emulated_pads:XelaServer",
}
"""What makes the emulator of each device of slipd: a module of this folder, and a class or function in it."""


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


def make_emulator(device: str, seed: int = 0, **options: Any) -> Emulator:
    """Return the emulator of a device.

    Args:
        device: Name in the list of devices.
        seed: Seed of its noise; not used by a device without noise.
        options: Other arguments of what makes it, such as ``wiring`` of a device whose protocol depends on the line.

    Raises:
        ValueError: The device is of another package and has no emulator.
    """
    return cast("Emulator", _maker(device)(**accepted(device, {"seed": seed}), **options))


def accepted(device: str, settings: dict[str, Any]) -> dict[str, Any]:
    """Return those settings that `make_emulator` accepts for a device."""
    return {name: settings[name] for name in inspect.signature(_maker(device)).parameters if name in settings}


def _maker(device: str) -> Any:
    known = DEVICES[device]
    if known.interface is None:
        return resolve_name(f"slipd.tools.sim.{EMULATORS[device]}")
    if not known.emulator:
        raise ValueError(f"{device} cannot be emulated: its package has no emulator")
    return resolve_name(f"{known.emulator}:make")


class EmulatedDevice:
    """Base of the emulators: a device that reads nothing and sends nothing; a subclass says what it does.

    Args:
        rate_hz: Readings per second when it runs.
        options: Options for the decoder or session that reads it.
    """

    _requests: FrameScanner | None = None
    """Finds the requests of the host, which `_obey` carries out; None: there are none, or a subclass receives them."""

    def __init__(self, rate_hz: float, **options: Any) -> None:
        self.rate_hz = rate_hz
        self.options = options
        self._received = b""  # bytes of the host that are no whole request yet

    def opened(self, t_ns: int) -> None:
        """Drop the bytes of the previous user of the line."""
        self._received = b""
        if self._requests is not None:
            self._requests.forget()

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Carry out the requests that these bytes complete; return the answers."""
        if self._requests is None:
            return []
        buffer, found = self._requests.receive(data)
        return [answer for at, _ in found for answer in self._obey(buffer, at, t_ns)]

    def advance(self, t_ns: int) -> list[bytes]:
        """Send nothing unasked."""
        return []

    def _obey(self, buffer: bytes, at: int, t_ns: int) -> list[bytes]:
        """Carry out the request at ``at``; return the answers."""
        raise NotImplementedError


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


NOISE_BLOCK = 6144
"""Numbers of noise drawn at once: a draw costs as much as a block of some hundred."""


class ReadingStream(Timer):
    """Readings at a rate: the load on the sensor with noise.

    Args:
        seed: Seed or source of the noise.
        rate_hz: Readings per second.
        shape: Shape of a reading: (taxels,) or (taxels, 3) of an image.
        noise: Standard deviation of each value.
    """

    def __init__(
        self, seed: int | np.random.Generator, rate_hz: float, shape: tuple[int, ...], noise: float | Array
    ) -> None:
        super().__init__(rate_hz)
        self._rng = np.random.default_rng(seed)
        self._ideal = np.zeros(shape)
        self._of_sensor: dict[str, Array] = {}
        self._sigma = noise
        self._noise: list[Array] = []

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load from now on, in the units of the sensor.

        Args:
            values: The loads, of the shape of a reading.
            sensor: Name of one of several sensors with readings of this shape; None: all of them.

        Raises:
            ValueError: The shape is not that of a reading.
        """
        values = np.asarray(values, dtype=np.float64)
        if values.shape != self._ideal.shape:
            raise ValueError(f"a reading must have shape {self._ideal.shape}, got {values.shape}")
        if sensor is None:
            self._ideal = values
            self._of_sensor.clear()
        else:
            self._of_sensor[sensor] = values

    def reading(self, sensor: str = "") -> Array:
        """Return a reading of the present load on one sensor with new noise."""
        return self._of_sensor.get(sensor, self._ideal) + self.next_noise()

    def next_noise(self) -> Array:
        """Return the noise of one reading."""
        if not self._noise:
            readings = max(NOISE_BLOCK // self._ideal.size, 1)
            self._noise = [*self._sigma * self._rng.standard_normal((readings, *self._ideal.shape))][::-1]
        return self._noise.pop()


class WrenchStream(ReadingStream):
    """Readings at a rate: the wrench on the sensor, or the motion of an arm, six values with noise.

    Args:
        seed: Seed or source of the noise.
        rate_hz: Readings per second.
        noise_n: Standard deviation of each force component, N; of an arm's gravity, m/s².
        noise_nm: Standard deviation of each torque component, N·m; of an arm's angular velocity, rad/s.
    """

    def __init__(
        self, seed: int | np.random.Generator, rate_hz: float, noise_n: float = 0.02, noise_nm: float = 0.0005
    ) -> None:
        super().__init__(seed, rate_hz, (6,), np.repeat((noise_n, noise_nm), 3))


class EmulatedSensor(EmulatedDevice):
    """Base of the emulated sensors; ``stream`` has their readings. For the rest see `EmulatedDevice`."""

    def __init__(self, stream: ReadingStream, rate_hz: float, **options: Any) -> None:
        super().__init__(rate_hz, **options)
        self._stream = stream

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the frames due by then."""
        return [self._frame(taken_ns) for taken_ns in self._stream.times(t_ns)]

    def _frame(self, taken_ns: int) -> bytes:
        """Return what it sends of a reading that is taken now, at ``taken_ns``."""
        raise NotImplementedError


class EmulatedWrench(EmulatedSensor):
    """Base of the emulated force/torque sensors; its stream is a `WrenchStream`."""

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load on the sensor from now on, in the frame of the sensor, N and N·m."""
        self._stream.press(np.concatenate((force_n, torque_nm)))


class EmulatedTactile(EmulatedSensor):
    """Base of the emulated tactile sensors."""

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load on each taxel of one sensor or all from now on, of the shape of an image, in its own units."""
        self._stream.press(values, sensor)


def whole(values: Array, bits: int) -> list[int]:
    """Round values to counts, clipped to signed integers of ``bits`` bits."""
    most = (1 << bits - 1) - 1
    return [min(max(round(value), -most - 1), most) for value in values.tolist()]


def device_us(t_ns: int, clock_ppm: float) -> int:
    """Return what a clock in microseconds shows, whose rate is wrong by parts per million; positive is fast."""
    return round(t_ns * (1e-3 + clock_ppm * 1e-9))


def moved_jaws(width: float, goal: float, part: float, reach: float) -> tuple[float, bool, bool]:
    """Return the width between the jaws after a motion, whether they still move, and whether they hold the part.

    Args:
        width: Between the jaws before, in any unit of length.
        goal: Where they go.
        part: Width of the rigid part between them; 0: no part.
        reach: How far they get.
    """
    squeeze = 0.0 < part <= width and goal < part
    stop = part if squeeze else goal
    if abs(stop - width) > reach:
        return width + math.copysign(reach, stop - width), True, False
    return stop, False, squeeze
