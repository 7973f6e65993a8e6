"""A folder with one CSV file for each topic: a header, then one line for each message.

A column has one type: numbers, ``true`` and ``false``, or text. What is not known is empty; in a text it is "unknown",
because an empty text has a meaning (no fault). An apostrophe precedes a text that a spreadsheet would compute. Lists of
words are joined by ";"; lists of no fixed length are JSON.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from slipd.tools.export.message_columns import ABSENT, LOG_TIME, Column, columns
from slipd.tools.export.message_files import Body

UNKNOWN = "unknown"
FORMULA = ("=", "+", "-", "@", "\t")
"""Beginnings of a cell that spreadsheets compute instead of showing it."""


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
        rows, found = self._topics.get(topic) or self._begin(topic, body)
        rows.writerow([str(log_ns), *(_TEXTS[column.kind](column.value(body)) for column in found)])

    def finish(self) -> None:
        """Close the files."""
        self._files.close()

    def close(self) -> None:
        """Close the files."""
        self._files.close()

    def _begin(self, topic: str, body: Body) -> tuple[Any, list[Column]]:
        file = self._files.enter_context((self._folder / f"{topic}.csv").open("x", encoding="utf-8", newline=""))
        rows = csv.writer(file, lineterminator="\n")
        found = [each for column in columns(topic, body) for each in _spread(column, body)]
        rows.writerow([LOG_TIME, *(column.name for column in found)])
        self._topics[topic] = rows, found
        return self._topics[topic]


def _spread(column: Column, message: Body) -> Iterator[Column]:
    """Yield a column for each load of a pad; any other column as it is."""
    if column.kind != "numbers":
        yield column
        return
    for index in range(message["rows"] * message["cols"]):
        yield Column(f"{column.name}.{index}", (*column.path, index), "number")


def _plain(value: Any) -> str:
    if value is None or value is ABSENT:
        return ""
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def _text(value: Any) -> str:
    return "" if value is ABSENT else UNKNOWN if value is None else _quoted(str(value))


def _words(value: Any) -> str:
    return "" if value is None or value is ABSENT else _quoted(";".join(value))


def _quoted(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula: an apostrophe precedes one that begins like it."""
    text = text.replace("\r", "\\r")  # the writer quotes none, and readers end the row there
    return f"'{text}" if text.startswith(FORMULA) else text


def _json(value: Any) -> str:
    return "" if value is None or value is ABSENT else json.dumps(value)


_TEXTS: dict[str, Callable[[Any], str]] = {
    "number": _plain,
    "integer": _plain,
    "flag": _plain,
    "text": _text,
    "words": _words,
    "json": _json,
}
"""Text of a value, by the kind of its column."""
