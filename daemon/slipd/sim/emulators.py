"""The emulated devices by name: each is the device's end of its line, with the world and the time told to it."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol


class Emulator(Protocol):
    """A device seen from its line. It knows no line: what it says comes in the pieces in which it would be sent.

    A force/torque sensor also has ``feel(force_n, torque_nm)``: what it measures from now on, in its own frame, N and
    N·m. A tactile sensor has ``press(values)``: shape (taxels,) or (taxels, 3), in its own units.

    Attributes:
        options: Of the decoder or session that understands it.
        rate_hz: Readings that it sends each second when it runs.
    """

    options: dict[str, Any]
    rate_hz: float

    def opened(self, t_ns: int) -> None:
        """Somebody opened the line at ``t_ns``, ns since the emulator was made."""
        ...

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Take what the host wrote; return the answers."""
        ...

    def advance(self, t_ns: int) -> list[bytes]:
        """Go on to ``t_ns`` and return what is said unasked until then, one frame, message or datagram each."""
        ...


def make_emulator(device: str, seed: int = 0, **options: Any) -> Emulator:
    """Makes the emulator of a device, which ``slipd.sim.emulated_<device>`` defines.

    Args:
        device: Its name in the list of devices.
        seed: Of its noise.
        options: What else its ``make`` takes, e.g. the ``wiring`` of a device that speaks otherwise on another line.
    """
    emulator: Emulator = import_module(f"slipd.sim.emulated_{device}").make(seed, **options)
    return emulator
