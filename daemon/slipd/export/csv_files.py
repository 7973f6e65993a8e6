"""A folder with one CSV file for each topic: a header, then one line for each message.

A column has one type: numbers, ``true`` and ``false``, or text. What is not known is empty; in a text it is "unknown",
because an empty text has a meaning (no fault). Lists of words are joined by ";"; lists of no fixed length are JSON.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from slipd.export.message_files import Body
from slipd_client.messages.schema.fields import fields_of
from slipd_client.messages.schema.kinds import FLAG, HEALTH, INTEGER, NUMBER, PAIR, SEXTUPLE, TEXT, TRIPLE, Kind
from slipd_client.messages.schema.topics import TOPICS

LOG_TIME = "published_ns"
"""First column: when the message was published, ns since 1970."""

UNKNOWN = "unknown"

Text = Callable[[Any], str]
Column = tuple[str, tuple[str | int, ...], Text]
"""Name, path of the value within the message, and its text."""

_ENDS = {PAIR: "xy", TRIPLE: "xyz", SEXTUPLE: ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")}


class CsvFiles:
    """Writes the files.

    Args:
        folder: Folder to create.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self._folder = folder
        self._files = ExitStack()
        self._topics: dict[str, tuple[Any, list[Column]]] = {}

    def write(self, log_ns: int, topic: str, body: Body) -> None:
        """Write a message that was published at ``log_ns``, ns since 1970."""
        rows, columns = self._topics.get(topic) or self._begin(topic, body)
        rows.writerow([str(log_ns), *(text(_value(body, path)) for _, path, text in columns)])

    def finish(self) -> None:
        """Close the files."""
        self._files.close()

    def close(self) -> None:
        """Close the files."""
        self._files.close()

    def _begin(self, topic: str, body: Body) -> tuple[Any, list[Column]]:
        file = self._files.enter_context((self._folder / f"{topic}.csv").open("x", encoding="utf-8", newline=""))
        rows = csv.writer(file, lineterminator="\n")
        columns = list(_columns(TOPICS[topic.partition(".")[0]], body, body, "", ()))
        rows.writerow([LOG_TIME, *(name for name, _, _ in columns)])
        self._topics[topic] = rows, columns
        return self._topics[topic]


_ABSENT = object()
"""A value within a map that is nil, or of a key that is not there."""


def _value(body: Any, path: tuple[str | int, ...]) -> Any:
    value = body
    for key in path:
        if value is None or (isinstance(value, dict) and key not in value):
            return _ABSENT
        value = value[key]
    return value


def _columns(cls: type[Any], body: Body, message: Body, prefix: str, path: tuple[str | int, ...]) -> Iterator[Column]:
    """Yield the columns of a map of a class; those of lists and maps as the first message has them."""
    for field in fields_of(cls):
        value = body.get(field.name)
        yield from _field(field.kind, value, message, f"{prefix}{field.name}", (*path, field.name))


def _field(kind: Kind, value: Any, message: Body, name: str, path: tuple[str | int, ...]) -> Iterator[Column]:
    if kind.part is not None:
        yield from _columns(kind.part, value or {}, message, f"{name}.", path)
    elif kind in _ENDS:
        for index, end in enumerate(_ENDS[kind]):
            yield f"{name}.{end}", (*path, index), _plain
    elif kind.inner is None:
        yield name, path, _plain if kind in (NUMBER, INTEGER, HEALTH, FLAG) else _text
    elif kind.inner is NUMBER and not kind.name.startswith("map"):
        for index in range(message["rows"] * message["cols"]):  # the loads of a pad
            yield f"{name}.{index}", (*path, index), _plain
    elif kind.inner is TEXT:
        yield name, path, _words
    elif kind.name.startswith("map") and kind.inner.inner is not INTEGER:
        for key in value if value is not None else message.get("fingers", ()):
            entry = None if value is None else value[key]
            yield from _field(kind.inner, entry, message, f"{name}.{key}", (*path, key))
    else:
        yield name, path, _json


def _plain(value: Any) -> str:
    if value is None or value is _ABSENT:
        return ""
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def _text(value: Any) -> str:
    return "" if value is _ABSENT else UNKNOWN if value is None else str(value)


def _words(value: Any) -> str:
    return "" if value is None or value is _ABSENT else ";".join(value)


def _json(value: Any) -> str:
    return "" if value is None or value is _ABSENT else json.dumps(value)
