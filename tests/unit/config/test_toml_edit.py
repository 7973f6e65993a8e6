"""A key of a config is set in its text, and nothing else changes."""

from __future__ import annotations

import tomllib

import pytest

from slipd.config.toml_text import with_numbers, with_value

TEXT = """\
# the rig
[finger.left]
mu = 0.5   # measured

[finger.left.pad]
rows = 1
# old: from another trial,
# on another day
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


def changed(path: tuple[str, ...]) -> str:
    return with_numbers(TEXT, path, [7.0, 8.5, 9.0], "new")


def test_the_old_value_goes_with_the_comment_that_describes_it() -> None:
    old = TEXT[TEXT.index("# old") : TEXT.index("cols")]
    assert changed(LEFT) == TEXT.replace(old, "# new\ntare = [\n    7.0, 8.5, 9.0,\n]\n")


def test_a_dotted_key_stays_dotted() -> None:
    assert changed(RIGHT) == TEXT.replace("pad.tare = [1, 2]", "# new\npad.tare = [\n    7.0, 8.5, 9.0,\n]")


def test_a_missing_key_is_added_below_the_header_of_its_table() -> None:
    header = "[finger.third.pad]\n"
    assert changed(THIRD) == TEXT.replace(header, f"{header}# new\ntare = [\n    7.0, 8.5, 9.0,\n]\n")


@pytest.mark.parametrize("path", [LEFT, RIGHT, THIRD])
def test_only_this_key_changes(path: tuple[str, ...]) -> None:
    before, after = tomllib.loads(TEXT), tomllib.loads(changed(path))
    assert after["finger"][path[1]]["pad"].pop("tare") == [7.0, 8.5, 9.0]
    before["finger"][path[1]]["pad"].pop("tare", None)
    assert after == before


def test_long_lists_take_several_lines() -> None:
    text = with_numbers(TEXT, LEFT, [float(number) for number in range(30)], "many")
    assert "    24.0, 25.0, 26.0, 27.0, 28.0, 29.0,\n]\ncols" in text


@pytest.mark.parametrize("text", ["[finger]\nleft = {pad = {rows = 1, tare = [1]}}\n", "finger.left.pad.rows = 1\n"])
def test_a_table_without_a_header_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"must have a line \[finger\.left\.pad\], to set tare below it"):
        with_numbers(text, LEFT, [1.0], "new")


def test_every_other_line_keeps_its_end_and_lines_end_only_where_toml_ends_them() -> None:
    text = "# a \u2028budget_n = 500\r\n[a]\r\nx = 1 # \x85 y\r\n# end"
    assert with_value(text, ("a", "x"), "2", "new") == text.replace("x = 1 # \x85 y", "x = 2  # new")
    assert with_value(text, ("a", "z"), "2", "new") == text.replace("[a]\r\n", "[a]\r\nz = 2  # new\r\n")
    assert with_numbers(text, ("a", "x"), [1.0], "n") == text.replace(
        "x = 1 # \x85 y\r\n", "# n\r\nx = [\r\n    1.0,\r\n]\r\n"
    )
    assert with_value("[a]", ("a", "x"), "1", "c") == "[a]\nx = 1  # c\n"
