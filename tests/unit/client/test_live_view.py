"""What the view in a terminal shows of fingers, gripper, streams and recordings."""

from __future__ import annotations

import re
from typing import Any

import pytest
from shown_rig import GRIPPER, SLIP, STATUS, STREAM, drawn

from slipd_client.live_view import LiveView, change_line
from slipd_client.live_view_format import clock_time
from slipd_client.live_view_lines import LEVEL_COLOURS
from slipd_client.messages import LEVELS
from slipd_client.terminal import Terminal


def test_a_finger_shows_level_utilisation_forces_and_reasons() -> None:
    text = drawn(slip_left=SLIP)
    assert re.search(r"left +WARNING +λ +0\.50 +█{10}▒{5}·{5} +0\.50 to 0\.75 ", text)
    for part in ("normal 10.12 N", "tangential 3.50 N", "spin 0.0123 N·m", "mu 0.60", "needs 14.2 N"):
        assert part in text
    assert text.endswith("rotation, tipping")


@pytest.mark.parametrize("field", ["normal_n", "tangential_n", "spin_nm", "mu", "grip_needed_n"])
@pytest.mark.parametrize("unknown", [None, [], [None, 1.0]])
def test_a_quantity_that_is_not_known_is_a_dash_and_never_zero(field: str, unknown: Any) -> None:
    assert drawn(slip_left=SLIP | {field: unknown}).count("–") == 1 + drawn(slip_left=SLIP).count("–")


@pytest.mark.parametrize(
    ("known", "shown"),
    [
        ({}, "–"),
        ({"utilisation_upper": 0.4}, "≤0.40"),
        ({"utilisation_lower": 1.2}, "≥1.20"),
        ({"utilisation": 0.3, "utilisation_upper": 0.4}, "0.30"),
    ],
)
def test_a_bounded_utilisation_shows_its_bound(known: dict[str, float], shown: str) -> None:
    text = drawn(slip_left={"finger": "left", "level": "unknown", **known})
    assert re.search(rf"λ +{shown} ", text)


def test_without_a_coefficient_the_relative_utilisation_is_shown() -> None:
    unknown = {
        "mu": None,
        "mu_source": "none",
        "utilisation": None,
        "utilisation_lower": None,
        "utilisation_upper": None,
    }
    grown = {"required_friction": 0.306, "carried_friction": 0.36, "relative_utilisation": 0.85}
    text = drawn(slip_left=SLIP | unknown | grown)
    assert re.search(r"left +WARNING +λr +0\.85 +▒{17}·{3} ", text)
    assert "mu – none  requires 0.31 of 0.36 carried  needs 14.2 N" in text
    assert re.search(r"λ +– +·{20} .* mu – none  needs", drawn(slip_left=SLIP | unknown)), "nothing carried yet"


def test_the_source_of_the_coefficient_is_shown() -> None:
    assert "mu 0.60 learned  needs" in drawn(slip_left=SLIP | {"mu_source": "learned", "required_friction": 0.3})
    finger = {"level": "stable", "tare_id": 2, "tare_busy": False, "mu": 0.5, "mu_source": "config"}
    assert "tare 2  mu 0.50 config" in drawn(status=STATUS | {"fingers": {"left": finger}})


def test_the_evidence_of_motion_is_shown_after_the_reasons() -> None:
    moving = {"reasons": ["no_mu"], "evidence": ["load_drop", "width"]}
    assert drawn(slip_left=SLIP | moving).endswith("no_mu  moves by load_drop, width")
    assert drawn(slip_left=SLIP | moving | {"reasons": []}).endswith("\n          moves by load_drop, width")
    assert change_line(SLIP | moving | {"previous": "stable"}).endswith("(no_mu; moves by load_drop, width)")


def test_the_named_object_is_shown() -> None:
    assert drawn(status=STATUS | {"object_name": "mug"}).splitlines()[0].endswith("lease held  object mug")


def test_a_utilisation_beyond_one_fills_the_bar_and_no_more() -> None:
    assert "█" * 20 + "  0.50 to 9.00  normal" in drawn(slip_left=SLIP | {"utilisation": 7.0, "utilisation_upper": 9.0})


def test_an_empty_daemon_is_all_dashes() -> None:
    assert drawn() == "slipd –  up –  lease –"


def test_status_shows_the_daemon_its_fingers_and_its_streams() -> None:
    lines = drawn(status=STATUS).splitlines()
    assert lines[0] == "slipd 0.1.0  up 75 s  config 3f2a  lease held"
    reply = {key: value for key, value in STATUS.items() if key != "config_id"}
    assert drawn(status=reply).splitlines()[0] == "slipd 0.1.0  up 75 s  lease held"
    assert re.match(r"left +CAUTION +λ +– ", lines[1])
    assert re.match(r"right +UNKNOWN +λ +– ", lines[2])
    assert re.match(r"left\.wrench +WARN +998 Hz of 1000 Hz  age 2 ms  bad 3  lost 0  reconnects 2", lines[3])
    assert lines[3].endswith("3 bad frames")


def test_the_verdict_of_a_finger_stands_above_what_status_tells_of_it() -> None:
    assert "WARNING" in drawn(slip_left=SLIP, status=STATUS).splitlines()[1]


def test_the_gripper_shows_width_force_and_limit() -> None:
    text = drawn(gripper=GRIPPER)
    assert "width 42.5 mm  force 12.0 N of at most 40.0 N  at rest  object contact_closing" in text
    assert "fault" not in text
    assert "echo" not in text


def test_the_gripper_shows_its_fault_and_a_missing_echo() -> None:
    text = drawn(gripper=GRIPPER | {"fault": "overcurrent", "echo_ok": False, "width_m": None, "moving": None})
    assert "fault overcurrent  does not repeat the command" in text
    assert "width –" in text
    assert "at rest" not in text


def test_a_latched_fault_is_shown_until_it_is_acknowledged() -> None:
    assert "latched: no_echo" in drawn(gripper=GRIPPER | {"latched_fault": "no_echo"})
    assert "latched" not in drawn(gripper=GRIPPER | {"latched_fault": ""})


def test_status_alone_shows_the_gripper_too() -> None:
    assert "force 12.0 N of at most 40.0 N" in drawn(status={"gripper": GRIPPER})
    assert "gripper" not in drawn(status={"gripper": None})


def test_a_silent_daemon_has_no_level() -> None:
    text = drawn(slip_left=SLIP | {"level": "stable"}, silent_s=5.0)
    assert text.startswith("no message for 5.0 s")
    assert "STABLE" not in text
    assert "UNKNOWN" in text


def test_every_level_has_a_colour_of_its_own() -> None:
    assert set(LEVEL_COLOURS) == set(LEVELS)
    assert len(set(LEVEL_COLOURS.values())) == len(LEVELS)


@pytest.mark.parametrize("level", LEVELS)
def test_the_level_is_drawn_in_its_colour(level: str) -> None:
    view = LiveView()
    view.update("slip.left", SLIP | {"level": level})
    assert f"\x1b[{LEVEL_COLOURS[level]}m{level.upper()}" in view.render(Terminal(200, colour=True))[1]


def test_a_text_of_the_daemon_cannot_steer_the_terminal() -> None:
    hostile = "\x1b[2J\n\x9b5m"
    bodies = {
        "status": {"version": hostile, "streams": {hostile: STREAM | {"message": hostile}}},
        "gripper": GRIPPER | {"fault": hostile, "object": hostile},
        f"slip.{hostile}": SLIP | {"level": hostile, "reasons": [hostile]},
    }
    view = LiveView()
    for topic, body in bodies.items():
        view.update(topic, body)
    assert all(line.isprintable() for line in [*view.render(Terminal(500)), view.summary()])
    assert change_line(SLIP | {"previous": hostile, "finger": hostile}).isprintable()


def test_a_finger_that_the_daemon_no_longer_has_vanishes() -> None:
    view = LiveView()
    for finger in ("left", "right", "thumb"):
        view.update(f"slip.{finger}", SLIP | {"finger": finger, "boot": "one"})
    view.update("gripper", GRIPPER | {"boot": "one"})
    view.update("status", STATUS | {"boot": "one", "gripper": None})
    text = "\n".join(view.render(Terminal(200)))
    assert "thumb" not in text
    assert "thumb" not in view.summary()
    assert re.search("^left", text, re.MULTILINE)
    assert re.search("^right", text, re.MULTILINE)
    assert "gripper" not in text


def test_what_another_run_of_the_daemon_said_vanishes() -> None:
    view = LiveView()
    view.update("slip.thumb", SLIP | {"boot": "one"})
    view.update("gripper", GRIPPER | {"boot": "one"})
    view.update("slip.left", SLIP | {"boot": "two"})
    text = "\n".join(view.render(Terminal(200)))
    assert "thumb" not in text
    assert "gripper" not in text
    assert "left" in text


@pytest.mark.parametrize(
    ("recording", "shown"),
    [
        ({"running": True, "state": "running", "path": "/state/a.mcap", "lost": 0}, r"OK +/state/a\.mcap$"),
        (
            {"running": True, "state": "running", "path": "/state/a.mcap", "lost": 9},
            r"OK +/state/a\.mcap +9 entries lost$",
        ),
        (
            {"state": "failed", "path": "/state/a.mcap", "failure": "/state/a.mcap: full"},
            r"FAILED +/state/a\.mcap: full$",
        ),
        (
            {"state": "limited", "path": "/state/a.mcap", "failure": "/state/a.mcap: max"},
            r"ENDED +/state/a\.mcap: max$",
        ),
        ({"running": False, "name": "a.mcap", "failure": "of an older daemon"}, r"FAILED +of an older daemon$"),
        ({"state": "stopped", "path": "/state/a.mcap", "failure": None}, None),
        ({"state": "none"}, None),
    ],
)
def test_a_recording_is_shown_with_its_path_while_it_runs_and_where_it_failed(
    recording: dict[str, Any], shown: str | None
) -> None:
    text = drawn(status=STATUS | {"recording": recording})
    assert bool(re.search("^recording", text, re.MULTILINE)) == (shown is not None)
    if shown is not None:
        assert re.search(r"^recording +" + shown, text, re.MULTILINE)
        whole_run = drawn(status=STATUS | {"run_recording": recording})
        assert re.search("^recording", whole_run, re.MULTILINE)
        assert ("of the whole run" in whole_run) == (not recording.get("failure"))


def test_forces_without_calibration_are_not_shown_as_newtons() -> None:
    body = SLIP | {"force_unit": "uncalibrated"}
    view = LiveView()
    view.update("slip.left", body)
    text = view.render(Terminal(200))[1]
    assert "normal 10.12  tangential 3.50  spin 0.0123  mu 0.60  needs 14.2" in text
    assert view.summary().endswith("λ 0.50 10.12")


def test_the_summary_names_every_finger_in_one_line() -> None:
    view = LiveView()
    assert view.summary() == "–  no verdict yet"
    view.update("slip.left", SLIP)
    view.update(
        "slip.right", SLIP | {"level": "stable", "utilisation": None, "utilisation_upper": None, "normal_n": None}
    )
    time_of_day, left, right = re.fullmatch(r"(\S+)  (.*)  \|  (.*)", view.summary()).groups()
    assert time_of_day.endswith(".250")
    assert (left, right) == ("left warning λ 0.50 10.12 N", "right stable λ ≥0.50 –")


def test_a_change_of_level_is_one_line() -> None:
    line = change_line(SLIP | {"previous": "stable", "rising": True})
    assert line.endswith("  left stable → warning  (rotation, tipping)")
    assert change_line({}) == "–  – – → –"


def test_a_time_out_of_range_is_a_dash() -> None:
    assert [clock_time(value) for value in (0.0, 1e300, float("inf"))] == ["–", "–", "–"]


def test_incidents_are_shown_where_they_are_kept() -> None:
    assert "incidents" not in drawn(status=STATUS)
    counts = {"saved": 2, "not_saved": 0, "lost": 0, "dropped": 0, "path": "/state/a.mcap", "failure": None}
    text = drawn(status=STATUS | {"incidents": counts})
    assert re.search(r"^incidents +OK +2 saved +0 not saved  /state/a.mcap$", text, re.MULTILINE)
    counts |= {"not_saved": 1, "lost": 7, "dropped": 30, "failure": "/state/b.mcap: not saved: disk full"}
    text = drawn(status=STATUS | {"incidents": counts})
    missing = "7 entries lost, 30 entries dropped"
    failed = "/state/b.mcap: not saved: disk full"
    assert re.search(rf"^incidents +FAILED +2 saved +1 not saved  {failed}  {missing}$", text, re.MULTILINE)
