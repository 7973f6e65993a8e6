"""What is known of a robot, by its messages and its signs of life."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Iterable
from typing import Any

import pytest

from slipd_client.fleet.fleet_keys import BRIDGE, DAEMON
from slipd_client.fleet.fleet_state import MOST_RUNS, SILENT_AFTER_S, FleetState, RobotRow
from slipd_client.messages import Health, encode


class Robot:
    """One robot, as a bridge forwards it."""

    def __init__(self, state: FleetState, name: str = "arm3", boot: str = "boot-1", peer: str = "") -> None:
        self.state, self.name, self.boot, self.peer = state, name, boot, peer
        self.seq = {"status": 0, "warning": 0}
        self.t_ns = 0

    def joins(self) -> None:
        for what in (BRIDGE, DAEMON):
            self.state.take_token(self.name, what, alive=True)

    def sends(self, topic: str, now_s: float, **fields: Any) -> None:
        self.seq[topic] += 1
        self.t_ns += 1
        header = {"v": 1, "seq": self.seq[topic], "boot": self.boot, "t_ns": self.t_ns}
        self.state.take_message(self.name, topic, encode(header | fields), now_s, self.peer)

    def warns(self, now_s: float, level: str, finger: str = "left", **fields: Any) -> None:
        body = {"finger": finger, "level": level, "previous": "stable", "rising": True, "utilisation": None}
        self.sends("warning", now_s, **(body | fields))

    def row(self, now_s: float) -> RobotRow:
        (row,) = (row for row in self.state.rows(now_s) if row.robot == self.name)
        return row


@pytest.fixture
def robot() -> Robot:
    robot = Robot(FleetState())
    robot.joins()
    return robot


def levels(**fingers: str) -> dict[str, Any]:
    return {finger: {"level": level, "reasons": []} for finger, level in fingers.items()}


def test_a_robot_has_the_level_of_its_worst_finger_and_the_health_of_its_worst_stream(robot: Robot) -> None:
    streams = {"left.pad": {"health": 1, "message": "late"}, "left.wrench": {"health": 3, "message": "nothing arrives"}}
    fingers = levels(left="unknown", right="caution")
    robot.sends("status", 10.0, fingers=fingers, streams=streams, version="1.2", object_name="mug")
    row = robot.row(10.5)
    assert (row.state, row.level, row.age_s, row.version, row.object_name) == ("live", "caution", 0.5, "1.2", "mug")
    assert (row.health, row.complaint) == (Health.STALE, "left.wrench: nothing arrives")
    assert row.fingers == {"left": "unknown", "right": "caution"}


def test_a_warning_counts_at_once_and_an_older_status_that_it_overtook_does_not_undo_it(robot: Robot) -> None:
    robot.sends("status", 10.0, fingers=levels(left="stable"), streams={})
    robot.warns(10.1, "slipping", reasons=["slip_detected"])
    robot.t_ns -= 2
    robot.sends("status", 10.2, fingers=levels(left="stable"), streams={})
    assert (robot.row(10.2).level, robot.row(10.2).reasons) == ("slipping", ("slip_detected",))
    robot.t_ns += 5
    robot.sends("status", 11.2, fingers=levels(left="stable"), streams={})
    assert robot.row(11.2).level == "stable"


def test_a_level_is_unknown_once_the_robot_is_silent_or_gone(robot: Robot) -> None:
    robot.sends("status", 10.0, fingers=levels(left="stable"), streams={})
    assert robot.row(9.9 + SILENT_AFTER_S).state == "live"
    late = robot.row(10.1 + SILENT_AFTER_S)
    assert (late.state, late.level, late.reasons, late.health) == ("silent", "unknown", ("stale",), None)
    assert late.fingers == {"left": "stable"}
    robot.state.take_token("arm3", DAEMON, alive=False)
    assert robot.row(10.1).state == "silent"
    robot.state.take_token("arm3", BRIDGE, alive=False)
    assert robot.row(10.1).state == "gone"
    robot.joins()
    assert robot.row(10.1).state == "live"


def test_what_a_bridge_kept_of_a_daemon_that_is_silent_has_no_age() -> None:
    robot = Robot(FleetState())
    robot.state.take_token("arm3", BRIDGE, alive=True)
    robot.sends("status", 10.0, fingers=levels(left="stable"), streams={})
    assert (robot.row(10.0).state, robot.row(10.0).age_s) == ("silent", None)


def test_missed_warnings_and_restarts_are_counted(robot: Robot) -> None:
    robot.warns(10.0, "warning")
    robot.seq["warning"] += 3
    robot.warns(10.1, "stable")
    assert robot.row(10.1).missed_warnings == 3
    robot.boot, robot.seq = "boot-2", {"status": 0, "warning": 0}
    robot.sends("status", 10.2, fingers=levels(right="stable"), streams={})
    row = robot.row(10.2)
    assert (row.restarts, row.fingers, row.missed_warnings) == (1, {"right": "stable"}, 3)


def test_a_message_that_comes_again_or_cannot_be_read_changes_nothing(robot: Robot) -> None:
    robot.warns(10.0, "warning")
    robot.seq["warning"] -= 1
    robot.warns(11.0, "stable")
    assert robot.state.take_message("arm3", "warning", b"\xc1", 11.0) is None
    assert (robot.row(10.5).level, robot.state.unread) == ("warning", 1)


def test_robots_beyond_the_bound_are_counted_and_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipd_client.fleet.fleet_state.MOST_ROBOTS", 1)
    state = FleetState()
    Robot(state, "arm1").sends("status", 1.0, fingers={}, streams={})
    Robot(state, "arm2").joins()
    Robot(state, "arm2").sends("status", 1.0, fingers={}, streams={})
    assert ([row.robot for row in state.rows(1.0)], state.unread) == (["arm1"], 1)


def test_a_status_that_lags_behind_a_warning_of_the_next_run_is_no_second_restart(robot: Robot) -> None:
    """The listener takes all warnings first, and only then each status."""
    robot.sends("status", 10.0, fingers=levels(left="stable"), streams={})
    before, robot.seq = dict(robot.seq), {"status": 0, "warning": 0}
    robot.boot = "boot-2"
    robot.warns(11.0, "caution")
    new, robot.seq, robot.boot = dict(robot.seq), before, "boot-1"
    robot.sends("status", 11.0, fingers=levels(left="stable"), streams={})
    robot.seq, robot.boot = new, "boot-2"
    robot.sends("status", 12.0, fingers=levels(left="caution"), streams={})
    assert (robot.row(12.0).restarts, robot.row(12.0).level) == (1, "caution")


def test_warnings_kept_from_an_earlier_run_are_no_further_restart_and_hide_no_loss() -> None:
    """A view that joins late may get the newest status before the kept warnings."""
    robot = Robot(FleetState(), boot="boot-2")
    robot.joins()
    robot.sends("status", 10.0, fingers=levels(left="stable"), streams={})
    robot.boot = "boot-1"
    robot.warns(10.1, "warning")
    robot.boot, robot.seq["warning"] = "boot-2", 0
    robot.warns(10.1, "caution")
    robot.sends("status", 11.0, fingers=levels(left="caution"), streams={})
    robot.seq["warning"] += 2
    robot.warns(11.1, "warning")
    row = robot.row(11.1)
    assert (row.restarts, row.missed_warnings, row.level) == (1, 2, "warning")


def test_a_robot_that_restarts_for_ever_takes_no_more_memory_and_every_restart_counts(robot: Robot) -> None:
    def restarts(times: int) -> int:
        for _ in range(times):
            robot.boot, robot.seq = f"boot-{robot.t_ns}", {"status": 0, "warning": 0}
            robot.sends("status", 10.0 + robot.t_ns, fingers=levels(left="stable"), streams={})
        return len(pickle.dumps(robot.state))

    few = restarts(2 * MOST_RUNS)
    assert restarts(20 * MOST_RUNS) < 1.5 * few
    assert robot.row(10.0).restarts == 22 * MOST_RUNS - 1


def speak(robots: Iterable[Robot], times: Iterable[float], level: str = "stable") -> None:
    """Every robot reports once a second, one after the other."""
    for now_s, (place, robot) in itertools.product(times, enumerate(robots)):
        robot.sends("status", now_s + 0.1 * place, fingers=levels(left=level), streams={})


def twins(count: int = 2) -> list[Robot]:
    """Robots that call themselves arm3."""
    state = FleetState()
    robots = [Robot(state, boot=f"boot-{number}") for number in range(1, count + 1)]
    robots[0].joins()
    return robots


def test_two_robots_of_one_name_are_a_fault_and_not_a_level() -> None:
    well, ill = twins()
    speak([ill, well], [10.0, 11.0, 12.0])
    row = well.row(12.1)
    assert (row.state, row.level, row.reasons) == ("clash", "unknown", ("name_clash",))
    assert row.fault.startswith("two or more robots call themselves arm3: give each a name of its own")
    assert row.missed_warnings == 0


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_robots_of_one_name_the_healthier_is_never_shown(order: int) -> None:
    well, ill = twins()
    for now_s in range(10, 20):
        for robot in [well, ill][::order]:
            level, health = ("stable", 0) if robot is well else ("slipping", 2)
            streams = {"left.pad": {"health": health, "message": "late"}}
            robot.sends("status", now_s, fingers=levels(left=level), streams=streams)
        row = well.row(now_s)
        assert (row.level, row.fingers, row.health) == ("slipping", {"left": "slipping"}, Health.ERROR)
        well.warns(now_s + 0.5, "stable")
        assert well.row(now_s + 0.5).level == "slipping"


def test_a_clash_ends_with_the_other_robot_of_the_name() -> None:
    first, second = twins()
    speak([first, second], [10.0, 11.0, 12.0, 13.0])
    speak([first], [14.0, 15.0])
    assert first.row(15.1).state == "clash"
    speak([first], [16.0, 17.0])
    row = first.row(17.1)
    assert (row.state, row.level, row.fault) == ("live", "stable", "")


def test_a_restart_is_no_clash_also_where_a_late_status_of_the_run_before_arrives(robot: Robot) -> None:
    speak([robot], [10.0, 11.0])
    late = Robot(robot.state)
    late.seq, late.t_ns = dict(robot.seq), robot.t_ns
    robot.boot, robot.seq = "boot-2", {"status": 0, "warning": 0}
    speak([robot], [11.5])
    speak([late], [12.0])
    speak([robot], [12.5, 13.5, 14.5])
    assert [robot.row(14.5).state, robot.row(14.5).restarts] == ["live", 1]


def test_more_robots_of_one_name_than_are_remembered_are_a_clash_too() -> None:
    robots = twins(3 * MOST_RUNS)
    for now_s in range(10, 20):
        for place, robot in enumerate(robots):
            robot.sends("status", now_s + 0.01 * place, fingers=levels(left="stable"), streams={})
    assert robots[0].row(20.0).state == "clash"


@pytest.mark.parametrize("signs_of_life_alone", [False, True])
def test_Z9_made_up_names_of_one_session_leave_room_for_the_robots_of_others(
    signs_of_life_alone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipd_client.fleet.fleet_state.MOST_ROBOTS", 100)
    state = FleetState()
    Robot(state, "early", peer="a").joins()
    Robot(state, "early", peer="a").sends("status", 0.0, fingers=levels(left="stable"), streams={})
    for number in range(120):
        made_up = Robot(state, f"made-up-{number}", peer="flood")
        made_up.joins()
        if not signs_of_life_alone:
            made_up.sends("status", 0.0, fingers=levels(left="stable"), streams={})
    assert len(state.rows(0.0)) == 100
    late = Robot(state, "late", peer="b")
    late.joins()
    late.sends("status", 1.0, fingers=levels(left="stable"), streams={})
    late.sends("status", 2.0, fingers=levels(left="stable"), streams={})
    late.warns(2.1, "slipping")
    assert (late.row(2.1).state, late.row(2.1).level) == ("live", "slipping")
    names = [row.robot for row in state.rows(2.1)]
    assert (len(names), "early" in names) == (100, True)


@pytest.mark.parametrize("most", [3, 100])
def test_Z9_a_named_robot_is_listed_from_the_beginning_and_never_displaced(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipd_client.fleet.fleet_state.MOST_ROBOTS", most)
    named = ["arm1", "arm2", "arm3"]
    state = FleetState(named)
    assert [(row.robot, row.state, row.level) for row in state.rows(0.0)] == [
        (name, "gone", "unknown") for name in named
    ]
    for peer in range(60):  # sessions with two robots each, of which the first claims the name of a robot
        for name in ("arm1", f"made-up-{peer}"):
            robot = Robot(state, name, boot=f"boot-{peer}", peer=f"peer-{peer}")
            robot.joins()
            robot.sends("status", 0.0, fingers=levels(left="stable"), streams={})
    robot = Robot(state, "arm3", peer="honest")
    robot.joins()
    robot.sends("status", 1.0, fingers=levels(left="stable"), streams={})
    robot.warns(1.1, "slipping")
    assert (robot.row(1.1).state, robot.row(1.1).level) == ("live", "slipping")
    rows = state.rows(1.1)
    assert {row.robot for row in rows if row.expected} == set(named)
    assert len(rows) == min(most, 63)


def test_what_cannot_be_read_makes_no_row() -> None:
    state = FleetState()
    assert state.take_message("arm3", "status", b"no message", 0.0) is None
    assert (state.rows(0.0), state.unread) == ([], 1)
