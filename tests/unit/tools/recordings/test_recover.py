"""Recovery of damaged recordings: what is intact is kept, what is missing is reported, and nothing is overwritten."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader
from recorded_entries import ABOUT_RUN, entries, write

from slipd.cli import main
from slipd.errors import RecordingError
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.tools.recordings.recover import Recovered, recover


def damaged(folder: Path, change: Callable[[bytearray], object]) -> Path:
    """Write a recording of 60 entries in chunks of 20, damage its bytes, and return its path."""
    path = folder / "damaged.mcap"
    write(path, entries(60), 20)
    data = bytearray(path.read_bytes())
    change(data)
    path.write_bytes(data)
    return path


def chunks(data: bytes) -> list[tuple[int, int]]:
    """Return first byte and last byte + 1 of every chunk."""
    found, place = [], 8
    while data[place] != 0x0F:
        end = place + 9 + struct.unpack_from("<Q", data, place + 1)[0]
        if data[place] == 6:
            found.append((place, end))
        place = end
    return found


def flip(chunk: int, at: int) -> Callable[[bytearray], object]:
    """Return what flips a byte of a chunk: the ``at``-th."""

    def change(data: bytearray) -> None:
        data[chunks(data)[chunk][0] + at] ^= 0xFF

    return change


def recovered(path: Path) -> tuple[Recovered, list]:
    out = path.with_name("out.mcap")
    found = recover(path, out)
    recording = open_recording(out)
    kept = list(recording.entries())
    assert (recording.closed, recording.lost) == (True, found.lost)
    with out.open("rb") as file:
        reader = make_reader(file)
        counts = (len(kept), reader.get_summary().statistics.message_count, len(list(reader.iter_messages())))
        assert counts == (found.entries,) * 3
    return found, kept


def test_a_truncated_recording_gets_an_end_an_index_and_a_summary(tmp_path: Path) -> None:
    def cut(data: bytearray) -> None:
        del data[chunks(data)[2][1] - 5 :]

    path = damaged(tmp_path, cut)
    found, kept = recovered(path)
    assert kept == entries(40)
    size = path.stat().st_size
    [fault] = found.faults
    assert fault.endswith(f"of {size}: the end is missing; how many entries it held is not known")
    recording = open_recording(path.with_name("out.mcap"))
    list(recording.entries())
    assert f"recovered from a file of {size} bytes without an end record" in str(recording.fault)


@pytest.mark.parametrize("at", [0, 5, 60])
def test_entries_behind_a_damaged_chunk_are_recovered_and_the_gap_is_located(tmp_path: Path, at: int) -> None:
    found, kept = recovered(damaged(tmp_path, flip(1, at)))
    assert kept == entries(60)[:20] + entries(60)[40:]
    assert (found.entries, found.lost) == (40, 20)
    assert any("20 entries are missing, from 0.009 s up to 0.020 s: bytes " in fault for fault in found.faults)


def test_a_damaged_end_record_is_reported(tmp_path: Path) -> None:
    def change(data: bytearray) -> None:
        at = data.index(b"\x02\x00\x00\x0060")
        data[at + 4 : at + 6] = b"99"

    found, kept = recovered(damaged(tmp_path, change))
    assert kept == entries(60)
    assert "its end is damaged" in found.faults[0]
    assert "the end is missing" in found.faults[1]


def test_a_damaged_summary_of_a_file_without_its_first_chunk_leaves_nothing(tmp_path: Path) -> None:
    def change(data: bytearray) -> None:
        flip(0, 60)(data)
        data[-80] ^= 1

    path = damaged(tmp_path, change)
    with pytest.raises(RecordingError, match=r"holds no entry that is intact; .*on a channel that was never announced"):
        recover(path, path.with_name("out.mcap"))
    assert not path.with_name("out.mcap").exists()


def test_versions_boot_and_first_index_of_the_run_are_kept(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "run.mcap", ABOUT_RUN._replace(versions={"slipd": "0.0.1"}), first=40)
    for entry in entries(60)[40::2]:
        file.add(*entry)
    file.finish(60)
    recover(tmp_path / "run.mcap", tmp_path / "out.mcap")
    out = open_recording(tmp_path / "out.mcap")
    assert (out.versions, out.first, out.boot) == ({"slipd": "0.0.1"}, 40, ABOUT_RUN.boot)


def test_the_command_prints_what_is_missing_and_where(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = damaged(tmp_path, flip(1, 60))
    assert main(["recover", str(path), os.fspath(path.with_name("out.mcap"))]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{path}: at byte ")
    assert lines[-1] == f"{path.with_name('out.mcap')}: 40 entries, 20 known to be missing"
