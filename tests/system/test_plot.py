"""``slipd plot`` on recordings of real daemons: files, output and exit code."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from live_recording import live
from replays import RECORDINGS

from slipd.cli import main
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording

DEMO, REFLEX = str(RECORDINGS / "demo.mcap"), str(RECORDINGS / "reflex.mcap")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_page_is_written_into_this_folder(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        assert main(["plot", DEMO]) == 0
        assert capsys.readouterr().out == "demo.html: written\n"
    assert [path.name for path in here.iterdir()] == ["demo.html"]
    text = (here / "demo.html").read_text(encoding="utf-8")
    assert "Replayed with its own config" in text
    assert re.search(r"left: warning, λ 0\.8", text)


WITHOUT_ENGINE = """
import sys
from slipd.cli import main
main(sys.argv[1:])
assert "slipd.engine.engine" not in sys.modules
"""


def test_what_a_run_reported_itself_is_drawn_without_a_replay(here: Path) -> None:
    run = live(Path(REFLEX), here / "run.mcap")
    subprocess.run([sys.executable, "-c", WITHOUT_ENGINE, "plot", str(run), "--to", "1"], check=True)
    Path("own.toml").write_text(open_recording(run).config_text, encoding="utf-8")
    assert main(["plot", str(run), "--to", "1", "--config", "own.toml", "--out", "replayed.html"]) == 0
    drawn, replayed = (Path(name).read_text(encoding="utf-8") for name in ("run.html", "replayed.html"))
    said = re.compile("<p>(As the run itself reported it|Replayed with)[^<]*</p>")
    assert [found[1] for found in map(said.search, (drawn, replayed)) if found] == [
        "As the run itself reported it",
        "Replayed with",
    ]
    assert said.sub("", drawn) == said.sub("", replayed)


def test_verdicts_of_another_version_are_replayed_and_false_ones_refused(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = live(Path(REFLEX), here / "old.mcap", lambda topic, body: body.pop("mu_low", None))
    assert main(["plot", str(old), "--to", "1"]) == 0
    assert "Replayed with its own config" in Path("old.html").read_text()

    def forge(topic: str, body: dict[str, Any]) -> None:
        if topic == "slip.left" and body["seq"] > 3:
            body["level"] = "<script>"

    forged = live(Path(REFLEX), here / "forged.mcap", forge)
    capsys.readouterr()
    assert main(["plot", str(forged)]) == 1
    assert "forged.mcap: holds a message that slipd cannot have published: " in capsys.readouterr().err
    assert not Path("forged.html").exists()


def test_a_part_of_a_run_is_drawn_with_its_own_times(here: Path) -> None:
    assert main(["plot", DEMO, "--from", "1.5", "--to", "2.5"]) == 0
    text = (here / "demo.html").read_text(encoding="utf-8")
    assert "drawn from 1.5 to 2.5 s." in text
    ticks = [float(tick) for tick in re.findall(r'class="small middle"[^>]*>([\d.]+) s<', text)]
    assert (ticks[0], 2.4 <= ticks[-1] <= 2.5) == (1.5, True)
    begins = [float(begin) for begin in re.findall(r"<title>([\d.]+) to ", text)]
    assert (min(begins) >= 1.5, max(begins) <= 2.5) == (True, True)


@pytest.mark.parametrize(
    ("call", "ends", "told"),
    [
        (["plot", DEMO, "--from", "100"], 1, "demo.mcap: no message after 100 s, the last is at "),
        (
            ["plot", DEMO, "--from", "1", "--to", "1.00001"],
            1,
            "demo.mcap: no two messages from 1 to 1.00001 s, so there is nothing to draw",
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
        (
            ["evaluate", DEMO, "--table", "a"],
            2,
            "slipd evaluate --table FILE is now: slipd evaluate --out FILE.parquet",
        ),
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
    RecordingFile(Path("no_event.mcap"), config_text=text, boot="b", wall_minus_monotonic_ns=0).finish(0)
    before = sorted(here.iterdir())
    assert main(call) == ends
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.out == ""
    assert sorted(here.iterdir()) == before
