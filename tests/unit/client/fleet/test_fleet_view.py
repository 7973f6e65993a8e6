"""A fleet as lines, as changes, and as JSON."""

from __future__ import annotations

import json
from typing import Any

from slipd_client.fleet.fleet_command import change_text, fleet_lines, fleet_map
from slipd_client.fleet.fleet_state import RobotRow
from slipd_client.messages import Health
from slipd_client.terminal import Terminal


def row(robot: str, **fields: Any) -> RobotRow:
    known: dict[str, Any] = {
        "state": "live",
        "level": "stable",
        "fingers": {"left": "stable"},
        "reasons": (),
        "health": Health.OK,
        "complaint": "",
        "fault": "",
        "age_s": 0.4,
        "missed_warnings": 0,
        "restarts": 0,
        "version": "1",
        "object_name": "",
    }
    return RobotRow(robot=robot, **(known | fields))


GONE = row("arm2", state="gone", level="unknown", reasons=("stale",), health=None, age_s=None)
SLIPPING = row("arm3", level="slipping", fingers={"left": "slipping", "right": "stable"}, reasons=("slip_detected",))
ILL = row("arm4", health=Health.STALE, complaint="left.pad: nothing arrives", missed_warnings=2)


def test_the_most_urgent_robot_comes_first_and_the_head_counts() -> None:
    lines = fleet_lines("plant", [row("arm1"), GONE, SLIPPING, ILL], 0, Terminal())
    assert lines[0] == "fleet plant  4 robots  1 gone  3 live  1 slipping  2 warnings missed"
    assert lines[1].split() == ["robot", "state", "level", "health", "age"]
    assert [line.split()[0] for line in lines[2:]] == ["arm3", "arm2", "arm4", "arm1"]
    assert lines[2].split(maxsplit=6)[1:] == [
        "live",
        "slipping",
        "OK",
        "0.4",
        "s",
        "left slipping, right stable; slip_detected",
    ]
    assert lines[3].split(maxsplit=5)[1:] == ["gone", "unknown", "–", "–", "last: left stable"]
    assert lines[4].endswith("left stable; left.pad: nothing arrives; 2 warnings missed")


def test_robots_of_one_name_are_told_and_their_alarm_counts() -> None:
    fault = "two or more robots call themselves arm5: do this"
    lines = fleet_lines("plant", [row("arm5", state="clash", level="slipping", fault=fault)], 0, Terminal())
    assert lines[0] == "fleet plant  1 robot  1 clash  1 slipping"
    assert lines[2].split(maxsplit=6)[1:] == ["clash", "slipping", "OK", "0.4", "s", f"{fault}; left stable"]


def test_a_log_has_a_line_for_each_change_and_none_without() -> None:
    assert change_text(None, row("arm1")) == "arm1: live, stable"
    assert change_text(row("arm1"), row("arm1", age_s=0.9)) == ""
    assert change_text(row("arm3"), SLIPPING) == "arm3: stable → slipping  (left slipping, right stable; slip_detected)"
    assert change_text(row("arm2"), GONE) == "arm2: live → gone, stable → unknown, OK → –  (last: left stable)"


def test_json_has_every_field() -> None:
    told = json.loads(json.dumps(fleet_map("plant", [GONE, ILL], 1)))
    assert (told["fleet"], told["unread"]) == ("plant", 1)
    assert [each["health"] for each in told["robots"]] == [None, "STALE"]
    assert told["robots"][1]["missed_warnings"] == 2
