"""Messages between the daemon and an external driver of the gripper: msgpack maps, version 1 of the format.

The driver registers, reports, and answers set-points; the daemon sends set-points. docs/devices.md describes the
format. A value that is not finite, or beyond any gripper's range, makes the whole message invalid.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from typing import Annotated, ClassVar, Literal

import msgpack
from pydantic import AfterValidator, ConfigDict, Field, Strict, TypeAdapter

from slipd.devices.shared.frame_scanner import FrameDecoder, MessageScanner
from slipd.devices.shared.msgpack_messages import MessageReader, read_message
from slipd.types.samples import GripperSample

VERSION = 1

MAX_MESSAGE = 512
"""Longest message, bytes; a report with all fields fills 250."""

MAX_WIDTH_M = 2.0
MAX_SPEED_MPS = 10.0
MAX_FORCE_N = 10_000.0
"""No gripper is wider, faster or stronger; larger values are mistakes in units."""

LAST_ID = (1 << 63) - 1

REGISTERED, REFUSED = "registered", "refused"


def _rising(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError("a range must rise")
    return ends


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("a text must be printable")
    return text


Metres = Annotated[float, Strict(), Field(ge=0.0, le=MAX_WIDTH_M)]
Newtons = Annotated[float, Strict(), Field(ge=0.0, le=MAX_FORCE_N)]
Speed = Annotated[float, Strict(), Field(ge=0.0, le=MAX_SPEED_MPS)]
Flag = Annotated[bool, Strict()]
Rising = AfterValidator(_rising)

_CHECKED = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class Registration:
    """Name of a driver and ranges of its gripper."""

    __pydantic_config__: ClassVar = _CHECKED

    name: Annotated[str, Strict(), Field(pattern=r"^[A-Za-z0-9_./ -]+$")]
    width_range_m: Annotated[tuple[Metres, Metres], Rising]
    force_range_n: Annotated[tuple[Newtons, Newtons], Rising]
    speed_range_mps: Annotated[tuple[Speed, Speed], Rising] | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """State of the gripper, sent regularly and as the answer to a set-point."""

    __pydantic_config__: ClassVar = _CHECKED

    width_m: Metres | None
    active: Flag = True
    moving: Flag = False
    object: Literal["none", "moving", "contact_opening", "contact_closing"] = "none"
    fault: Annotated[str, Strict(), Field(pattern=r"^([a-z][a-z0-9_]*)?$")] = ""
    force_n: Annotated[float, Strict(), Field(ge=-MAX_FORCE_N, le=MAX_FORCE_N)] | None = None
    id: Annotated[int, Strict(), Field(ge=1, le=LAST_ID)] | None = None
    applied_n: Newtons | None = None
    error: Annotated[str, Strict(), AfterValidator(_printable)] = ""


@dataclass(frozen=True, slots=True)
class Foreign:
    """A message of another version of the format."""

    version: int


Message = Registration | Report | Foreign

_REGISTRATIONS, _REPORTS = TypeAdapter(Registration), TypeAdapter(Report)
_KEYS = ("v", *(field.name for kind in (Registration, Report) for field in fields(kind)))
_READ_VALUES = dict.fromkeys(_KEYS, MessageReader.value)


def _parse(reader: MessageReader) -> Message:
    """Return the content of a message; raise ValueError if a value is impossible."""
    body = reader.fields(_READ_VALUES)
    version = body.pop("v", None)
    if type(version) is not int:
        raise ValueError("no version")
    if version != VERSION:
        return Foreign(version)
    if "width_m" not in body:
        return _REGISTRATIONS.validate_python(body)
    return _REPORTS.validate_python({"object": "moving" if body.get("moving") else "none"} | body)


def read(buffer: bytes, at: int) -> tuple[int, Message | None]:
    """Return length and content of the message at ``at``, see `read_message`."""
    return read_message(buffer, at, MAX_MESSAGE, _parse)


def encode_setpoint(setpoint_id: int, operation: str, **values: float | None) -> bytes:
    """Return a set-point.

    Args:
        setpoint_id: Its id, from 1.
        operation: "activate", "move", "force", "stop" or "acknowledge".
        values: Its values, in SI units.
    """
    return bytes(msgpack.packb({"v": VERSION, "id": setpoint_id, "op": operation, **values}))


def encode_notice(key: str, text: str) -> bytes:
    """Return the daemon's notice to a driver.

    Args:
        key: `REGISTERED` or `REFUSED`.
        text: The name that registered, or the reason of the refusal.
    """
    return bytes(msgpack.packb({"v": VERSION, key: text}))


_BEGIN = re.compile(rb"[\x82-\x8a](?:[\xa1-\xaf](?:[a-z]|\Z)|\Z)")  # a map of 2 to 10 fields, and a key


class Decoder(FrameDecoder):
    """Return a gripper sample of every report; `Session` sets its ``echo_ok``, because it knows the requests.

    Bytes outside messages are `bad_bytes`, and each stretch of them is one `bad`; so is a message with an unknown key,
    a value of the wrong type, or a number that is not finite or beyond any gripper's range.
    """

    _frames: MessageScanner[Message]

    def __init__(self) -> None:
        super().__init__()
        self._frames = MessageScanner(_BEGIN, read, self.health)

    def _readings(self, data: bytes, t_ns: int) -> list[GripperSample]:
        return [sample(message, t_ns) for message in self.messages(data) if isinstance(message, Report)]

    def messages(self, data: bytes) -> list[Message]:
        """Decode bytes; return every message they complete."""
        return self._frames.messages(data)


def sample(report: Report, t_ns: int) -> GripperSample:
    """Return the reading of a report received at ``t_ns``."""
    return GripperSample(
        t_ns=t_ns,
        device_time_ns=None,
        active=report.active,
        width_m=report.width_m,
        moving=report.moving,
        object=report.object,
        fault=report.fault,
        echo_ok=None,
        force_n=report.force_n,
    )
