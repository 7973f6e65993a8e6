"""One file a device: bytes in, samples out, and back; pure.

`DEVICES` names them all. A device's module is imported when its first decoder or session is made, so that a
config can be judged without loading any of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    from slipd.devices.health import DecoderHealth
    from slipd.samples import Sample


class Decoder(Protocol):
    """Makes samples of a device's bytes, however the stream is split; bad bytes are counted, never raised."""

    health: DecoderHealth

    def receive(self, data: bytes, t_ns: int) -> Sequence[Sample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        ...


class Session(Protocol):
    """The conversation with a device that must be spoken to; it owns the decoder of the answers.

    Whoever drives it writes what `start`, `on_time` and `stop` return, and calls `on_time` when `next_deadline`
    has come, at once where a call to `receive` or a command has made it come.
    """

    health: DecoderHealth
    state: str

    def start(self, now_ns: int) -> bytes:
        """Begin, on a freshly opened link."""
        ...

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        ...

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None for never."""
        ...

    def on_time(self, now_ns: int) -> bytes:
        """Return what is due to be written at ``now_ns``; empty when nothing is."""
        ...

    def stop(self) -> bytes:
        """End, and return the last bytes to be written."""
        ...


@dataclass(frozen=True)
class Device:
    """A supported device.

    Attributes:
        name: Its name in a config, and of its module.
        kind: What its samples are.
        transport: How its bytes travel.
        baud: Default line speed of a serial port, bit/s; None for others. All lines are 8N1.
        axes: Components a taxel measures: 1 or 3; 0 for devices without taxels.
        decoder: Makes a decoder from the device's options.
        session: Makes a session from the device's options; None where the device speaks unasked.
    """

    name: str
    kind: Literal["wrench", "tactile", "gripper"]
    transport: Literal["serial", "websocket"]
    baud: int | None
    axes: int
    decoder: Callable[..., Decoder]
    session: Callable[..., Session] | None


def _make(module: str, what: str, **options: Any) -> Any:
    return getattr(import_module(f"slipd.devices.{module}"), what)(**options)


def _device(
    name: str,
    kind: Literal["wrench", "tactile", "gripper"],
    *,
    baud: int | None,
    axes: int = 0,
    session: bool = False,
) -> Device:
    return Device(
        name=name,
        kind=kind,
        transport="websocket" if baud is None else "serial",
        baud=baud,
        axes=axes,
        decoder=partial(_make, name, "Decoder"),
        session=partial(_make, name, "Session") if session else None,
    )


DEVICES: dict[str, Device] = {
    device.name: device
    for device in (
        _device("bota", "wrench", baud=460_800, session=True),
        _device("pvdf", "tactile", baud=921_600, axes=1),
        _device("xela", "tactile", baud=None, axes=3),
        _device("robotiq_2f", "gripper", baud=115_200, session=True),
    )
}
