"""The command as a person calls it: results, refusals, damaged recordings."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_entries import small_disk
from replays import RECORDINGS

from slipd import cli
from slipd.recording.mcap_file import RecordingFile, RunHead
from slipd.tools.cli_arguments import EXPORTS as FORMATS

RUN = RECORDINGS / "xela.mcap"

WRITTEN = dict.fromkeys(FORMATS, "50 messages of slipd") | {"lerobot": "15 frames of 1 episode"}


def export(*arguments: Path | str, to: str) -> int:
    rate = ("--rate", "10") if to == "lerobot" else ()
    return cli.main(["export", *map(str, arguments), "--to", to, *rate])


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


@pytest.mark.parametrize("to", FORMATS)
def test_an_export_that_exists_is_refused_unless_it_may_be_overwritten(
    to: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    for option in ((), ("--overwrite",)):
        assert export(RUN, out, *option, to=to) == 0
        assert capsys.readouterr().out == f"{out}: written, {WRITTEN[to]}\n"
        assert export(RUN, out, to=to) == 2
        assert capsys.readouterr().err == f"slipd: {out}: exists already; give a new name, or --overwrite\n"
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize(("to", "size"), [*((to, 1000) for to in FORMATS), ("lerobot", 20_000)])
def test_a_disk_that_is_full_leaves_nothing_behind(
    to: str, size: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_disk(size):
        assert export(RUN, tmp_path / "out", to=to) == 1
    assert capsys.readouterr().err == f"slipd: {tmp_path / 'out'}: cannot be written: File too large\n"
    assert names(tmp_path) == []


def test_a_recording_without_an_event_is_refused(tmp_path: Path, rig: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "empty.mcap"
    recording = RecordingFile(file, RunHead(rig, "b", 0))
    recording.finish(0)
    recording.close()
    assert export(file, tmp_path / "out", to="ros2") == 1
    assert capsys.readouterr().err == f"slipd: {file}: holds no event that causes a message\n"
    assert names(tmp_path) == ["empty.mcap"]


def test_a_format_that_does_not_exist_is_refused_with_those_that_do(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        export("a", "b", to="xlsx")
    assert "invalid choice: 'xlsx' (choose from" in capsys.readouterr().err
