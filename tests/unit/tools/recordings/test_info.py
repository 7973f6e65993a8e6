"""``slipd info``: what a recording holds."""

from __future__ import annotations

import json
import re
from collections import Counter
from datetime import datetime
from pathlib import Path

import pytest
from altered_recordings import live, lossy
from replays import RECORDINGS

from slipd import config
from slipd.cli import main
from slipd.events import Bytes
from slipd.recording.reader import open_recording
from slipd.tools.recordings.info import _lines, recording_info

DEMO = RECORDINGS / "demo.mcap"


def test_what_a_run_holds_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = live(RECORDINGS / "xela.mcap", tmp_path / "run.mcap")
    recording = open_recording(run)
    topics = Counter(topic for topic, _ in recording.messages())
    events = list(recording.events())
    length_s = (events[-1][0] - events[0][0]) * 1e-9
    data = [event.data for _, event in events if isinstance(event, Bytes)]
    link = {"reads": len(data), "reads_hz": pytest.approx(len(data) / length_s), "bytes": len(b"".join(data))}
    assert main(["info", str(run), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    begun = datetime.fromisoformat(found.pop("begun")).timestamp()
    assert begun == pytest.approx((events[0][0] + recording.wall_minus_monotonic_ns) * 1e-9, abs=1e-3)
    assert found == {
        "recording": str(run),
        "bytes": run.stat().st_size,
        "complete": True,
        "fault": "",
        "length_s": pytest.approx(length_s),
        "gaps": [],
        "boot": recording.boot,
        "config_id": config.parse(recording.config_text, "a").config_id,
        "config_fault": "",
        "streams": {"left.pad": {"device": "xela", "rate_hz": 20.0}},
        "links": {"left.pad": link},
        "versions": recording.versions,
        "events": Counter(type(event).__name__ for _, event in events),
        "topics": {
            topic: {"messages": count, "rate_hz": pytest.approx(count / length_s)} for topic, count in topics.items()
        },
        "changes_to_level": {"no_contact": 2, "stable": 1, "caution": 1, "warning": 1},
    }
    assert main(["info", str(run)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {
        f"recording: {run}",
        "complete:  yes",
        "    left.pad: xela, 20 Hz in the config",
        "changes of level to: no_contact 2, stable 1, caution 1, warning 1",
    } <= set(lines)


def test_what_is_missing_is_stated_with_what_repairs_it_and_the_answer_is_no(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(lossy(DEMO, tmp_path))]) == 1
    shown = capsys.readouterr().out
    assert ("complete:  no: " in shown, "slipd recover" in shown) == (True, False), "there is nothing to recover"
    (tmp_path / "cut.mcap").write_bytes(DEMO.read_bytes()[:-1000])
    assert main(["info", str(tmp_path / "cut.mcap")]) == 1
    assert f"slipd recover {tmp_path}/cut.mcap OUT writes all that is intact" in capsys.readouterr().out
    assert main(["recover", str(tmp_path / "cut.mcap"), str(tmp_path / "whole.mcap")]) == 0
    assert main(["info", str(tmp_path / "whole.mcap")]) == 1
    assert "slipd recover" not in capsys.readouterr().out
    assert re.search(r"^gap: +nothing is known from (0\.99|1\.00)\d to (1\.99|2\.00)\d s$", shown, re.MULTILINE)
    found = recording_info(open_recording(DEMO)) | {"gaps": [[k, k + 0.5] for k in range(500)]}
    assert "           nor in 497 more gaps, 248.500 s in all (--json has each)" in _lines(found, repairable=False)
