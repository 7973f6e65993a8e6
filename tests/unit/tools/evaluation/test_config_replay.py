"""One recording, replayed with its own config and with others: what it gives, and how that is kept."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from altered_recordings import lossy
from replays import RECORDINGS

from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.evaluation.config_run import (
    NOT_RECORDED,
    RECORDED,
    ConfigRun,
    Largest,
    StreamHealth,
    run_config,
    with_status,
)

DEMO, GRIPS = RECORDINGS / "demo.mcap", RECORDINGS / "import_grips.mcap"
Write = Callable[..., Path]


def levels(run: ConfigRun, finger: str = "left") -> list[str]:
    found = [span.level for span in run.spans[finger]]
    return [level for before, level in zip(["unknown", *found], found, strict=False) if level != before]


def test_another_config_changes_what_is_reported(config_file: Write) -> None:
    text = config_file("demo", "a.toml", ("mu = 0.55", "mu = 0.8")).read_text()
    recorded, other = levels(run_config(DEMO, None, RECORDED)), levels(run_config(DEMO, text, "a.toml"))
    assert recorded.index("warning") < recorded.index("slipping")
    assert "warning" not in other[: other.index("slipping")], "the slip comes without a warning"


def test_the_zero_of_a_pad_stays_that_of_the_recording(config_file: Write) -> None:
    """A tare is measured, not chosen: that of another trial would read loads that are none."""
    text = config_file("import_grips", "a.toml").read_text()
    head, _, tail = text.partition("tare = [")
    without = head + tail[tail.index("\n]\n") + 3 :]
    other = text.replace("16456.3", "12456.3").replace("37526.9", "31526.9")
    recorded, *others = (run_config(GRIPS, each, "a.toml").spans for each in (None, without, other))
    assert others == [recorded, recorded]


def test_a_level_does_not_hold_where_entries_are_lost(tmp_path: Path) -> None:
    run = run_config(lossy(DEMO, tmp_path), None, RECORDED)
    assert "lost" in run.fault
    for spans in run.spans.values():
        (lost,) = [span for span in spans if span.reasons == (NOT_RECORDED,)]
        assert (lost.level, lost.begin_s, lost.end_s) == (
            "unknown",
            pytest.approx(1.0, abs=0.02),
            pytest.approx(2.0, abs=0.1),
        )
        assert not [span for span in spans if span is not lost and span.begin_s < 1.98 and span.end_s > 1.02]


def test_the_largest_utilisation_is_that_of_the_replay_and_a_run_survives_json() -> None:
    recording = open_recording(RECORDINGS / "xela.mcap")
    begin_s = next(recording.events())[0] * 1e-9
    slips = [body for topic, body in replay(recording) if topic == "slip.left" and body["utilisation"] is not None]
    worst = max(slips, key=lambda body: body["utilisation"])
    run = run_config(recording.path, None, RECORDED)
    assert run.largest == Largest(worst["utilisation"], "left", pytest.approx(worst["t_ns"] * 1e-9 - begin_s))
    assert run.spans["left"][0].begin_s == pytest.approx(slips[0]["t_ns"] * 1e-9 - begin_s, abs=1.0)
    for each in (run, ConfigRun({}, None, 1.5, "cut off")):
        assert ConfigRun.from_map(json.loads(json.dumps(asdict(each)))) == each


@pytest.mark.parametrize(
    ("messages", "health"),
    [
        ([(3, None, 0), (0, 100, 0), (2, 200, 1), (0, 500, 3)], 2),
        ([(3, None, 0), (2, 0, 0)], 2),
        ([(3, 0, 0), (0, 100, 0)], 0),
    ],
    ids=["the worst since the first reading", "the last without a reading", "well from the first reading on"],
)
def test_the_health_of_a_stream_counts_from_its_first_reading_and_its_counts_are_the_last(
    messages: list[tuple[int, int | None, int]], health: int
) -> None:
    found: dict[str, StreamHealth] = {}
    for state, samples, bad in messages:
        stream: dict[str, Any] = {"health": state, "samples": samples, "bad": bad, "lost": 0, "dropped": None}
        found = with_status(found, {"streams": {"left.wrench": stream | {"reconnects": 1}}})
    _, samples, bad = messages[-1]
    assert found == {"left.wrench": StreamHealth("left.wrench", health, samples or 0, bad, 0, 0, 1)}
