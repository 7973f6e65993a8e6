"""All that README promises of the demo, in simulated time: the same on every machine, however busy it is.

The robot program of the demo, the engine and the virtual gripper are the real ones; their clock, their lines and their
sockets are stepped by the test. `tests/system/test_demo.py` runs the same as processes.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from short_stories import BOOT, PAD_HZ, PLAN, RATES, SCRIPT, SEED, SLOW, WALL_NS
from stepped_demo import SteppedDemo

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Request
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.demo_summary import print_summary
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.robot_program import RobotProgram
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.virtual_gripper import VirtualRig
from slipd_client.messages import encode


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[SteppedDemo, RobotProgram, Path]:
    """The whole demo, its robot program included, and its recording."""
    path = tmp_path_factory.mktemp("demo") / "demo.mcap"
    text = config.shipped("demo.toml").read_text(encoding="utf-8") + RATES
    for old, new in SLOW:
        text = text.replace(old, new)
    rig = VirtualRig(Scene(SCRIPT), SEED, PvdfElectronics(rate_hz=PAD_HZ))
    engine = Engine(config.parse(text, path.name), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    file = RecordingFile(path, config_text=text, boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    demo = SteppedDemo(rig, engine, 0.0, PLAN, file)
    program = RobotProgram("", "", PLAN)
    demo.play(program)
    file.finish(demo.events)
    return demo, program, path


@pytest.fixture(scope="module")
def truth(played: tuple[SteppedDemo, RobotProgram, Path]) -> list[dict[str, Any]]:
    """What the virtual gripper reports of the scene, as its process prints it."""
    return played[0].events_of_scene


def at(truth: list[dict[str, Any]], event: str) -> int:
    return next(int(each["t_ns"]) for each in truth if each["event"] == event)


def test_the_program_warns_raises_the_grip_and_lets_go(played: tuple[SteppedDemo, RobotProgram, Path]) -> None:
    _, program, _ = played
    assert (program.report.error, program.report.refusals) == ("", [])
    assert set(program.report.tares) == {"left", "right"}
    assert None not in (program.report.closed_ns, program.report.opened_ns)


def test_the_warning_for_rotation_comes_before_the_rotation_and_the_raised_grip_holds(
    played: tuple[SteppedDemo, RobotProgram, Path], truth: list[dict[str, Any]]
) -> None:
    warned = played[1].report.rotation_warning
    forecast = next(each["rotation_would_begin_s"] for each in truth if each["event"] == "forecast")
    assert 0.2 < forecast - (warned.t_ns - truth[0]["t_ns"]) * 1e-9 < 1.0
    slid = [each for each in truth if each["event"] == "slide_begins"]
    assert [each["load_spin_nm"] for each in slid] == [0.0], "only the tug moves it: the raised grip held the rotation"
    assert not [each for each in truth if each["event"] == "dropped"]


def test_the_grip_request_is_granted_and_visible_in_the_measured_force(
    played: tuple[SteppedDemo, RobotProgram, Path],
) -> None:
    *_, raised = played[1].report.raises
    assert raised.before_n is not None
    assert raised.after_n is not None
    assert raised.after_n > played[1].report.raises[0].before_n + 1.0
    assert raised.after_n >= 0.95 * raised.result["applied_n"]


def test_the_slip_is_reported_within_a_few_tens_of_milliseconds(
    played: tuple[SteppedDemo, RobotProgram, Path], truth: list[dict[str, Any]]
) -> None:
    reported = played[1].report.slip_report
    assert 0 <= reported.received_ns - at(truth, "slide_begins") < 50_000_000


def test_the_summary_states_all_of_it(
    played: tuple[SteppedDemo, RobotProgram, Path], truth: list[dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    demo, program, _ = played
    print_summary(demo.tally, program.report, truth)
    shown = capsys.readouterr().out
    for line in (
        r"truth    slide_begins \(",
        r"slipd    left: warning \(rotation\)",
        r"granted [\d.]+ N; measured [\d.]+ N → [\d.]+ N",
        r"rotation: warned 0\.\d+ s before it would have begun",
        r"slip: reported \d+ ms after it began",
        r"^readings: [1-9]\d{3} \(0 bad, 0 lost\)",
        r"^messages: \d+ \(\d+ grasp, \d+ gripper, \d+ motion, \d+ slip",
        r"^warnings: [1-9]\d* \(unknown: \d+; changes of level: \d+\)",
        r"^gaps: 0$",
    ):
        assert re.search(line, shown, re.MULTILINE), (line, shown)
    assert "NOT AS EXPECTED" not in shown


def test_a_replay_gives_the_messages_byte_for_byte(played: tuple[SteppedDemo, RobotProgram, Path]) -> None:
    recording = open_recording(played[2])
    asked = {event.body["op"] for _, event in recording.events() if isinstance(event, Request)}
    assert asked >= {"tare", "gripper.close", "grip.set", "lease.renew", "gripper.open"}
    live = list(recording.messages())
    assert recording.complete
    assert len(live) > 300
    assert [(topic, encode(body)) for topic, body in replay(open_recording(played[2]))] == live
