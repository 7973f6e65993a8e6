"""What one recording gave with one config, as maps and lists."""

from __future__ import annotations

import json

from replays import RECORDINGS

from slipd.tools.evaluation.config_replay import run_config
from slipd.tools.evaluation.config_run import RECORDED, ConfigRun


def test_a_run_survives_json() -> None:
    run = run_config(RECORDINGS / "demo.mcap", None, RECORDED)
    assert ConfigRun.from_map(json.loads(json.dumps(run.as_map()))) == run
    silent = ConfigRun({}, None, 1.5, "cut off")
    assert ConfigRun.from_map(silent.as_map()) == silent
