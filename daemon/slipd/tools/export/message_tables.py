"""Messages as rows of tables: a folder with one CSV or Parquet file for each topic, one row for each message.

A column has one type. In CSV what is not known is empty; in a text it is "unknown", because an empty text has a meaning
(no fault). An apostrophe precedes a text that a spreadsheet would compute. Lists of words are joined by ";", and each
load of a pad has a column. In Parquet what is not known is null, and lists of words and the loads of a pad are lists.
Lists of no fixed length are JSON in both.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

from slipd.config import Config
from slipd.tools.outputs import parquet_library, parquet_rows
from slipd_client.messages.fields import FLAG, HEALTH, INTEGER, NUMBER, PAIR, SEXTUPLE, TEXT, TRIPLE, Kind, fields_of
from slipd_client.messages.topics import TOPICS

Body = dict[str, Any]

Write = Callable[[int, str, Body], None]
"""Writes a message that was published at a time, ns since 1970: its topic and its body."""

LOG_TIME = "published_ns"
"""First column: when the message was published, ns since 1970."""

ABSENT = object()
"""A value within a map that is nil, or of a key that is not there."""

UNKNOWN = "unknown"
FORMULA = ("=", "+", "-", "@", "\t")
"""Beginnings of a cell that spreadsheets compute instead of showing it."""

ROWS = 10_000
"""Rows that are written at once; a message with the loads of a pad takes some kilobytes until then."""

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


@contextmanager
def csv_files(folder: Path, _: Config) -> Iterator[Write]:
    """Create a folder of CSV files, and yield what writes a message."""
    folder.mkdir()
    topics: dict[str, tuple[Any, list[Column]]] = {}
    with ExitStack() as files:

        def write(log_ns: int, topic: str, body: Body) -> None:
            if topic not in topics:
                file = files.enter_context((folder / f"{topic}.csv").open("x", encoding="utf-8", newline=""))
                found = [each for column in columns(topic, body) for each in _spread(column, body)]
                topics[topic] = csv.writer(file, lineterminator="\n"), found
                topics[topic][0].writerow([LOG_TIME, *(column.name for column in found)])
            rows, found = topics[topic]
            rows.writerow([str(log_ns), *(_text(column.kind, column.value(body)) for column in found)])

        yield write


def _spread(column: Column, message: Body) -> list[Column]:
    """Return a column for each load of a pad; any other column as it is."""
    if column.kind != "numbers":
        return [column]
    return [
        Column(f"{column.name}.{index}", (*column.path, index), "number")
        for index in range(message["rows"] * message["cols"])
    ]


def _text(kind: ColumnKind, value: Any) -> str:
    """Return the text of a cell."""
    if value is ABSENT or (value is None and kind != "text"):
        return ""
    if kind in ("text", "words"):
        text = UNKNOWN if value is None else str(value) if kind == "text" else ";".join(value)
        text = text.replace("\r", "\\r")  # the writer quotes none, and readers end the row there
        return f"'{text}" if text.startswith(FORMULA) else text
    return json.dumps(value) if kind == "json" or isinstance(value, bool) else repr(value)


@contextmanager
def parquet_tables(folder: Path, _: Config) -> Iterator[Write]:
    """Create a folder of Parquet files, and yield what writes a message.

    Raises:
        SlipdError: pyarrow is not installed.
    """
    arrow, _parquet = parquet_library("--to parquet")
    folder.mkdir()
    topics: dict[str, tuple[Callable[[Body], None], list[Column]]] = {}
    with ExitStack() as files:

        def write(log_ns: int, topic: str, body: Body) -> None:
            if topic not in topics:
                found, types = columns(topic, body), _types(arrow)
                schema = arrow.schema(
                    [(LOG_TIME, types["integer"]), *((each.name, types[each.kind]) for each in found)]
                )
                add = files.enter_context(parquet_rows(folder / f"{topic}.parquet", schema, ROWS))
                topics[topic] = add, found
            add, found = topics[topic]
            values = ((column, column.value(body)) for column in found)
            known = ((each, value) for each, value in values if value is not None and value is not ABSENT)
            row = {each.name: _CONVERSIONS[each.kind](value) for each, value in known}
            add({LOG_TIME: log_ns, **row})

        yield write


_CONVERSIONS: dict[ColumnKind, Callable[[Any], Any]] = {
    "number": float,
    "integer": int,
    "flag": bool,
    "text": str,
    "words": list,
    "numbers": list,
    "json": json.dumps,
}
"""Converts a value to the type of its column, by the kind of the column."""


def _types(arrow: Any) -> dict[str, Any]:
    return {
        "number": arrow.float64(),
        "integer": arrow.int64(),
        "flag": arrow.bool_(),
        "text": arrow.string(),
        "words": arrow.list_(arrow.string()),
        "numbers": arrow.list_(arrow.float64()),
        "json": arrow.string(),
    }
