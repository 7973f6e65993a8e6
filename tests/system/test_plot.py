"""``slipd plot`` on recordings of real daemons: files, output and exit code."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from altered_recordings import live
from replays import RECORDINGS

from slipd.cli import main
from slipd.recording.mcap_file import RecordingFile, RunHead
from slipd.recording.reader import open_recording

DEMO, XELA = str(RECORDINGS / "demo.mcap"), str(RECORDINGS / "xela.mcap")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_page_is_written_into_this_folder_and_replaces_an_earlier_one(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        assert main(["plot", XELA]) == 0
        assert capsys.readouterr().out == "xela.html: written\n"
    assert [path.name for path in here.iterdir()] == ["xela.html"]
    text = (here / "xela.html").read_text(encoding="utf-8")
    assert "Replayed with its own config" in text
    assert re.search(r"left: warning, λ \d", text)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The demo with the messages that it published."""
    return str(live(Path(DEMO), tmp_path_factory.mktemp("run") / "run.mcap"))


WITHOUT_ENGINE = """
import sys
from slipd.cli import main
main(sys.argv[1:])
assert "slipd.engine.engine" not in sys.modules
"""


def test_what_a_run_reported_itself_is_drawn_without_a_replay(run: str) -> None:
    subprocess.run([sys.executable, "-c", WITHOUT_ENGINE, "plot", run], check=True)
    Path("own.toml").write_text(open_recording(Path(run)).config_text, encoding="utf-8")
    assert main(["plot", run, "--config", "own.toml", "--out", "replayed.html"]) == 0
    drawn, replayed = (Path(name).read_text(encoding="utf-8") for name in ("run.html", "replayed.html"))
    said = re.compile("<p>(As the run itself reported it|Replayed with)[^<]*</p>")
    assert [found[1] for found in map(said.search, (drawn, replayed)) if found] == [
        "As the run itself reported it",
        "Replayed with",
    ]
    assert said.sub("", drawn) == said.sub("", replayed)


def test_verdicts_of_another_version_are_replayed_and_false_ones_refused(capsys: pytest.CaptureFixture[str]) -> None:
    live(Path(XELA), Path("old.mcap"), lambda topic, body: body.pop("mu_low", None))
    assert main(["plot", "old.mcap"]) == 0
    assert "Replayed with its own config" in Path("old.html").read_text()
    false = {"level": "<script>"}
    live(Path(XELA), Path("forged.mcap"), lambda topic, body: body.update(false if body["seq"] > 3 else {}))
    assert main(["plot", "forged.mcap"]) == 1
    assert "forged.mcap: holds a message that slipd cannot have published: " in capsys.readouterr().err
    assert not Path("forged.html").exists()


def test_a_part_of_a_run_is_drawn_with_its_own_times(here: Path, run: str) -> None:
    assert main(["plot", run, "--from", "1.5", "--to", "2.5"]) == 0
    text = (here / "run.html").read_text(encoding="utf-8")
    assert "drawn from 1.5 to 2.5 s." in text
    ticks = [float(tick) for tick in re.findall(r'class="small middle"[^>]*>([\d.]+) s<', text)]
    assert (ticks[0], 2.4 <= ticks[-1] <= 2.5) == (1.5, True)
    begins = [float(begin) for begin in re.findall(r"<title>([\d.]+) to ", text)]
    assert (min(begins) >= 1.5, max(begins) <= 2.5) == (True, True)


def test_two_runs_are_drawn_side_by_side_on_the_time_axis_of_the_longer_one(here: Path, run: str) -> None:
    assert main(["plot", XELA, "--beside", run]) == 0
    _, *both = (here / "xela.html").read_text(encoding="utf-8").split("<section>")
    assert ["xela.mcap</h1>" in both[0], "run.mcap</h1>" in both[1]] == [True, True]
    ticks = [re.findall(r'class="small middle"[^>]*>([\d.]+) s<', each) for each in both]
    assert ticks[0] == ticks[1]
    assert both[0].count("<rect") < both[1].count("<rect"), "each has its own spans"


@pytest.mark.parametrize(
    ("call", "ends", "told"),
    [
        (["plot", XELA, "--from", "100"], 1, "xela.mcap: no message after 100 s, the last is at "),
        (
            ["plot", XELA, "--from", "1", "--to", "1.00001"],
            1,
            "xela.mcap: no two messages from 1 to 1.00001 s, so there is nothing to draw",
        ),
        (["plot", DEMO, "--from", "2", "--to", "1"], 2, "slipd: --from 2 must be before --to 1"),
        (["plot", "no_event.mcap"], 1, "slipd: no_event.mcap: no events in it, so there is nothing to draw"),
        (["plot", DEMO, "--config", "none.toml"], 2, "none.toml: cannot be read: No such file"),
        (["plot", DEMO, "--config", "bad.toml"], 2, "bad.toml:2: finger.left.mu: must be from 0.01 to 2, got 9"),
        (["plot", DEMO, "--out", "none/a.html"], 2, "slipd: none/a.html: cannot be written: No such file or directory"),
        (
            ["plot", DEMO, "--out", "folder.html"],
            2,
            "slipd: folder.html: is a folder, and is not overwritten; give another name",
        ),
        (["evaluate", DEMO, "--config", "none.toml"], 2, "none.toml: cannot be read: No such file"),
        (["evaluate", DEMO, "--config", "bad.toml"], 2, "bad.toml:2: finger.left.mu: must be from 0.01 to 2, got 9"),
        (["evaluate", DEMO, "--out", "none/a.parquet"], 2, "none/a.parquet: cannot be written: No such file"),
        (["plot", DEMO, "--out", "/proc/a.html"], 2, "slipd: /proc/a.html: cannot be written: "),
    ],
)
def test_what_is_wrong_is_told_and_nothing_is_left_behind(
    call: list[str],
    ends: int,
    told: str,
    here: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(here))
    Path("bad.toml").write_text("[finger.left]\nmu = 9.0\n")
    Path("folder.html").mkdir()
    text = open_recording(Path(DEMO)).config_text
    RecordingFile(Path("no_event.mcap"), RunHead(text, "b", 0)).finish(0)
    before = sorted(here.iterdir())
    assert main(call) == ends
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.out == ""
    assert sorted(here.iterdir()) == before
