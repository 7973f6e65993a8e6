"""The command as a person calls it: results, refusals, damaged recordings."""

from __future__ import annotations

import resource
import shutil
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd import cli
from slipd.recording.entry_walk import Entered
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.tools.cli_arguments import EXPORTS as FORMATS

RUN = RECORDINGS / "demo.mcap"


WRITTEN = dict.fromkeys(FORMATS, "677 messages of slipd") | {"lerobot": "47 frames of 1 episode"}


def export(*arguments: Path | str, to: str) -> int:
    rate = ("--rate", "10") if to == "lerobot" else ()
    return cli.main(["export", *map(str, arguments), "--to", to, *rate])


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


@pytest.mark.parametrize("to", FORMATS)
def test_an_export_that_exists_is_refused_unless_it_may_be_overwritten(
    to: str, tmp_path: Path, exported: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    copy = shutil.copytree if exported[to].is_dir() else shutil.copy
    copy(exported[to], out)
    assert export(RUN, out, to=to) == 2
    assert capsys.readouterr().err == f"slipd: {out}: exists already; give a new name, or --overwrite\n"
    assert export(RUN, out, "--overwrite", to=to) == 0
    assert capsys.readouterr().out == f"{out}: written, {WRITTEN[to]}\n"
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize(("to", "size"), [*((to, 8192) for to in FORMATS), ("lerobot", 40_000)])
def test_a_disk_that_is_full_leaves_nothing_behind(
    to: str, size: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        assert export(RUN, tmp_path / "out", to=to) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert capsys.readouterr().err == f"slipd: {tmp_path / 'out'}: cannot be written: File too large\n"
    assert names(tmp_path) == []


def test_a_truncated_recording_is_exported_up_to_its_end_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    half = tmp_path / "half.mcap"
    half.write_bytes(RUN.read_bytes()[: RUN.stat().st_size * 3 // 4])
    assert export(half, tmp_path / "out", to="csv") == 1
    shown = capsys.readouterr()
    assert shown.out.startswith(f"{tmp_path / 'out'}: written, ")
    assert shown.err.startswith(f"slipd: the export is incomplete: {half}: was cut off in the record at byte ")
    assert (tmp_path / "out" / "slip.left.csv").exists()


@pytest.mark.parametrize(
    ("content", "error"),
    [
        (None, "cannot be opened: No such file or directory"),
        (b"", "is empty: the writer ended before it wrote anything"),
        (b"time,force\n1,2\n", "not an MCAP file, and so not a recording of slipd"),
        (b"bag", "an MCAP file, but not a recording of slipd"),
        (b"start", "was cut off in the record at byte "),
    ],
)
def test_what_is_no_recording_is_refused_and_nothing_is_written(
    content: bytes | None, error: str, tmp_path: Path, exported: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "run.mcap"
    if content == b"bag":
        shutil.copy(next(exported["ros2"].glob("*.mcap")), file)
    elif content == b"start":
        file.write_bytes(RUN.read_bytes()[:200])
    elif content is not None:
        file.write_bytes(content)
    assert export(file, tmp_path / "out", to="ros2") == (2 if content is None else 1)
    assert f"{file}: {error}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_recording_without_an_event_is_refused(tmp_path: Path, rig: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "empty.mcap"
    recording = RecordingFile(file, config_text=rig, boot="b", wall_minus_monotonic_ns=0)
    recording.finish(0)
    recording.close()
    assert export(file, tmp_path / "out", to="ros2") == 1
    assert capsys.readouterr().err == f"slipd: {file}: holds no event that causes a message\n"
    assert names(tmp_path) == ["empty.mcap"]


def test_a_format_of_before_is_answered_with_what_to_type(capsys: pytest.CaptureFixture[str]) -> None:
    for to, told in (("xlsx", "must be one of ros2, csv, parquet, lerobot, got 'xlsx'"), ("json-mcap", "--to ros2")):
        with pytest.raises(SystemExit):
            export("a", "b", to=to)
        assert told in capsys.readouterr().err


def edited(path: Path, *, year: int = 0, jump_s: int = 0, stopped: str = "") -> Path:
    """Write the run with another wall clock, a jump of its monotonic one, or a reason why it stopped."""
    recording = open_recording(RUN)
    file = RecordingFile(
        path,
        config_text=recording.config_text,
        boot=recording.boot,
        wall_minus_monotonic_ns=recording.wall_minus_monotonic_ns + year * 365 * 86_400 * 10**9,
    )
    events = [entry for entry in recording.entries() if isinstance(entry, Entered)]
    for n, entry in enumerate(events):
        file.event(n, entry.t_ns + (jump_s * 10**9 if n > len(events) // 2 else 0), entry.event)
    file.finish(len(events), stopped)
    return path


def test_a_jump_of_years_ends_an_export_for_learning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = edited(tmp_path / "run.mcap", jump_s=10**8)
    assert export(run, tmp_path / "out", to="lerobot") == 1
    assert f"slipd: {run}: a gap of an episode may last at most 3600 s" in capsys.readouterr().err
    assert names(tmp_path) == ["run.mcap"]


def test_recorded_texts_are_printed_without_control_characters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    run = edited(tmp_path / "run.mcap", stopped="the \x1b]0;owned\x07 disk")
    for command in (
        ["evaluate", run],
        ["export", run, tmp_path / "out", "--to", "csv"],
        ["plot", run, "--out", tmp_path / "p.html"],
    ):
        assert cli.main([*map(str, command)]) == 1
        said = capsys.readouterr()
        assert "\\x1b]0;owned\\x07" in said.err
        assert "\x1b" not in said.out + said.err
