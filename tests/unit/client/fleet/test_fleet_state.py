"""What is known of a robot, by its messages and its signs of life."""

from __future__ import annotations

import itertools
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
        self.seq: dict[str, dict[str, int]] = {}
        self.t_ns = 0

    def joins(self) -> None:
        for what in (BRIDGE, DAEMON):
            self.state.take_token(self.name, what, alive=True)

    def sends(self, topic: str, now_s: float, **fields: Any) -> None:
        seq = self.seq.setdefault(self.boot, {"status": 0, "warning": 0})
        seq[topic] += 1
        self.t_ns += 1
        header = {"v": 1, "seq": seq[topic], "boot": self.boot, "t_ns": self.t_ns}
        self.state.take_message(self.name, topic, encode(header | fields), now_s, self.peer)

    def reports(self, now_s: float, level: str = "stable", **fields: Any) -> None:
        self.sends("status", now_s, **({"fingers": levels(left=level), "streams": {}} | fields))

    def warns(self, now_s: float, level: str, **fields: Any) -> None:
        body = {"finger": "left", "level": level, "previous": "stable", "rising": True, "utilisation": None}
        self.sends("warning", now_s, **(body | fields))

    def row(self, now_s: float) -> RobotRow:
        (row,) = (row for row in self.state.rows(now_s) if row.robot == self.name)
        return row

    def restarts(self, boot: str) -> None:
        self.boot = boot

    def loses(self, topic: str, count: int) -> None:
        """Some messages do not arrive; a negative count: the last ones come again."""
        self.seq[self.boot][topic] += count

    def overtakes(self, count: int) -> None:
        """What is sent next is older than what was sent last."""
        self.t_ns -= count

    def ends(self, what: str) -> None:
        self.state.take_token(self.name, what, alive=False)


@pytest.fixture
def robot() -> Robot:
    robot = Robot(FleetState())
    robot.joins()
    return robot


def levels(**fingers: str) -> dict[str, Any]:
    return {finger: {"level": level, "reasons": []} for finger, level in fingers.items()}


STREAMS = {"left.pad": {"health": 1, "message": "late"}, "left.wrench": {"health": 3, "message": "nothing arrives"}}
UNWELL = {
    "fingers": levels(left="unknown", right="caution"),
    "streams": STREAMS,
    "version": "1.2",
    "object_name": "mug",
}
REPORTS, WARNS, RESTARTS, LOSES, ENDS = Robot.reports, Robot.warns, Robot.restarts, Robot.loses, Robot.ends


@pytest.mark.parametrize(
    ("events", "now_s", "expected"),
    [
        pytest.param(
            [(REPORTS, 10.0, "", UNWELL)],
            10.5,
            {"state": "live", "level": "caution", "age_s": 0.5, "version": "1.2",
             "health": Health.STALE, "complaint": "left.wrench: nothing arrives",
             "fingers": {"left": "unknown", "right": "caution"}},
            id="the worst finger and the worst stream count",
        ),
        pytest.param(
            [(REPORTS, 10.0), (WARNS, 10.1, "slipping", {"reasons": ["slip_detected"]}),
             (Robot.overtakes, 2), (REPORTS, 10.2)],
            10.2,
            {"level": "slipping", "reasons": ("slip_detected",)},
            id="a status that a warning overtook does not undo it",
        ),
        pytest.param(
            [(REPORTS, 10.0), (WARNS, 10.1, "slipping"), (REPORTS, 11.2)],
            11.2,
            {"level": "stable"},
            id="a newer status does",
        ),
        pytest.param([(REPORTS, 10.0)], 9.9 + SILENT_AFTER_S, {"state": "live"}, id="just not silent"),
        pytest.param(
            [(REPORTS, 10.0)],
            10.1 + SILENT_AFTER_S,
            {"state": "silent", "level": "unknown", "reasons": ("stale",), "fingers": {"left": "stable"}},
            id="silent",
        ),
        pytest.param([(REPORTS, 10.0), (ENDS, DAEMON)], 10.1, {"state": "silent"}, id="without a daemon"),
        pytest.param([(REPORTS, 10.0), (ENDS, BRIDGE)], 10.1, {"state": "gone"}, id="without a bridge"),
        pytest.param(
            [(REPORTS, 10.0), (ENDS, BRIDGE), (Robot.joins,)], 10.1, {"state": "live"}, id="back again"
        ),
        pytest.param(
            [(WARNS, 10.0, "warning"), (LOSES, "warning", 3), (WARNS, 10.1, "stable"),
             (RESTARTS, "boot-2"), (REPORTS, 10.2, "", {"fingers": levels(right="stable")})],
            10.2,
            {"restarts": 1, "fingers": {"right": "stable"}, "missed_warnings": 3},
            id="lost warnings and restarts are counted",
        ),
        pytest.param(
            [(WARNS, 10.0, "warning"), (LOSES, "warning", -1), (WARNS, 11.0, "stable")],
            10.5,
            {"level": "warning", "missed_warnings": 0},
            id="a message that comes again changes nothing",
        ),
        pytest.param(  # the listener takes all warnings first, and only then each status
            [(REPORTS, 10.0), (RESTARTS, "boot-2"), (WARNS, 11.0, "caution"), (RESTARTS, "boot-1"),
             (REPORTS, 11.0), (RESTARTS, "boot-2"), (REPORTS, 12.0, "caution")],
            12.0,
            {"restarts": 1, "level": "caution"},
            id="a status that lags behind a warning of the next run is no second restart",
        ),
        pytest.param(  # a view that joins late may get the newest status before the kept warnings
            [(RESTARTS, "boot-2"), (REPORTS, 10.0), (RESTARTS, "boot-1"), (WARNS, 10.1, "warning"),
             (RESTARTS, "boot-2"), (WARNS, 10.1, "caution"), (REPORTS, 11.0, "caution"),
             (LOSES, "warning", 2), (WARNS, 11.1, "warning")],
            11.1,
            {"restarts": 1, "missed_warnings": 2, "level": "warning"},
            id="warnings kept of an earlier run are no further restart and hide no loss",
        ),
        pytest.param(
            [*((REPORTS, now_s) for now_s in (10.0, 11.0)), (RESTARTS, "boot-2"), (REPORTS, 11.5),
             (RESTARTS, "boot-1"), (REPORTS, 12.0), (RESTARTS, "boot-2"),
             *((REPORTS, now_s) for now_s in (12.5, 13.5, 14.5))],
            14.5,
            {"state": "live", "restarts": 1},
            id="a restart is no clash, also where a late status of the run before arrives",
        ),
    ],
)  # fmt: skip
def test_what_a_robot_sends_gives_its_row(
    robot: Robot, events: list[tuple[Any, ...]], now_s: float, expected: dict[str, Any]
) -> None:
    for what, *arguments in events:
        fields = arguments.pop() if arguments and isinstance(arguments[-1], dict) else {}
        what(robot, *arguments, **fields)
    row = robot.row(now_s)
    assert {name: getattr(row, name) for name in expected} == expected


def test_what_a_bridge_kept_of_a_daemon_that_is_silent_has_no_age_and_what_cannot_be_read_no_row() -> None:
    robot = Robot(FleetState())
    assert robot.state.take_message("arm3", "status", b"no message", 0.0) is None
    assert (robot.state.rows(0.0), robot.state.unread) == ([], 1)
    robot.state.take_token("arm3", BRIDGE, alive=True)
    robot.reports(10.0)
    assert (robot.row(10.0).state, robot.row(10.0).age_s) == ("silent", None)


def twins(count: int = 2) -> list[Robot]:
    """Robots that call themselves arm3."""
    state = FleetState()
    robots = [Robot(state, boot=f"boot-{number}") for number in range(1, count + 1)]
    robots[0].joins()
    return robots


def speak(robots: Iterable[Robot], times: Iterable[float]) -> None:
    """Every robot reports once a second, one after the other."""
    for now_s, (place, robot) in itertools.product(times, enumerate(robots)):
        robot.reports(now_s + 0.01 * place)


@pytest.mark.parametrize("count", [2, 3 * MOST_RUNS])
def test_robots_of_one_name_are_a_fault_and_not_a_level_until_the_others_are_gone(count: int) -> None:
    robots = twins(count)
    speak(robots, map(float, range(10, 20)))
    row = robots[0].row(19.5)
    assert (row.state, row.level, row.reasons, row.missed_warnings) == ("clash", "unknown", ("name_clash",), 0)
    assert row.fault.startswith("two or more robots call themselves arm3: give each a name of its own")
    speak(robots[:1], [20.0, 21.0])
    assert robots[0].row(21.1).state == "clash"
    speak(robots[:1], [22.0, 23.0])
    row = robots[0].row(23.1)
    assert (row.state, row.level, row.fault) == ("live", "stable", "")


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_robots_of_one_name_the_healthier_is_never_shown(order: int) -> None:
    well, ill = twins()
    for now_s in range(10, 20):
        for robot in [well, ill][::order]:
            level, health = ("stable", 0) if robot is well else ("slipping", 2)
            robot.reports(now_s, level, streams={"left.pad": {"health": health, "message": "late"}})
        row = well.row(now_s)
        assert (row.level, row.fingers, row.health) == ("slipping", {"left": "slipping"}, Health.ERROR)
        well.warns(now_s + 0.5, "stable")
        assert well.row(now_s + 0.5).level == "slipping"


@pytest.mark.parametrize("signs_of_life_alone", [False, True])
def test_Z9_made_up_names_of_one_session_leave_room_for_the_robots_of_others(
    signs_of_life_alone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipd_client.fleet.fleet_state.MOST_ROBOTS", 100)
    state = FleetState()
    Robot(state, "early", peer="a").joins()
    Robot(state, "early", peer="a").reports(0.0)
    for number in range(120):
        made_up = Robot(state, f"made-up-{number}", peer="flood")
        made_up.joins()
        if not signs_of_life_alone:
            made_up.reports(0.0)
    assert len(state.rows(0.0)) == 100
    late = Robot(state, "late", peer="b")
    late.joins()
    late.reports(1.0)
    late.reports(2.0)
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
            robot.reports(0.0)
    robot = Robot(state, "arm3", peer="honest")
    robot.joins()
    robot.reports(1.0)
    robot.warns(1.1, "slipping")
    assert (robot.row(1.1).state, robot.row(1.1).level) == ("live", "slipping")
    rows = state.rows(1.1)
    assert {row.robot for row in rows if row.expected} == set(named)
    assert len(rows) == min(most, 63)
