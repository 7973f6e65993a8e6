"""Encode an event of the engine as a msgpack map, and decode it without loss.

The map is ``{n, t_ns, kind, …the fields of the event…, crc32}``. ``crc32`` is the last entry and has a fixed width, so
the last four bytes of a payload are the CRC-32 of all bytes before them (big-endian). It is checked before anything
else is decoded.
"""

from __future__ import annotations

import threading
import zlib
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
_INTEGERS = range(2**63)  # what fits in int64, with which the engine computes
_FIELDS: dict[str, tuple[type[Event], dict[str, type]]] = {
    "bytes": (Bytes, {"link": str, "data": bytes}),
    "link_up": (LinkUp, {"link": str, "identity": str}),
    "link_down": (LinkDown, {"link": str, "reason": str}),
    "request": (Request, {"client": bytes, "body": dict}),
    "tick": (Tick, {"suspended_ns": int}),
    "recording": (RecordingChanged, {"name": str, "path": str, "state": str, "reason": str, "lost": int}),
    "incidents": (
        IncidentsChanged,
        {"saved": int, "failed": int, "lost": int, "dropped": int, "path": str, "reason": str},
    ),
    "notice": (HostNotice, {"topic": str, "text": str}),
    "restored": (StateRestored, {"text": str, "problem": str}),
    "recording_failed": (RecordingChanged, {"name": str, "reason": str}),  # in recordings of version 0.1
}
_OPTIONAL: dict[str, dict[str, type]] = {
    "tick": {"unread": bool, "raw_ns": int, "wall_minus_monotonic_ns": int}
}  # omitted if false or 0, as in older recordings
_KINDS = {event_type: kind for kind, (event_type, _) in reversed(_FIELDS.items())}
_EXPECTED = {
    kind: {"n": int, "t_ns": int, "kind": str, **types, "crc32": bytes} for kind, (_, types) in _FIELDS.items()
}
_UNICODE_ERRORS = "surrogatepass"  # an error text of the system may contain undecodable bytes of a file name


class _Packing(threading.local):
    """A packer of each thread, because making one takes longer than packing, and threads must not share one."""

    def __init__(self) -> None:
        self.packer = msgpack.Packer(unicode_errors=_UNICODE_ERRORS)


_PACKING = _Packing()


def encode_event(n: int, t_ns: int, event: Event) -> bytes:
    """Return the payload of one event.

    Args:
        n: Running index of the entry in its recording.
        t_ns: CLOCK_MONOTONIC with which the event entered the engine.
        event: The event; the body of a request must be one that ``slipd_client.messages`` can encode.
    """
    kind = _KINDS[type(event)]
    whole: dict[str, Any] = {"n": n, "t_ns": t_ns, "kind": kind}
    for name in _FIELDS[kind][1]:
        whole[name] = getattr(event, name)
    if kind in _OPTIONAL:
        whole |= {name: held for name in _OPTIONAL[kind] if (held := getattr(event, name))}
    whole["crc32"] = _NO_CRC
    body: bytes = _PACKING.packer.pack(whole)[:-_CRC_BYTES]
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
    if not isinstance(kind, str) or kind not in _EXPECTED:
        raise RecordingError(f"the kind of an event must be one of {', '.join(_FIELDS)}, got {kind!r:.40}")
    (event_type, types), expected = _FIELDS[kind], _EXPECTED[kind]
    if kind in _OPTIONAL:
        optional = {name: held for name, held in _OPTIONAL[kind].items() if name in whole}
        types, expected = types | optional, expected | optional
    if {name: type(value) for name, value in whole.items()} != expected:
        raise RecordingError(f"an event of kind {kind!r} must have the fields {', '.join(expected)}")
    for name, held in expected.items():
        if held is int and whole[name] not in _INTEGERS:
            raise RecordingError(f"the numbers of an event of kind {kind!r} must be from 0 to 2**63 - 1")
    if event_type is Request:
        whole["body"] = _checked_request(whole["body"])
    if kind == "recording_failed":
        return whole["n"], whole["t_ns"], RecordingChanged(whole["name"], "", "failed", whole["reason"])
    return whole["n"], whole["t_ns"], event_type(**{name: whole[name] for name in types})


def _crc(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(_CRC_BYTES, "big")


def _checked_request(body: dict[str, Any]) -> dict[str, Any]:
    """Check a recorded request as strictly as one from a socket."""
    try:
        data = msgpack.packb(body)
        return messages.decode(data, messages.request_limits(data))
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
