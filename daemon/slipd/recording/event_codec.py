"""Encode an event of the engine as a msgpack map, and decode it without loss.

The map is ``{n, t_ns, kind, …the fields of the event…, crc32}``. ``crc32`` is the last entry and has a fixed width, so
the last four bytes of a payload are the CRC-32 of all bytes before them (big-endian). It is checked before anything
else is decoded.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from operator import itemgetter
from typing import Any

import msgpack

from slipd.errors import RecordingError
from slipd.events import (
    Bytes,
    Event,
    HostNotice,
    IncidentsChanged,
    LinkDown,
    LinkUp,
    RecordingChanged,
    Request,
    StateRestored,
    Tick,
)
from slipd_client import messages

_CRC_BYTES = 4
_NO_CRC = bytes(_CRC_BYTES)
_NUMBER_LIMIT = 2**63  # the engine computes with int64


class _Form:
    """The map of one kind of event.

    Args:
        event_type: Type of the event.
        omitted: Fields that a map may lack, with their values then; an event with these values is written without them.
        fields: Type of each field of the event.

    Attributes:
        names: Names of all entries of a map, in their order, for people.
        values: Returns the values of a map in this order.
        types: Their types.
        numbers: Places of the numbers among them.
    """

    def __init__(self, event_type: type[Event], omitted: dict[str, Any], **fields: type) -> None:
        types = {"n": int, "t_ns": int, "kind": str, **fields, "crc32": bytes}
        self.event_type: Callable[..., Event] = event_type
        self.omitted = omitted
        self.fields = tuple(fields)
        self.names = ", ".join(types)
        self.values: Callable[[dict[str, Any]], tuple[Any, ...]] = itemgetter(*types)
        self.types = tuple(types.values())
        self.numbers = [place for place, held in enumerate(self.types) if held is int]


_OF_TICK = {"unread": False, "raw_ns": 0, "wall_minus_monotonic_ns": 0}  # older recordings lack them
_FORMS = {
    "bytes": _Form(Bytes, {}, link=str, data=bytes),
    "link_up": _Form(LinkUp, {}, link=str, identity=str),
    "link_down": _Form(LinkDown, {}, link=str, reason=str),
    "request": _Form(Request, {}, client=bytes, body=dict),
    "tick": _Form(Tick, _OF_TICK, suspended_ns=int, unread=bool, raw_ns=int, wall_minus_monotonic_ns=int),
    "recording": _Form(RecordingChanged, {}, name=str, path=str, state=str, reason=str, lost=int),
    "incidents": _Form(IncidentsChanged, {}, saved=int, failed=int, lost=int, dropped=int, path=str, reason=str),
    "notice": _Form(HostNotice, {}, topic=str, text=str),
    "restored": _Form(StateRestored, {}, text=str, problem=str),
}
_KINDS = {form.event_type: kind for kind, form in _FORMS.items()}
_UNICODE_ERRORS = "surrogatepass"  # an error text of the system may contain undecodable bytes of a file name


def encode_event(n: int, t_ns: int, event: Event) -> bytes:
    """Return the payload of one event.

    Args:
        n: Running index of the entry in its recording.
        t_ns: CLOCK_MONOTONIC with which the event entered the engine.
        event: The event; the body of a request must be one that ``slipd_client.messages`` can encode.
    """
    kind = _KINDS[type(event)]
    form = _FORMS[kind]
    whole: dict[str, Any] = {"n": n, "t_ns": t_ns, "kind": kind}
    for name in form.fields:
        whole[name] = getattr(event, name)
    for name, value in form.omitted.items():
        if whole[name] == value:
            del whole[name]
    whole["crc32"] = _NO_CRC
    body: bytes = msgpack.packb(whole, unicode_errors=_UNICODE_ERRORS)[:-_CRC_BYTES]
    return body + _crc(body)


def decode_event(payload: bytes) -> tuple[int, int, Event]:
    """Return ``(n, t_ns, event)`` of a payload.

    Raises:
        RecordingError: The payload is damaged, or not an event that this version knows.
    """
    if _crc(payload[:-_CRC_BYTES]) != payload[-_CRC_BYTES:]:
        raise RecordingError("an event's checksum does not match its bytes")
    whole = _unpack(payload)
    kind = whole.get("kind")
    if not isinstance(kind, str) or kind not in _FORMS:
        raise RecordingError(f"the kind of an event must be one of {', '.join(_FORMS)}, got {kind!r:.40}")
    form = _FORMS[kind]
    if form.omitted:
        whole = form.omitted | whole
    try:
        values = form.values(whole)
    except KeyError:
        values = ()
    if len(values) != len(whole) or tuple(map(type, values)) != form.types:
        raise RecordingError(f"an event of kind {kind!r} must have the fields {form.names}")
    for place in form.numbers:
        if not 0 <= values[place] < _NUMBER_LIMIT:
            raise RecordingError(f"the numbers of an event of kind {kind!r} must be from 0 to 2**63 - 1")
    n, t_ns, _, *fields, _ = values
    event = form.event_type(*fields)
    return n, t_ns, _checked(event) if isinstance(event, Request) else event


def _crc(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(_CRC_BYTES, "big")


def _checked(request: Request) -> Request:
    """Check a recorded request as strictly as one from a socket."""
    try:
        data = msgpack.packb(request.body)
        return Request(request.client, messages.decode(data, messages.request_limits(data)))
    except (TypeError, ValueError) as error:
        raise RecordingError(f"a recorded request is not valid: {error}") from error


def _unpack(payload: bytes) -> dict[Any, Any]:
    try:
        whole = msgpack.unpackb(payload, unicode_errors=_UNICODE_ERRORS)
    except (ValueError, msgpack.UnpackException) as error:
        raise RecordingError(f"an event is not msgpack: {error}") from error
    if not isinstance(whole, dict):
        raise RecordingError(f"an event must be a map, got {type(whole).__name__}")
    return whole
