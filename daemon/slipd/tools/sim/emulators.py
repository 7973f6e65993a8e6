"""The emulated devices by name; the caller of an emulator passes the time and the load."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any, Protocol

from slipd.devices import DEVICES


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
        ...

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; return the answers."""
        ...

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the pieces that the device sends unasked: frames, messages or datagrams."""
        ...


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
