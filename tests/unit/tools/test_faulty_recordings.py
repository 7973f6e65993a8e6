"""What every command does with a recording that stopped before its run did, and with a file that is none."""

from __future__ import annotations

from pathlib import Path

import pytest
from altered_recordings import begun_like
from replays import RECORDINGS

from slipd.cli import main
from slipd.recording.mcap_file import EVENTS
from slipd.recording.reader import open_recording

COMMANDS: dict[str, tuple[str, ...]] = {
    "info": (),
    "replay": ("--speed", "max"),
    "evaluate": (),
    "plot": ("--out", "out.html"),
    "export": ("out", "--to", "csv"),
}
OF_WHOLE_RECORDINGS = {"recover": ("out",), "identify": ("--finger", "left"), "view": ("--listen", "127.0.0.1:0")}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_a_recording_that_stopped_is_used_as_far_as_it_goes_and_its_texts_control_no_terminal(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = open_recording(RECORDINGS / "bota.mcap")
    file, events = begun_like(whole, Path("run.mcap")), list(whole.events())
    for n, (t_ns, event) in enumerate(events):
        file.add(n, t_ns, EVENTS, event)
    file.finish(len(events), "the \x1b]0;owned\x07 disk")
    assert main([name, "run.mcap", *COMMANDS[name]]) == 1
    said = capsys.readouterr()
    assert "the recording stopped before the run did (the \\x1b]0;owned\\x07 disk)" in said.out + said.err
    assert "\x1b" not in said.out + said.err
    assert said.out != "", "what there is"


@pytest.mark.parametrize("name", [*COMMANDS, *OF_WHOLE_RECORDINGS])
def test_what_is_no_recording_is_refused_by_its_name_and_nothing_is_written(
    name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("foreign.mcap").write_bytes(b"time,force\n1,2\n")
    call = {**COMMANDS, **OF_WHOLE_RECORDINGS}[name]
    missing = 1 if name == "evaluate" else 2
    for file, code, why in (("foreign", 1, "not an MCAP file"), ("none", missing, "cannot be opened: No such file")):
        assert main([name, f"{file}.mcap", *call]) == code
        assert f"slipd: {file}.mcap: {why}" in capsys.readouterr().err
    assert {path.name for path in here.iterdir()} - {"cache"} == {"foreign.mcap"}
