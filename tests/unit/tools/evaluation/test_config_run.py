"""What one recording gave with one config, as maps and lists."""

from __future__ import annotations

import json
from typing import Any

import pytest
from replays import RECORDINGS

from slipd.tools.evaluation.config_replay import run_config
from slipd.tools.evaluation.config_run import RECORDED, ConfigRun, StreamHealth, with_status


def test_a_run_survives_json() -> None:
    run = run_config(RECORDINGS / "demo.mcap", None, RECORDED)
    for each in (run, ConfigRun({}, None, 1.5, "cut off")):
        assert ConfigRun.from_map(json.loads(json.dumps(each.as_map()))) == each


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
