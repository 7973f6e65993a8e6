"""Interface of a device: decoder, session, health, and the description by which slipd knows it.

`slipd.devices` exports all of it. A device of another package states the version `INTERFACE` that it was written for.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from inspect import Parameter
from typing import TYPE_CHECKING, Literal, Protocol, runtime_checkable

if TYPE_CHECKING:
    from slipd.types.samples import Sample


INTERFACE = 1
"""Version of this interface. It rises when a device written for the version before would no longer work."""

Evidence = Literal["hardware", "maker", "capture", "driver", "document", "own"]

EVIDENCE: dict[Evidence, str] = {
    "hardware": "tried on the device",
    "maker": "maker's driver",
    "capture": "capture of a device",
    "driver": "driver of its users",
    "document": "document only",
    "own": "slipd's own format",
}
"""What a decoder was compared with, the strongest first."""


@runtime_checkable
class Decoder(Protocol):
    """Convert a device's bytes to samples, however the stream is split; count bad bytes, and never raise for them."""

    health: DecoderHealth

    def receive(self, data: bytes, t_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``t_ns``; return the readings they complete."""

    def forget(self) -> None:
        """Drop a partial frame and any expectation of what follows, because the line was closed."""


@runtime_checkable
class Session(Protocol):
    """Protocol session with a device that needs requests; it owns the decoder of the answers.

    The caller sends the bytes that `start`, `on_time` and `stop` return, and calls `on_time` when `next_deadline` is
    reached; at once if a call to `receive` or a command brings the deadline forward.
    """

    health: DecoderHealth

    @property
    def state(self) -> str:
        """State of the session, as a short text for people."""

    @property
    def identity(self) -> str:
        """Identity that the device reports, such as its serial number; "" if it reports none, or none yet."""

    def start(self, now_ns: int) -> bytes:
        """Begin, on a freshly opened link."""

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None for never."""

    def on_time(self, now_ns: int) -> bytes:
        """Return the bytes that are due to be sent at ``now_ns``; empty if there are none."""

    def stop(self) -> bytes:
        """End; return the last bytes to send."""


@dataclass(frozen=True, slots=True)
class Inquiry:
    """Request to a device over TCP before its stream is opened.

    Attributes:
        port: TCP port of the device's host.
        request: Bytes to send.
        reply_bytes: Length of the answer; 0 if it ends with the connection.
        check: ``check(answer)`` returns what is wrong with a complete answer, "" if nothing is. After a wrong answer
            the request is repeated.
        change: ``change(answer)`` returns a request that changes a setting of the device, b"" if none is needed. Its
            reply, which ends with the connection, is not read: the inquiry is repeated, and shows whether the device
            obeyed.
    """

    port: int
    request: bytes
    reply_bytes: int
    check: Callable[[bytes], str] = lambda _: ""
    change: Callable[[bytes], bytes] = lambda _: b""


@dataclass(frozen=True, slots=True)
class GripRange:
    """Maximum range of the grippers of one device, from the data sheets of the largest models.

    Attributes:
        force_n: Force, N on one pad.
        stroke_m: Change of the width between the pads, m.
        speed_mps: Speed of the jaws, m/s.
    """

    force_n: float
    stroke_m: float
    speed_mps: float


@dataclass(frozen=True, slots=True)
class Need:
    """Value that the device does not report, so that a person must measure it or look it up.

    Attributes:
        key: Key of the stream's table; an option of the device begins with "options.".
        guess: Value in a first config, as TOML; "" where none makes sense, so that the key is only a comment there.
        how: How it is measured, or where it is stated, and what is wrong until it is.
        transports: Transports for which it is needed; empty: all.
        scales: Whether the readings are in another unit than newtons until it is right.
    """

    key: str
    guess: str
    how: str
    transports: tuple[str, ...] = ()
    scales: bool = False


@dataclass(frozen=True, slots=True)
class RateOption:
    """Option of a device that sets the rate of its readings.

    Attributes:
        name: Its name.
        product: Rate times value of the option, Hz, where the option is a period or a length; None: it is the rate, and
            0 leaves the device as it is set.
    """

    name: str
    product: float | None = None

    def convert(self, value: float) -> float:
        """Return the rate that a value of the option sets, Hz; or, of a rate, the value that sets it; inf for 0."""
        if self.product is None:
            return value
        return self.product / value if value else math.inf


@dataclass(frozen=True)
class Device:
    """Description of a supported device, the ``DEVICE`` of its module.

    Attributes:
        name: Name in a config, and of the module.
        kind: Kind of its samples.
        transports: Possible transports: "serial", "tcp", "udp", "websocket", "external" or "local".
        decoder: Makes a decoder from the device's options.
        session: Makes a session from the device's options; None if the device sends without requests.
        rates_hz: Lowest and highest rate of its readings or images, 1/s.
        baud: Default speed of a serial port, bit/s; None if the device has none. All serial lines are 8N1.
        frame_bytes: Bytes per reading on a UART, if ``baud`` limits the rate; 0 if it does not, as over USB.
        axes: Number of components that a taxel measures: 1 or 3; 0 for devices without taxels.
        measures_newtons: Whether its taxels measure newtons, so that ``axis_scale`` only reverses axes.
        needs_size: Whether the decoder needs the pad's ``rows`` and ``cols``.
        needs_wiring: Whether the decoder needs the option ``wiring``, because its bytes depend on the transport.
        taxels: Number of taxels of each pad; None if pads differ.
        shared: Whether one port carries several sensors, distinguished by the ``source`` of their samples.
        sensors: Names of those sensors; empty if they are not known beforehand.
        needs_tables: Whether the gripper has its own units, so that the session needs ``force_table``, ``width_table``
            and ``speed_table`` (None if the speed cannot be set).
        clock_span_ns: Time after which the device's clock wraps, ns; None if it never does, or there is no clock.
        host_clock: Whether the device's clock is the host's own CLOCK_MONOTONIC.
        grip: Range of a gripper; None for other devices, and if the gripper reports it.
        inquiry: Returns for the device's options the request to send over TCP first; its answer is the first data on
            the link. None if there is never one.
        needs: What a config must state, because the device does not report it.
        rate_option: Option that sets the rate of its readings; None if none does.
        rate_hint: How to set the rate on the device itself, where slipd need not set it; "" if it does.
        frame: What the device sends, for people and with an article, such as "a Bota frame".
        evidence: What the decoder was compared with, see `EVIDENCE`.
        emulator: Module of a device package whose ``make(seed, **settings)`` returns an emulator; "" where none does.
        about: Description for ``slipd devices NAME``, Markdown: wiring, a config, what is not confirmed.
        interface: Version of this interface that a device of another package was written for, see `INTERFACE`.
    """

    name: str
    kind: Literal["wrench", "tactile", "gripper", "any"]
    transports: tuple[str, ...]
    decoder: Callable[..., Decoder]
    session: Callable[..., Session] | None = None
    rates_hz: tuple[float, float] = (1e-3, 1e6)
    baud: int | None = None
    frame_bytes: int = 0
    axes: int = 0
    measures_newtons: bool = False
    needs_size: bool = False
    needs_wiring: bool = False
    taxels: int | None = None
    shared: bool = False
    sensors: tuple[str, ...] = ()
    needs_tables: bool = False
    clock_span_ns: int | None = None
    host_clock: bool = False
    grip: GripRange | None = None
    inquiry: Callable[..., Inquiry | None] | None = None
    needs: tuple[Need, ...] = ()
    rate_option: RateOption | None = None
    rate_hint: str = ""
    frame: str = "a frame of this device"
    evidence: Evidence = "document"
    emulator: str = ""
    about: str = ""
    interface: int | None = None

    def parameters(self) -> dict[str, Parameter]:
        """Return the parameters of the session, and those that it hands on to the decoder; without one, of this."""
        found = dict(inspect.signature(self.session or self.decoder).parameters)
        if any(each.kind is Parameter.VAR_KEYWORD for each in found.values()):
            found = found | dict(inspect.signature(self.decoder).parameters) | found  # those of the session first
        return {name: each for name, each in found.items() if each.kind is not Parameter.VAR_KEYWORD}


@dataclass(slots=True)
class DecoderHealth:
    """Counts and findings of a decoder since it was made; the counters only rise.

    Attributes:
        good: Readings returned.
        bad: Invalid stream, in frames.
        lost: Readings that are missing according to the device's own sequence numbers.
        bad_bytes: Bytes that belong to no valid frame.
        duplicates: Readings that were repeated, or came after a newer one; they are dropped.
        restarts: Times that the device's own sequence numbers started again.
        note: For people: how the bytes are interpreted, or why they give no readings; "" if there is nothing to say.
        warning: What is wrong with the device although its readings count; "" if nothing is.
        temperature_c: Temperature that the sensor reported last, °C; None if it reports none.
    """

    good: int = 0
    bad: int = 0
    lost: int = 0
    bad_bytes: int = 0
    duplicates: int = 0
    restarts: int = 0
    note: str = ""
    warning: str = ""
    temperature_c: float | None = None


def check_integer(name: str, value: object, least: int, most: int) -> None:
    """Check an option of a decoder or session.

    Raises:
        ValueError: It is not an integer, or out of bounds.
    """
    if not (isinstance(value, int) and least <= value <= most):
        raise ValueError(f"{name} must be an integer from {least} to {most}, got {value!r}")


def check_choice(name: str, value: object, known: Collection[object]) -> None:
    """Check an option of a decoder or session that has few values.

    Raises:
        ValueError: The value is not one of the choices.
    """
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, got {value!r}")
