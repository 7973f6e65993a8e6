"""Only publish/ knows the keys of messages and replies; requests/ reads the fields of requests."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import get_args

import numpy as np
from project import DAEMON

from slipd.fusion import rows
from slipd.gripper.intent import IntentKind
from slipd_client.messages.fields import Field, Kind, fields_of
from slipd_client.messages.ops import OPS
from slipd_client.messages.request_fields import ENVELOPE
from slipd_client.messages.topics import TOPICS

OTHER_FORMATS = {"devices", "recording", "config"}
"""Rooms with formats of their own: bytes of devices, recordings, config files."""

CLIENTS = {"tools"}
"""Programs and rooms that read messages, as every client does."""

READERS = {"requests", "io"}
"""Rooms that read requests."""

REQUEST_FIELDS = {field.name for field in ENVELOPE} | {name for op in OPS.values() for name in op.fields}
ROW_ROOMS = {"fusion", "signals", "friction", "finger"}
"""Rooms that address fields of rows, which are named by quantity and unit as keys are."""

ROW_FIELDS = {name for dtype in vars(rows).values() if isinstance(dtype, np.dtype) for name in dtype.names or ()}
ALSO_WORDS = {*OPS, *get_args(IntentKind)}
"""Keys that are words of their own elsewhere: ops, kinds of intent, and the context of asyncio's exception handler."""

ASYNCIO = {("service_run.py", "message")}


def names_of(fields: Iterable[Field]) -> Iterator[str]:
    """Every key of a map that the schema declares, and of the maps within it."""
    for field in fields:
        yield field.name
        kind: Kind | None = field.kind
        while kind is not None:
            yield from names_of(fields_of(kind.part) if kind.part is not None else ())
            kind = kind.inner


CLASSES = [*TOPICS.values(), *(op.reply for op in OPS.values())]
KEYS = {"ok", "result", "error", "code"} | {name for each in CLASSES for name in names_of(fields_of(each))}


def literals(node: ast.AST) -> list[ast.expr]:
    """Expressions that a piece of code uses as keys of a map."""
    match node:
        case ast.Dict(keys=found):
            return [key for key in found if key is not None]
        case ast.Subscript(slice=key):
            return [key]
        case ast.Call(func=ast.Attribute(attr="get" | "pop" | "setdefault"), args=[key, *_]):
            return [key]
        case ast.Call(func=ast.Name(id="dict"), keywords=named):
            return [ast.Constant(keyword.arg) for keyword in named]
    return []


def uses(file: Path, keys: set[str]) -> set[tuple[str, str]]:
    """File and key of every use of one of these keys in a file."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = [key for node in ast.walk(tree) for key in literals(node) if isinstance(key, ast.Constant)]
    return {(str(file.relative_to(DAEMON)), key.value) for key in found if key.value in keys}


def test_no_other_room_uses_a_key_of_the_wire() -> None:
    stray: set[tuple[str, str]] = set()
    for file in DAEMON.rglob("*.py"):
        room = file.relative_to(DAEMON).parts[0]
        known = REQUEST_FIELDS if room in READERS else ROW_FIELDS if room in ROW_ROOMS else set()
        if room not in OTHER_FORMATS | CLIENTS | {"publish"}:
            stray |= uses(file, KEYS - ALSO_WORDS - known)
    assert stray <= ASYNCIO


def test_the_scan_finds_every_key_of_the_wire_in_publish() -> None:
    """So the test above would see one elsewhere."""
    found = {key for file in (DAEMON / "publish").rglob("*.py") for _, key in uses(file, KEYS)}
    assert found == KEYS
