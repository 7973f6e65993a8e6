"""The tables of ``docs/protocol.md`` and of the methods in the page of the client, made from the schema.

``PYTHONPATH=tests/support python -m wire_tables PAGE`` writes them between their markers; other text stays as it is.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from slipd_client.grip import GripClient
from slipd_client.messages.names import (
    ERROR_MEANINGS,
    EVIDENCE,
    IMAGE_REASONS,
    LEVEL_MEANINGS,
    REASONS,
    TARE_REASONS,
    level_code,
)
from slipd_client.messages.schema.fields import Field, fields_of
from slipd_client.messages.schema.ops import OPS, Op
from slipd_client.messages.schema.parts import FingerStatus, IncidentsStatus, RecordingStatus, StreamStatus
from slipd_client.messages.schema.replies import Reply, StatusReply
from slipd_client.messages.schema.request_fields import ENVELOPE
from slipd_client.messages.schema.topics import TOPICS, Message

_OTHERWISE = {"lease.acquire": "lease"}
"""Methods that are not named like their op."""

_MARKED = re.compile(r"(<!-- table: ([a-z_]+) -->\n).*?(<!-- end of table -->)", re.DOTALL)


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
        "image_reasons": _meanings("reason", IMAGE_REASONS),
        "fingers": _fields(fields_of(FingerStatus)),
        "streams": _fields(fields_of(StreamStatus)),
        "recordings": _fields(fields_of(RecordingStatus)),
        "incidents": _fields(fields_of(IncidentsStatus)),
        "envelope": _fields(ENVELOPE),
        "ops": table(
            ("op", "what it does", "fields", "needs"),
            ((f"`{op.name}`", op.does, _names(op.fields.values()), op.needs) for op in OPS.values()),
        ),
        "request_fields": _request_fields(),
        "replies": _replies(),
        "tare_reasons": _meanings("`given_up_reason`", TARE_REASONS),
        "errors": _meanings("code", ERROR_MEANINGS),
        "methods": _methods(),
    }


def filled(document: str) -> str:
    """Return a document with the present table between each pair of markers.

    Raises:
        KeyError: A marker names a table that does not exist.
    """
    found = tables()
    return _MARKED.sub(lambda match: f"{match[1]}{found[match[2]]}{match[3]}", document)


def _fields(fields: Iterable[Field]) -> str:
    return table(("field", "type", "meaning"), ((f"`{each.name}`", each.type_name, _meaning(each)) for each in fields))


def _meaning(field: Field) -> str:
    return f"{field.only}: {field.meaning}" if field.only else field.meaning


def _request_fields() -> str:
    fields: dict[str, Field] = {}
    for op in OPS.values():
        fields = dict(op.fields) | fields  # the first op that has a field says the most about it
    ordered = {name: fields[name] for op in OPS.values() for name in op.fields}
    return table(
        ("field", "type", "meaning", "unit", "range", "where it is left out"),
        (
            (f"`{each.name}`", each.type_name, each.meaning, each.unit, each.range_text, each.default_text)
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
            rows += [(ops, f"`{each.name}`", each.type_name, _meaning(each)) for each in fields_of(cls)]
    return table(("reply to", "field", "type", "meaning"), rows)


def _names(fields: Iterable[Field]) -> str:
    return ", ".join(f"`{each.name}`" + "?" * (not each.required) for each in fields)


def _meanings(title: str, meanings: Mapping[Any, str]) -> str:
    return table((title, "meaning"), ((f"`{word}`", meaning) for word, meaning in meanings.items()))


def table(titles: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table in Markdown."""
    lines = (titles, ("---",) * len(titles), *rows)
    return "".join("|" + "|".join(f" {cell} " if cell else " " for cell in line) + "|\n" for line in lines)


def _methods() -> str:
    """Return the table of the methods: a row for each op that has one."""
    rows = []
    for op in OPS.values():
        method = getattr(GripClient, _OTHERWISE.get(op.name, op.name.replace(".", "_")), None)
        if method is not None:
            parameters = list(inspect.signature(method).parameters.values())[1:]
            call = f"`{method.__name__}({_call(parameters)})`"
            rows.append((call, op.does, _arguments(op, parameters), _returned(op), _linked(op.needs)))
    return table(("method", "what it does", "arguments", "returns", "needs, and is refused without (`code`)"), rows)


def _call(parameters: list[inspect.Parameter]) -> str:
    """Return the arguments of a method as its signature has them, without their types."""
    parts = []
    for each in parameters:
        if each.kind is each.KEYWORD_ONLY and "*" not in parts:
            parts.append("*")
        parts.append(each.name if each.default is each.empty else f"{each.name}={each.default!r}")
    return ", ".join(parts)


def _arguments(op: Op, parameters: list[inspect.Parameter]) -> str:
    """Return what each argument is, with its unit and range."""
    found = []
    for field in (op.fields[each.name] for each in parameters):
        facts = ", ".join(part for part in (field.unit, field.range_text) if part)
        found.append(f"`{field.name}`: {field.meaning}" + (f" ({facts})" if facts else ""))
    return "; ".join(found)


def _returned(op: Op) -> str:
    if op.name in _OTHERWISE:
        return "a `with` block that holds the lease"
    if op.reply is StatusReply:
        return "`StatusReply`: the fields of the topic `status`"
    names = ", ".join(f"`{field.name}`" for field in fields_of(op.reply))
    result = "TareResult" if op.name == "tare" else op.reply.__name__
    return "" if op.reply is Reply else f"`{result}`: {names}"


def _linked(needs: str) -> str:
    return needs.replace("](#", "](protocol.md#")


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
