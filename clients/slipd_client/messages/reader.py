"""Turns the map of a message into its class.

A message of another version, or with a known field of another kind, is refused: a program must not steer by a guess.
Unknown fields and topics are ignored. The fields of each class are looked up once, so that reading a verdict takes a
few microseconds.
"""

from __future__ import annotations

from typing import Any

from slipd_client.errors import MessageError
from slipd_client.messages.codec import MESSAGE_LIMITS, decode
from slipd_client.messages.names import PROTOCOL_VERSION
from slipd_client.messages.schema.fields import read_fields
from slipd_client.messages.schema.kinds import Mismatch
from slipd_client.messages.schema.topics import TOPICS, Message

_HEADER = {"seq": int, "boot": str, "t_ns": int}
"""What a subscriber needs to order a message."""


def read(frames: list[bytes]) -> tuple[str, dict[str, Any]]:
    """Return topic and map of the frames of one message of this version.

    Raises:
        MessageError: The frames are no such message.
    """
    if len(frames) != 2:
        raise MessageError("malformed", f"a message must have two frames, got {len(frames)}")
    try:
        topic = frames[0].decode()
    except UnicodeDecodeError as error:
        raise MessageError("malformed", f"the topic must be UTF-8: {error}") from error
    raw = decode(frames[1], MESSAGE_LIMITS)
    if raw.get("v") != PROTOCOL_VERSION:
        raise MessageError("unsupported_version", f"v must be {PROTOCOL_VERSION}, got {raw.get('v')!r:.40}", "v")
    for field, kind in _HEADER.items():
        if type(raw.get(field)) is not kind:
            raise MessageError(
                "bad_type", f"{field} must be of type {kind.__name__}, got {raw.get(field)!r:.40}", field
            )
    return topic, raw


def typed_message(topic: str, raw: dict[str, Any], missed: int = 0, restarted: bool = False) -> Message:
    """Return the message of a topic as its class, or as `Message` where this client does not know the topic.

    Args:
        topic: Topic of the message.
        raw: Its map.
        missed: Number of messages just before it that did not arrive.
        restarted: The daemon was restarted before it.

    Raises:
        MessageError: A field that must be there is missing, or a field is of another kind.
    """
    cls = TOPICS.get(topic.partition(".")[0], Message)
    try:
        values = read_fields(cls, raw)
    except Mismatch as fault:
        raise MessageError(fault.code, f"{fault.path} {fault.rule}", fault.path) from fault
    return cls(topic=topic, raw=raw, missed=missed, restarted=restarted, **values)
