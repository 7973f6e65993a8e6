"""One file or folder per device: bytes to samples, permits to bytes; pure.

`DEVICES` holds them all by name. A device is what a module of this folder says in ``DEVICE``; it is loaded when
somebody asks for it (docs/adding_a_device.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Literal, Protocol, cast

if TYPE_CHECKING:
    from slipd.devices.health import DecoderHealth
    from slipd.permit import Permit
    from slipd.samples import Sample


class Decoder(Protocol):
    """Makes samples of a device's bytes, however the stream is split; bad bytes are counted, never raised."""

    health: DecoderHealth

    def receive(self, data: bytes, t_ns: int) -> Sequence[Sample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        ...

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        ...


class Session(Protocol):
    """The conversation with a device that must be spoken to; it owns the decoder of the answers.

    Whoever drives it writes what `start`, `on_time` and `stop` return, and calls `on_time` when `next_deadline`
    has come, at once where a call to `receive` or a command has made it come.
    """

    health: DecoderHealth

    @property
    def state(self) -> str:
        """A short word for people: where the conversation stands."""
        ...

    @property
    def identity(self) -> str:
        """What the device says it is, e.g. its serial number; "" where it does not, or has not yet."""
        ...

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


class GripperSession(Session, Protocol):
    """The conversation with a gripper, in metres between the pads and newtons on one pad.

    Nothing moves but on a permit, and a permit that the gripper cannot take sends nothing. What a session takes in
    which state is a table, in a module of its own beside it.
    """

    @property
    def activating(self) -> bool:
        """Whether an activation is queued or under way; until it is over no move and no force is accepted."""
        ...

    @property
    def command_lost(self) -> bool:
        """Whether the gripper refused the last command, or never acknowledged it."""
        ...

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Least and largest width between the pads; (0, inf) until the gripper reports them."""
        ...

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Least and largest speed; None where no speed can be asked for."""
        ...

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Least and largest force; (0, inf) until the gripper reports them."""
        ...

    @property
    def force_sent_n(self) -> float | None:
        """The force in force once all that waits is sent; None where none was sent since the gripper became active."""
        ...

    def applied_n(self, force_n: float) -> float:
        """Return the force that would be sent for ``force_n``: the gripper's settings may be steps."""
        ...

    def execute(self, permit: Permit, now_ns: int) -> bool:
        """Carry out a permit: the only way to make the gripper do something.

        - "activate" makes the gripper ready; some open and close fully while they do this. All that waits is dropped.
        - "move" sends the fingers to a width, with a force and a speed (None: the session's own).
        - "set_force" changes the force at the width last sent; a move that was not sent yet goes with that force.
        - "halt" stops the fingers where they are, before all else. A move or an activation that was not sent yet is
          dropped; a force that was not sent yet may still be.

        Args:
            permit: What the motion gate permits.
            now_ns: Time of the call.

        Returns:
            True where the permit is taken: something will be sent, or, for "halt", something unsent was dropped.
            `force_sent_n` is then the force that will be in force, never above ``permit.force_n`` but for the
            gripper's least. False: nothing will be sent, because the gripper is not active, or not known to be, or
            reports a fault, or is activating.

        Raises:
            ValueError: The gripper has no such width or speed, or a value is missing or not finite.
        """
        ...

    def drop(self) -> bool:
        """Drop what is not sent yet, except a stop; return whether there was anything.

        What was sent and is not answered stays, but is not repeated.
        """
        ...

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge the fault to the gripper; moves nothing."""
        ...


@dataclass(frozen=True, slots=True)
class Inquiry:
    """A question that is put to a device over TCP before its stream is opened.

    Attributes:
        port: TCP port of the device's host.
        request: Bytes to send.
        reply_bytes: Length of the answer; 0 where it ends with the connection.
        check: ``check(answer)`` returns what is wrong with a whole answer, "" for nothing. After a wrong one the
            question is put again.
    """

    port: int
    request: bytes
    reply_bytes: int
    check: Callable[[bytes], str] = lambda _: ""


@dataclass(frozen=True, slots=True)
class GripRange:
    """The most that the grippers behind one device can do, from the data sheets of the largest models.

    Attributes:
        force_n: Force, N on one pad.
        stroke_m: Change of the width between the pads, m.
        speed_mps: Speed of the jaws, m/s.
    """

    force_n: float
    stroke_m: float
    speed_mps: float


@dataclass(frozen=True)
class Device:
    """A supported device, as its module's ``DEVICE`` says.

    Attributes:
        name: Its name in a config, and of its module.
        kind: What its samples are.
        transports: How its bytes may travel: "serial", "tcp", "udp", "websocket", "external" or "local".
        decoder: Makes a decoder from the device's options.
        session: Makes a session from the device's options; None where the device speaks unasked.
        rates_hz: Lowest and highest rate of its readings, or of its images, 1/s.
        baud: Default line speed of a serial port, bit/s; None for devices that have none. All lines are 8N1.
        frame_bytes: Bytes of one reading on a UART, where ``baud`` limits the rate; 0: it does not, as over USB.
        axes: Components a taxel measures: 1 or 3; 0 for devices without taxels.
        newtons: Its taxels measure newtons by themselves: ``axis_scale`` turns axes and no more.
        sized: The decoder must be told the pad's ``rows`` and ``cols``.
        wired: The decoder must be told how its bytes travel (option ``wiring``): they differ.
        taxels: Of each of its pads; None where pads differ.
        shared: One port carries several sensors, told apart by the ``source`` of their samples.
        sensors: Names of those sensors; empty where they are not known beforehand.
        tabled: A gripper with units of its own: the session must be told ``force_table``, ``width_table`` and
            ``speed_table`` (None where there is none).
        clock_span_ns: The device's clock begins anew after so long, ns; None where it never does, or has none.
        host_clock: The device's clock is the host's own CLOCK_MONOTONIC.
        grip: The most that a gripper of this kind can do; None for other devices, and if it reports that itself.
        inquiry: Makes of the options what is asked over TCP first; the answer is the link's first bytes. None where
            nothing is ever asked.
        frame: What it sends, for people and with an article, such as "a Bota frame".
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
    newtons: bool = False
    sized: bool = False
    wired: bool = False
    taxels: int | None = None
    shared: bool = False
    sensors: tuple[str, ...] = ()
    tabled: bool = False
    clock_span_ns: int | None = None
    host_clock: bool = False
    grip: GripRange | None = None
    inquiry: Callable[..., Inquiry | None] | None = None
    frame: str = "a frame of this device"


class _Devices(Mapping[str, Device]):
    """The devices of this folder by name; asking for one loads that one alone, listing them loads all."""

    def __getitem__(self, name: str) -> Device:
        if name not in self._modules():
            raise KeyError(name)
        device = getattr(import_module(f"slipd.devices.{name}"), "DEVICE", None)
        if device is None:  # a file that the devices share
            raise KeyError(name)
        return cast("Device", device)

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._modules() if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @staticmethod
    @cache
    def _modules() -> tuple[str, ...]:
        return tuple(sorted(module.name for module in iter_modules(__path__)))


DEVICES: Mapping[str, Device] = _Devices()
