"""All that README promises of the demo, in simulated time: the same on every machine, however busy it is.

The robot program of the demo, the engine and the virtual gripper are the real ones; their clock, their lines and their
sockets are stepped by the test. `tests/system/test_demo.py` runs the same as processes.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from short_stories import record
from stepped_demo import SteppedDemo

from slipd.events import Request
from slipd.recording.reader import open_recording
from slipd.tools.demo_summary import Tally, print_summary
from slipd.tools.sim.robot_program import Report, RobotProgram
from slipd_client.messages.topics import SlipWarning

Played = tuple[SteppedDemo, RobotProgram, Path]
Truth = list[dict[str, Any]]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    """The whole demo, its robot program included, and its recording."""
    path = tmp_path_factory.mktemp("demo") / "demo.mcap"
    return *record("demo", path, with_messages=True), path


@pytest.fixture(scope="module")
def truth(played: Played) -> Truth:
    """What the virtual gripper reports of the scene, as its process prints it."""
    return played[0].events_of_scene


def test_the_program_grips_raises_the_grip_and_lets_go(played: Played) -> None:
    report = played[1].report
    assert (report.error, report.refusals, set(report.tares)) == ("", [], {"left", "right"})
    assert None not in (report.closed_ns, report.opened_ns)
    first, *_, last = report.raises
    assert last.after_n > first.before_n + 1.0, "what was granted shows in the measured force"
    assert last.after_n >= 0.95 * last.result["applied_n"]


def test_the_warning_for_rotation_comes_before_the_rotation_and_the_slip_is_reported_at_once(
    played: Played, truth: Truth
) -> None:
    report = played[1].report
    forecast = next(each["rotation_would_begin_s"] for each in truth if each["event"] == "forecast")
    assert 0.2 < forecast - (report.rotation_warning.t_ns - truth[0]["t_ns"]) * 1e-9 < 1.0
    (slid,) = (each for each in truth if each["event"] == "slide_begins")
    assert slid["load_spin_nm"] == 0.0, "only the tug moves it: the raised grip held the rotation"
    assert 0 <= played[0].heard_ns[report.slip_report.seq] - slid["t_ns"] < 50_000_000
    assert "dropped" not in {each["event"] for each in truth}


def test_the_summary_states_all_of_it(played: Played, truth: Truth, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_the_requests_of_the_program_are_recorded(played: Played) -> None:
    recording = open_recording(played[2])
    asked = {event.body["op"] for _, event in recording.events() if isinstance(event, Request)}
    assert asked >= {"tare", "gripper.close", "grip.set", "lease.renew", "gripper.open"}
    assert recording.complete


BEGIN: dict[str, Any] = {"t_s": 0.0, "t_ns": 0, "event": "begin"}
HOLD: dict[str, Any] = {"t_s": 10.0, "t_ns": 10**10, "event": "hold"}


def warned(*reasons: str, level: str = "warning") -> SlipWarning:
    told: dict[str, Any] = {"t_ns": 1, "finger": "left", "level": level, "previous": "stable", "reasons": reasons}
    return SlipWarning(topic="warning", raw={}, seq=1, boot="", rising=True, utilisation=0.9, **told)


def test_a_scene_without_its_warnings_is_explained_by_what_the_machine_lost(capsys: pytest.CaptureFixture[str]) -> None:
    end = {"t_s": 18.0, "t_ns": 18 * 10**9, "event": "end", "dropped_bytes": {"left-pad": 300, "left-wrench": 12}}
    print_summary(Tally(missed=7), Report(refusals=["deadline_passed"]), [BEGIN, HOLD, end])
    told = capsys.readouterr().out
    for words in (
        "warnings: 0 (",
        "NOT AS EXPECTED: the rotation was not warned of\n",
        "this machine was too busy: 312 bytes of the sensors were not read in time, 7 messages were missed, "
        "1 requests were too late or refused",
        "end other programs that compute, then run the demo again",
    ):
        assert words in told
    slid = {"t_s": 13.0, "t_ns": 13 * 10**9, "event": "slide_begins"}
    print_summary(Tally(), Report(changes=[warned("rotation")]), [BEGIN, HOLD, slid])
    assert "NOT AS EXPECTED: the slip was not reported\n" in capsys.readouterr().out


def test_a_scene_that_went_as_it_should_or_ended_early_is_no_fault(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(Tally(missed=7), Report(changes=[warned("rotation")]), [BEGIN, HOLD])
    assert "NOT AS EXPECTED" not in capsys.readouterr().out
    print_summary(Tally(), Report(), [BEGIN])
    told = capsys.readouterr().out
    assert "ended before the box would turn: no warning is due yet" in told
    assert "busy" not in told
