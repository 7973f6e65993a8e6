from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd_client.terminal import Sheet, paint, spelled


def texts(sheet: Sheet) -> list[str]:
    return [paint(line, sheet.width, colour=False) for line in sheet.lines]


def test_facts_are_packed_and_continue_indented() -> None:
    sheet = Sheet(20, ascii_only=False)
    sheet.facts([("head", "1")], [("one fact", ""), ("another", ""), ("third", "")], indent=4)
    assert texts(sheet) == ["head  one fact", "    another  third"]


def test_a_fact_as_wide_as_the_line_is_not_cut() -> None:
    sheet = Sheet(10, ascii_only=False)
    sheet.facts([("head", "")], [("0123456789", "")])
    assert texts(sheet) == ["head", "0123456789"]


def test_a_remark_follows_the_last_line_where_it_fits() -> None:
    sheet = Sheet(20, ascii_only=False)
    sheet.facts([("stream", "")])
    sheet.remark("stale", "31")
    sheet.remark("no answer for a minute", "31", indent=4)
    assert texts(sheet) == ["stream  stale", "    no answer for a", "    minute"]


def test_no_remark_adds_no_line() -> None:
    sheet = Sheet(20, ascii_only=False)
    sheet.remark("", "31")
    sheet.paragraph("", "31")
    assert sheet.lines == []


def test_a_text_stands_beside_a_picture_of_any_height() -> None:
    sheet = Sheet(20, ascii_only=False)
    beside = sheet.narrower(5)
    beside.facts([], [("one", ""), ("two", "")])
    sheet.beside([[("###", "")], [("###", "")]], 3, beside)
    assert texts(sheet) == ["###  one  two", "###"]
    long = sheet.narrower(15)
    long.facts([], [("one", ""), ("two", "")])
    sheet.beside([[("###", "")]], 3, long)
    assert texts(sheet)[2:] == ["###  one", "     two"]


def test_colours_are_around_what_is_left_of_their_text() -> None:
    line = [("left", "1"), ("WARNING", "31"), ("gone", "32")]
    assert paint(line, 7, colour=True) == "\x1b[1mleft\x1b[0m\x1b[31mWAR\x1b[0m"
    assert paint(line, 7, colour=False) == "leftWAR"


def test_ascii_is_measured_as_it_is_spelled() -> None:
    sheet = Sheet(8, ascii_only=True)
    sheet.facts([("λ", "")], [("≤0", "")])
    assert texts(sheet) == ["load", "<=0"]


@pytest.mark.parametrize(
    ("text", "shown"), [("λ ≤0.70", "load <=0.70"), ("a → b", "a -> b"), ("0.1 N·m", "0.1 N.m"), ("naïve ✓", "na?ve ?")]
)
def test_the_spelling_in_ascii(text: str, shown: str) -> None:
    assert spelled(text, ascii_only=True) == shown
    assert spelled(text, ascii_only=False) == text


@given(st.text(max_size=40), st.integers(1, 30))
def test_any_text_fits_into_ascii_lines(text: str, width: int) -> None:
    sheet = Sheet(width, ascii_only=True)
    sheet.remark(text, "31", indent=10)
    sheet.facts([(text, "")], [(text, "")], indent=4)
    assert "".join(texts(sheet)).isascii()
    assert all(len(line) <= width for line in texts(sheet))
