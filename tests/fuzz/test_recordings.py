"""Damaged recordings, and that the judge finds what is misread; `make fuzz` tries every byte."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz.extent import ROUNDS, SEED
from fuzz.recordings import SMALL_BYTES, Judge, unchanged_bytes_decoded_once, write_recording


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> Judge:
    folder = tmp_path_factory.mktemp("damaged")
    write_recording(folder / "whole.mcap", SMALL_BYTES)
    return Judge(folder / "whole.mcap", folder)


def test_K2_a_recording_that_is_cut_off_is_read_up_to_there_or_refused(judge: Judge) -> None:
    with unchanged_bytes_decoded_once():
        found = judge.cut(range(0, len(judge.data), max(101 // ROUNDS, 1)))
    assert found.misread == []
    assert found.harmless == 0
    assert found.ended > 100


def test_K4_a_recording_with_a_changed_byte_is_never_misread(judge: Judge) -> None:
    with unchanged_bytes_decoded_once():
        found = judge.flip(range(50, len(judge.data), max(151 // ROUNDS, 1)), SEED)
    assert found.misread == []
    assert found.ended > 100


def test_decoding_unchanged_bytes_once_finds_the_same(judge: Judge) -> None:
    places = range(70, len(judge.data), 499)
    with unchanged_bytes_decoded_once():
        once = judge.cut(places), judge.flip(places, SEED)
    assert once == (judge.cut(places), judge.flip(places, SEED))


@pytest.mark.parametrize("place", [0, 100, -1])
def test_the_judge_finds_what_is_misread(judge: Judge, tmp_path: Path, place: int) -> None:
    write_recording(tmp_path / "other.mcap", SMALL_BYTES)
    other = Judge(tmp_path / "other.mcap", tmp_path)
    del other._entries[place]
    assert len(other.cut([len(other.data)]).misread) == 1
