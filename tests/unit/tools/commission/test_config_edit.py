"""A key of a config is set, and nothing else changes."""

from __future__ import annotations

import tomllib

import pytest

from slipd.tools.commission.config_update import with_value

EDITED = """\
# the rig
[finger.left]
mu = 0.5   # measured

[finger.left.pad]
rows = 1
tare = [
    1.0, 2.0,  # ] first
    3.0,
]  # end
cols = 3

[finger.right]
pad.tare = [1, 2]
[finger.third.pad]
rows = 1
"""
LEFT, RIGHT, THIRD = (("finger", name, "pad", "tare") for name in ("left", "right", "third"))
OLD = EDITED[EDITED.index("tare") : EDITED.index("cols")]
VALUE = "[\n    7.0, 8.5, 9.0,\n]"
NEW = f"tare = {VALUE}  # new"


@pytest.mark.parametrize(
    ("path", "old", "new"),
    [
        (LEFT, OLD, f"{NEW}\n"),
        (RIGHT, "pad.tare = [1, 2]", f"pad.{NEW}"),
        (THIRD, "[finger.third.pad]\n", f"[finger.third.pad]\n{NEW}\n"),
    ],
    ids=["a key", "a dotted key", "a missing key"],
)
def test_a_list_is_set_and_nothing_else_changes(path: tuple[str, ...], old: str, new: str) -> None:
    text = with_value(EDITED, path, VALUE, "new")
    assert text == EDITED.replace(old, new)
    before, after = tomllib.loads(EDITED), tomllib.loads(text)
    assert after["finger"][path[1]]["pad"].pop("tare") == [7.0, 8.5, 9.0]
    before["finger"][path[1]]["pad"].pop("tare", None)
    assert after == before


@pytest.mark.parametrize("text", ["[finger]\nleft = {pad = {rows = 1, tare = [1]}}\n", "finger.left.pad.rows = 1\n"])
def test_a_table_without_a_header_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"must have a line \[finger\.left\.pad\], to set tare below it"):
        with_value(text, LEFT, "[1.0]", "new")


def test_every_other_line_keeps_its_end_and_lines_end_only_where_toml_ends_them() -> None:
    text = "# a \u2028budget_n = 500\r\n[a]\r\nx = 1 # \x85 y\r\n# end"
    assert with_value(text, ("a", "x"), "2", "new") == text.replace("x = 1 # \x85 y", "x = 2  # new")
    assert with_value(text, ("a", "z"), "2", "new") == text.replace("[a]\r\n", "[a]\r\nz = 2  # new\r\n")
    assert with_value(text, ("a", "x"), "[\n1.0]", "n") == text.replace("x = 1 # \x85 y", "x = [\r\n1.0]  # n")
    assert with_value("[a]", ("a", "x"), "1", "c") == "[a]\nx = 1  # c\n"
