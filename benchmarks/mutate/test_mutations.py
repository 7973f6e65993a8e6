"""Every mutation changes its file in one place and leaves it a program."""

from __future__ import annotations

import ast

import pytest
from mutate.__main__ import PROJECT, equivalents, wire_draw
from mutate.mutations import mutate, mutations

SOURCE = '''"""A docstring."""
import struct
LAYOUT = struct.Struct("<hH")
def scaled(count: int, gain: float = 0.5) -> float:
    if count < 0 and gain > 1:
        raise ValueError("no")
    return -count * gain
'''


def test_each_kind_of_mistake_is_made_once_in_its_place() -> None:
    found = {(mutation.line, mutation.kind) for mutation in mutations(SOURCE)}
    assert found == {
        (3, "constant"), (4, "constant"), (5, "condition"), (5, "operator"), (5, "constant"), (6, "deleted"),
        (7, "operator"),
    }  # fmt: skip


def test_a_mutant_differs_from_its_source_and_parses() -> None:
    for mutation in mutations(SOURCE):
        assert ast.dump(ast.parse(mutate(SOURCE, mutation))) != ast.dump(ast.parse(SOURCE))


def test_a_byte_order_is_reversed() -> None:
    changed = [mutate(SOURCE, mutation) for mutation in mutations(SOURCE) if mutation.line == 3]
    assert "'>hH'" in changed[0]


@pytest.mark.long
def test_a_mutant_that_is_called_equal_exists() -> None:
    on_the_wire = {(path, mutation.line, mutation.text) for _, path, mutation in wire_draw(())}
    for path, source, change in equivalents():
        text = (PROJECT / path).read_text(encoding="utf-8")
        lines = text.splitlines()
        found = {(lines[each.line - 1].strip(), each.text) for each in mutations(text)}
        found |= {(lines[line - 1].strip(), changed) for file, line, changed in on_the_wire if file == path}
        assert (source, change) in found, path
