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


def test_robots_that_are_not_named_come_last_whatever_they_claim() -> None:
    claims = row("made-up", level="slipping", expected=False)
    lines = fleet_lines("plant", [claims, row("arm1"), GONE], 0, Terminal())
    assert [line.split()[0] for line in lines[2:]] == ["arm2", "arm1", "made-up"]
    assert "not one of --robots" in lines[4]
    assert fleet_lines("plant", [claims, row("arm1"), GONE], 0, Terminal(lines=4))[-1] == "2 more"
    assert [each["expected"] for each in fleet_map("plant", [claims, row("arm1")], 0)["robots"]] == [True, False]


def test_robots_without_room_are_counted() -> None:
    lines = fleet_lines("plant", [row(f"arm{n}") for n in range(10)], 3, Terminal(columns=60, lines=5))
    assert lines[0].endswith("3 messages not read")
    assert lines[-1] == "8 more, all less urgent"
    assert len(lines) == 5
    assert max(map(len, lines)) <= 60


def test_a_terminal_without_unicode_gets_ascii() -> None:
    assert all(line.isascii() for line in fleet_lines("plant", [GONE], 0, Terminal(ascii_only=True)))


def test_a_fleet_without_robots_is_one_line() -> None:
    assert fleet_lines("plant", [], 0, Terminal()) == ["fleet plant  0 robots"]
    assert fleet_lines("plant", [GONE], 0, Terminal())[0] == "fleet plant  1 robot  1 gone"


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
