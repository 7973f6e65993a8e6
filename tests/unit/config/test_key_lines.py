"""Each key of a config has its line, however the file is written."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.config.config_file import key_lines, line_of

TEXT = """\
# a comment = with an equals sign
title = "top"

[finger.left]   # [not.a.table]
mu = 0.5
pad.rows = 4

  [ finger . left . wrench ]
  port="/dev/ttyUSB0"
  "quoted key" = 1

[gripper]
force_table = [
  [0, 3.0],
  [255, 30.0]
]
max_force_n = 25.0
"""


def test_every_key_has_its_line_and_rows_of_a_list_are_no_tables() -> None:
    assert key_lines(TEXT) == {
        ("title",): 2,
        ("finger", "left"): 4,
        ("finger", "left", "mu"): 5,
        ("finger", "left", "pad", "rows"): 6,
        ("finger", "left", "wrench"): 8,
        ("finger", "left", "wrench", "port"): 9,
        ("finger", "left", "wrench", "quoted key"): 10,
        ("gripper",): 12,
        ("gripper", "force_table"): 13,
        ("gripper", "max_force_n"): 17,
    }
    assert key_lines("x = 1\n[[rig]]\nname = 2\nname = 3\n") == {("x",): 1, ("rig",): 2, ("rig", "name"): 3}


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("finger", "left", "wrench", "pad_from_sensor", "sign"), 8),
        (("gripper", "force_table", "1", "0"), 13),
        (("finger", "left", "mu"), 5),
        (("levels", "caution"), None),
        ((), None),
    ],
)
def test_a_missing_key_gets_the_line_of_the_innermost_enclosing_table(path: tuple[str, ...], line: int | None) -> None:
    assert line_of(key_lines(TEXT), path) == line


NAME = st.text("abcxyz019_-", min_size=1, max_size=6)


@given(st.dictionaries(NAME, st.dictionaries(NAME, st.integers(-9, 9), min_size=1, max_size=4), max_size=4))
def test_every_line_found_holds_its_key(tree: dict[str, dict[str, int]]) -> None:
    text = "".join(
        f"[{table}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) for table, keys in tree.items()
    )
    assert tomllib.loads(text) == tree
    found = key_lines(text)
    written = text.splitlines()
    expected: dict[tuple[str, ...], Any] = {(table,): f"[{table}]" for table in tree}
    expected |= {(table, key): f"{key} = {value}" for table, keys in tree.items() for key, value in keys.items()}
    assert {path: written[line - 1] for path, line in found.items()} == expected
