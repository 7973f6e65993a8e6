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
    identity: str
    """What the device says it is, e.g. its serial number; "" where it does not, or has not yet."""

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


@dataclass(frozen=True, slots=True)
class Inquiry:
    """A question that is put to a device over TCP before its stream is opened.

    Attributes:
        port: TCP port of the device's host.
        request: Bytes to send.
        reply_bytes: Length of the answer; 0 where it ends with the connection.
    """

    port: int
    request: bytes
    reply_bytes: int


@dataclass(frozen=True)
class Device:
    """A supported device.

    Attributes:
        name: Its name in a config, and of its module.
        kind: What its samples are.
        transports: How its bytes may travel: "serial", "tcp", "udp", "websocket" or "external".
        baud: Default line speed of a serial port, bit/s; None for devices that have none. All lines are 8N1.
        axes: Components a taxel measures: 1 or 3; 0 for devices without taxels.
        sized: The decoder must be told the pad's ``rows`` and ``cols``.
        wired: The decoder must be told how its bytes travel (option ``wiring``): they differ.
        shared: One port carries several sensors, told apart by the ``source`` of their samples.
        clock_span_ns: The device's clock begins anew after so long, ns; None where it never does, or has none.
        host_clock: The device's clock is the host's own CLOCK_MONOTONIC.
        decoder: Makes a decoder from the device's options.
        session: Makes a session from the device's options; None where the device speaks unasked.
        inquiry: Makes of the options what is asked over TCP first; the answer is the link's first bytes. None where
            nothing is ever asked.
    """

    name: str
    kind: Literal["wrench", "tactile", "gripper", "any"]
    transports: tuple[str, ...]
    baud: int | None
    axes: int
    sized: bool
    wired: bool
    shared: bool
    clock_span_ns: int | None
    host_clock: bool
    decoder: Callable[..., Decoder]
    session: Callable[..., Session] | None
    inquiry: Callable[..., Inquiry | None] | None


def _make(module: str, what: str, **options: Any) -> Any:
    return getattr(import_module(f"slipd.devices.{module}"), what)(**options)


def _device(
    name: str,
    kind: Literal["wrench", "tactile", "gripper", "any"],
    *transports: str,
    baud: int | None = None,
    axes: int = 0,
    sized: bool = False,
    wired: bool = False,
    shared: bool = False,
    clock_span_ns: int | None = None,
    host_clock: bool = False,
    session: bool = False,
    inquiry: bool = False,
) -> Device:
    return Device(
        name=name,
        kind=kind,
        transports=transports,
        baud=baud,
        axes=axes,
        sized=sized,
        wired=wired,
        shared=shared,
        clock_span_ns=clock_span_ns,
        host_clock=host_clock,
        decoder=partial(_make, name, "Decoder"),
        session=partial(_make, name, "Session") if session else None,
        inquiry=partial(_make, name, "inquiry") if inquiry else None,
    )


_US_32 = (1 << 32) * 1_000
_MS_32 = (1 << 32) * 1_000_000

DEVICES: dict[str, Device] = {
    device.name: device
    for device in (
        _device("bota", "wrench", "serial", baud=460_800, clock_span_ns=_US_32, session=True),
        _device("netft", "wrench", "udp", session=True, inquiry=True),
        _device("optoforce", "wrench", "serial", "udp", baud=1_000_000, wired=True, session=True),
        _device("robotous", "wrench", "serial", baud=115_200, session=True),
        _device("gauges", "wrench", "serial", baud=921_600, clock_span_ns=_US_32),
        _device("pvdf", "tactile", "serial", baud=921_600, axes=1, sized=True, clock_span_ns=_US_32),
        _device(
            "dsacon32",
            "tactile",
            "serial",
            "tcp",
            baud=115_200,
            axes=1,
            shared=True,
            clock_span_ns=_MS_32,
            session=True,
        ),
        _device("wts", "tactile", "serial", baud=115_200, axes=1, clock_span_ns=_MS_32, session=True),
        _device("tsf85", "tactile", "serial", baud=115_200, axes=1, shared=True, session=True),
        _device("xela", "tactile", "websocket", axes=3, shared=True),
        _device("papillarray", "tactile", "serial", baud=115_200, axes=3, shared=True, session=True),
        _device("external", "any", "external", shared=True, host_clock=True),
        _device("robotiq_2f", "gripper", "serial", baud=115_200, session=True),
    )
}
