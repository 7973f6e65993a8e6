"""Messages as rows of a table: which columns a topic has, and where in a message the value of each is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

from slipd.tools.export.message_files import Body
from slipd_client.messages.schema.fields import fields_of
from slipd_client.messages.schema.kinds import FLAG, HEALTH, INTEGER, NUMBER, PAIR, SEXTUPLE, TEXT, TRIPLE, Kind
from slipd_client.messages.schema.topics import TOPICS

LOG_TIME = "published_ns"
"""First column: when the message was published, ns since 1970."""

ABSENT = object()
"""A value within a map that is nil, or of a key that is not there."""

ColumnKind = Literal["number", "integer", "flag", "text", "words", "numbers", "json"]

_ENDS = {PAIR: "xy", TRIPLE: "xyz", SEXTUPLE: ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")}
_PLAIN: dict[Kind, ColumnKind] = {NUMBER: "number", INTEGER: "integer", HEALTH: "integer", FLAG: "flag"}
_LISTS: dict[Kind, ColumnKind] = {NUMBER: "numbers", TEXT: "words"}


class Column(NamedTuple):
    """One column of a topic.

    Attributes:
        name: Its name; dots separate the keys.
        path: Keys and indices of its value within a message.
        kind: "numbers" is a list of numbers, "words" one of texts, "json" any other list or map.
    """

    name: str
    path: tuple[str | int, ...]
    kind: ColumnKind

    def value(self, body: Any) -> Any:
        """Return the value of this column; `ABSENT` where a map around it is nil or has no such key."""
        for key in self.path:
            if body is None or (isinstance(body, dict) and key not in body):
                return ABSENT
            body = body[key]
        return body


def columns(topic: str, first: Body) -> list[Column]:
    """Return the columns of a topic; those of maps are the ones that its first message has."""
    return list(_columns(TOPICS[topic.partition(".")[0]], first, first, "", ()))


def _columns(cls: type[Any], body: Body, message: Body, prefix: str, path: tuple[str | int, ...]) -> Iterator[Column]:
    for field in fields_of(cls):
        value = body.get(field.name)
        yield from _field(field.kind, value, message, f"{prefix}{field.name}", (*path, field.name))


def _field(kind: Kind, value: Any, message: Body, name: str, path: tuple[str | int, ...]) -> Iterator[Column]:
    if kind.part is not None:
        yield from _columns(kind.part, value or {}, message, f"{name}.", path)
    elif kind in _ENDS:
        for index, end in enumerate(_ENDS[kind]):
            yield Column(f"{name}.{end}", (*path, index), "number")
    elif kind.inner is None:
        yield Column(name, path, _PLAIN.get(kind, "text"))
    elif kind.inner in _LISTS and not kind.name.startswith("map"):
        yield Column(name, path, _LISTS[kind.inner])
    elif kind.name.startswith("map") and kind.inner is not TEXT and kind.inner.inner is not INTEGER:
        for key in value if value is not None else message.get("fingers", ()):
            entry = None if value is None else value[key]
            yield from _field(kind.inner, entry, message, f"{name}.{key}", (*path, key))
    else:
        yield Column(name, path, "json")
