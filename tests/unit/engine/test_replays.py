"""Recordings of an earlier version replay to what that version gave out; see ``tests/data/replays/README.md``."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
import replays

import slipd
from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes
from slipd.recording.reader import open_recording

pytestmark = pytest.mark.uncovered

MOST_CALLS = {"wrench": 70, "pad": 100, "Tick": 15}
MESSAGE = {"seq": 4, "level": "stable", "rising": True, "normal_n": 8.25, "centroid_m": [0.001, None], "age_s": None}


@pytest.mark.parametrize("name", replays.NAMES)
def test_a_recorded_run_causes_the_same_messages_replies_and_commands_at_the_same_events(name: str) -> None:
    then, now = replays.stored(name), replays.given(name)
    assert [one[:3] for one in now] == [one[:3] for one in then]
    for n, (was, found) in enumerate(zip(then, now, strict=True)):
        what = f"{was.kind} {n}, {was.name}, of event {was.event}"
        assert list(replays.differences(was.body, found.body)) == [], what


def test_a_reading_an_image_and_a_tick_call_few_functions_in_the_mean() -> None:
    """What is rare is pushed on change, never asked for at each event: calls of Python functions of slipd."""
    recording = open_recording(replays.RECORDINGS / "demo.mcap")
    engine = Engine(config.parse(recording.config_text, "demo"), boot=recording.boot, wall_minus_monotonic_ns=0)
    here, calls, events = str(Path(slipd.__file__).parent), Counter[str](), Counter[str]()

    def count(frame: FrameType, event: str, _: object) -> None:
        calls[kind] += event == "call" and frame.f_code.co_filename.startswith(here)

    for t_ns, event in recording.events():
        kind = event.link.rpartition(".")[2] if isinstance(event, Bytes) else type(event).__name__
        events[kind] += 1
        sys.setprofile(count)
        engine.handle(event, t_ns)
        sys.setprofile(None)
    for kind, most in MOST_CALLS.items():
        assert calls[kind] <= most * events[kind], kind


def test_the_recordings_hold_every_level_acts_of_the_reflex_faults_and_refusals() -> None:
    given = [one for name in replays.NAMES for one in replays.stored(name)]
    messages = [(one.name.partition(".")[0], one.body) for one in given if one.kind == "message"]
    verdicts, grippers = ([body for topic, body in messages if topic == wanted] for wanted in ("slip", "gripper"))
    replies = [one.body for one in given if one.kind == "reply"]
    assert {body["level_code"] for body in verdicts} == set(range(6))
    assert {body["reflex"]["reason"] for body in grippers if body["reflex"]} >= {"needed", "slipping"}
    assert {body["latched_fault"] for body in grippers} >= {"no_answer", "command_lost"}
    assert len({body["error"]["code"] for body in replies if not body["ok"]}) >= 20
    assert {one.kind for one in given} == {"message", "reply", "write", "record"}


def said(text: str) -> dict[str, Any]:
    return {"streams": {"left.pad": {"health": 1, "message": text}}}


@pytest.mark.parametrize(
    ("was", "found", "same"),
    [
        (MESSAGE, MESSAGE | {"normal_n": 8.25 * (1 + 1e-10)}, True),  # rounding
        *(
            (MESSAGE, MESSAGE | change, False)
            for change in (
                {"seq": 5}, {"seq": 4.0}, {"rising": 1}, {"level": "caution"}, {"normal_n": 8.25 * (1 + 1e-8)},
                {"normal_n": None}, {"centroid_m": [0.001]}, {"centroid_m": [0.001, 0.0]}, {"age_s": 0.0}, {"more": 1},
            )
        ),
        # a renamed key, and another order
        (MESSAGE, {{"level": "grade"}.get(key, key): value for key, value in MESSAGE.items()}, False),
        (MESSAGE, dict(sorted(MESSAGE.items())), False),
        # texts for people may be reworded, but not vanish; an axis has no sense
        (said("no images"), said("no image came"), True),
        (said("no images"), said(""), False),
        ({"axis_rad": -1.570796326795}, {"axis_rad": 1.570796326795}, True),
        ({"axis_rad": -1.57}, {"axis_rad": 1.58}, False),
    ],
)  # fmt: skip
def test_the_comparison_notices_any_change_but_rounding_and_words(
    was: dict[str, Any], found: dict[str, Any], same: bool
) -> None:
    assert (list(replays.differences(was, found)) == []) is same
