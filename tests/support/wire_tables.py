"""The tables of ``docs/protocol.md``, made from the schema.

``PYTHONPATH=tests/support python -m wire_tables docs/protocol.md`` writes each below its marker; other text stays as
it is.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from slipd_client.messages.fields import Field, fields_of
from slipd_client.messages.names import (
    ERROR_MEANINGS,
    EVIDENCE,
    IMAGE_REASONS,
    LEVEL_MEANINGS,
    REASONS,
    TARE_REASONS,
    level_code,
)
from slipd_client.messages.ops import OPS
from slipd_client.messages.parts import FingerStatus, IncidentsStatus, RecordingStatus, StreamStatus
from slipd_client.messages.replies import Reply, StatusReply
from slipd_client.messages.request_fields import ENVELOPE
from slipd_client.messages.topics import TOPICS, Message

STATUS_PARTS = {
    "a finger": FingerStatus,
    "a recording": RecordingStatus,
    "`incidents`": IncidentsStatus,
    "a stream": StreamStatus,
}
_AS_IN_SLIP = "as in `slip`"
_OF_SLIP = {field.name: field for field in fields_of(TOPICS["slip"])[len(fields_of(Message)) :]}

_MARKED = re.compile(r"(<!-- table: ([a-z_]+) -->\n)(?:\|.*\n)*")


def tables() -> dict[str, str]:
    """Return every table by the name in its marker."""
    common = {field.name for field in fields_of(Message)}
    topics = {
        name: _fields(field for field in fields_of(cls) if field.name not in common) for name, cls in TOPICS.items()
    }
    return topics | {
        "header": _fields(fields_of(Message)),
        "levels": table(
            ("`level`", "`level_code`", "meaning"),
            ((f"`{level}`", str(level_code(level)), meaning) for level, meaning in LEVEL_MEANINGS.items()),
        ),
        "reasons": _meanings("reason", REASONS),
        "evidence": _meanings("evidence", EVIDENCE),
        "image_reasons": _meanings(
            "reason", {word: text for word, text in IMAGE_REASONS.items() if word not in REASONS}
        ),
        "status_parts": table(
            ("of", "field", "type", "meaning"),
            ((part, *row) for part, cls in STATUS_PARTS.items() for row in _rows(fields_of(cls))),
        ),
        "envelope": _fields(ENVELOPE),
        "ops": table(
            ("op", "what it does", "fields", "needs"),
            ((f"`{op.name}`", op.does, _names(op.fields.values()), op.needs) for op in OPS.values()),
        ),
        "request_fields": _request_fields(),
        "replies": _replies(),
        "tare_reasons": _meanings("`given_up_reason`", TARE_REASONS),
        "errors": _meanings("code", ERROR_MEANINGS),
    }


def filled(document: str) -> str:
    """Return a document with the present table below each marker.

    Raises:
        KeyError: A marker names a table that does not exist.
    """
    found = tables()
    return _MARKED.sub(lambda match: f"{match[1]}{found[match[2]]}", document)


def _fields(fields: Iterable[Field]) -> str:
    return table(("field", "type", "meaning"), _rows(fields))


def _rows(fields: Iterable[Field]) -> list[tuple[str, ...]]:
    """Return a row for each field, and one for neighbours that are all as in ``slip``."""
    rows: list[tuple[str, ...]] = []
    for each in fields:
        if rows and rows[-1][2] == _meaning(each) == _AS_IN_SLIP:
            rows[-1] = (f"{rows[-1][0]}, `{each.name}`", "", _AS_IN_SLIP)
        else:
            rows.append((f"`{each.name}`", _kind(each), _meaning(each)))
    return rows


def _kind(field: Field) -> str:
    return field.kind.name + "?" * field.nullable


def _range(field: Field) -> str:
    words = "one of " + ", ".join(f'"{word}"' for word in field.words) if field.words else ""
    return ", ".join(part for part in (field.number_range, words, field.limit) if part)


def _meaning(field: Field) -> str:
    same = _OF_SLIP.get(field.name)
    meaning = _AS_IN_SLIP if same is not None and same is not field and same.meaning == field.meaning else field.meaning
    return f"{field.only}: {meaning}" if field.only else meaning


def _request_fields() -> str:
    fields: dict[str, Field] = {}
    for op in OPS.values():
        fields = dict(op.fields) | fields  # the first op that has a field says the most about it
    ordered = {name: fields[name] for op in OPS.values() for name in op.fields}
    return table(
        ("field", "type", "meaning", "unit", "range", "where it is left out"),
        (
            (f"`{each.name}`", _kind(each), each.meaning, each.unit, _range(each), each.default_text)
            for each in ordered.values()
        ),
    )


def _replies() -> str:
    ops_of: dict[type[Reply], list[str]] = {}
    for op in OPS.values():
        ops_of.setdefault(op.reply, []).append(f"`{op.name}`")
    rows: list[tuple[str, ...]] = []
    for cls, names in ops_of.items():
        ops = ", ".join(names)
        if cls is Reply:
            rows.append((ops, "", "", "an empty map"))
        elif cls is StatusReply:
            rows.append((ops, "", "", "the fields of the topic `status`, without those of every message"))
        else:
            rows += [(ops, *row) for row in _rows(fields_of(cls))]
    return table(("reply to", "field", "type", "meaning"), rows)


def _names(fields: Iterable[Field]) -> str:
    return ", ".join(f"`{each.name}`" + "?" * (not each.required) for each in fields)


def _meanings(title: str, meanings: Mapping[Any, str]) -> str:
    return table((title, "meaning"), ((f"`{word}`", meaning) for word, meaning in meanings.items()))


def table(titles: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table in Markdown."""
    lines = (titles, ("---",) * len(titles), *rows)
    return "".join("|" + "|".join(f" {cell} " if cell else " " for cell in line) + "|\n" for line in lines)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
