"""Mutants of what a decoder takes bytes for: every scale, sign, byte order, offset and length that it uses.

A number of a decoder is one in its class ``Decoder``, or in a function or constant of its device, or of what devices
share, that the class leads to.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from mutate.mutations import Mutation, change_at, other_value, short, skipped_nodes

SHARED = ("rdt_records.py", "weiss_packets.py", "weiss_tactile.py", "checksums.py", "modbus.py")
"""Shared parts with layouts of their own."""

_FORMAT = re.compile(r"[<>]?(\d*[bBhHiIqQfsx])+|[<>][ui]\d")
_SIGNS = str.maketrans("bBhHiIqQ", "BbHhIiQq")
_ORDERS = {"big": "little", "little": "big"}


def wire_mutations(files: list[Path]) -> list[tuple[Path, Mutation]]:
    """Return every change of a number on the wire in the files of one device."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in files}
    own = {path: {name: node for node in tree.body for name in _names(node)} for path, tree in trees.items()}
    everywhere = {name: (path, node) for path, parts in own.items() for name, node in parts.items()}
    reached: set[int] = set()
    waiting = [everywhere["Decoder"]]
    while waiting:
        path, part = waiting.pop()
        if id(part) not in reached:
            reached.add(id(part))
            used = {getattr(node, "id", None) or getattr(node, "attr", "") for node in ast.walk(part)}
            waiting += [(path, own[path][name]) for name in used if name in own[path]]
            waiting += [everywhere[name] for name in used if name in everywhere and name not in own[path]]
    return [
        (path, mutation)
        for path, tree in trees.items()
        for part in tree.body
        if id(part) in reached
        for mutation in _of_part(tree, part, is_shared=path.parent.name == "shared")
    ]


def _names(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else []
    return [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]


def _of_part(tree: ast.Module, part: ast.stmt, *, is_shared: bool) -> Iterator[Mutation]:
    inside, skipped = {id(node) for node in ast.walk(part)}, skipped_nodes(tree)
    for index, node in enumerate(ast.walk(tree)):
        if id(node) in inside and id(node) not in skipped:
            for kind, change in wire_changes(node):
                if kind == "number" and is_shared and not isinstance(part, ast.Assign):
                    continue  # a bound of the search, not of the layout
                changed = change_at(node, change)
                if short(changed) != short(node):
                    yield Mutation(index, node.lineno, kind, f"{short(node)} → {short(changed)}")  # type: ignore[attr-defined]


def wire_changes(node: ast.AST) -> Iterator[tuple[str, Callable[[ast.AST], None]]]:
    """Yield at most one change of each kind of what a node takes bytes for."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "sign", lambda node: setattr(node, "op", ast.UAdd())
    if not isinstance(node, ast.Constant):
        return
    value = node.value
    if type(value) in (int, float):
        yield "number", lambda node: setattr(node, "value", other_value(value))
    elif isinstance(value, bytes) and value:
        yield "number", lambda node: setattr(node, "value", bytes((value[0] ^ 1,)) + value[1:])
    elif isinstance(value, str) and value in _ORDERS:
        yield "order", lambda node: setattr(node, "value", _ORDERS[value])
    elif isinstance(value, str) and _FORMAT.fullmatch(value) and (value[0] in "<>" or value.isdigit()):
        swapped = {"<": ">", ">": "<"}.get(value[0], value[0]) + value[1:]
        yield "order", lambda node: setattr(node, "value", swapped)
        signs = value.translate(str.maketrans("ui", "iu")) if value[1] in "ui" and value[2:].isdigit() else None
        yield "signed", lambda node: setattr(node, "value", signs or value.translate(_SIGNS))
