"""``slipd info``: what a recording holds."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from live_recording import live
from lossy_recording import lossy
from replays import RECORDINGS

from slipd import config
from slipd.cli import main
from slipd.events import Bytes
from slipd.recording.reader import open_recording

DEMO = RECORDINGS / "demo.mcap"


def test_what_a_run_holds_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = live(DEMO, tmp_path / "run.mcap")
    assert main(["info", str(run), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    recording = open_recording(run)
    messages, events = list(recording.messages()), list(recording.events())
    assert {topic: each["messages"] for topic, each in found["topics"].items()} == {
        topic: sum(name == topic for name, _ in messages) for topic, _ in messages
    }
    assert found["length_s"] == pytest.approx((events[-1][0] - events[0][0]) * 1e-9)
    assert found["topics"]["slip.left"]["rate_hz"] == pytest.approx(20.0, rel=0.5)
    assert (found["complete"], found["fault"], found["gaps"], found["boot"]) == (True, "", [], "b")
    assert found["config_id"] == config.parse(recording.config_text, "a").config_id
    assert found["streams"]["left.wrench"] == {"device": "bota", "rate_hz": 200.0}
    pads = [event.data for _, event in events if isinstance(event, Bytes) and event.link == "left.pad"]
    assert found["links"]["left.pad"]["bytes"] == sum(map(len, pads))
    assert found["links"]["left.pad"]["reads_hz"] == pytest.approx(len(pads) / found["length_s"])
    assert found["events"]["Bytes"] == sum(type(event).__name__ == "Bytes" for _, event in events)
    assert found["changes_to_level"]["slipping"] == 2

    assert main(["info", str(run)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"recording: {run}"
    assert lines[2] == "complete:  yes"
    assert "    left.wrench: bota, 200 Hz in the config" in "\n".join(lines)
    assert any(line.startswith("changes of level to: ") and "slipping 2" in line for line in lines)


def test_what_is_missing_is_stated_and_the_answer_is_no(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(lossy(DEMO, tmp_path))]) == 1
    shown = capsys.readouterr().out
    assert "complete:  no: " in shown
    assert re.search(r"^gap: +nothing is known from (0\.99|1\.00)\d to (1\.99|2\.00)\d s$", shown, re.MULTILINE)
