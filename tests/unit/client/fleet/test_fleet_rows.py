"""What is known of each robot, how it is shown, and the names of a fleet."""

from __future__ import annotations

import itertools
import json
import re
from argparse import ArgumentTypeError
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest

from slipd_client.arguments import fleet_name
from slipd_client.errors import CallError
from slipd_client.fleet.fleet_command import change_text, fleet_lines, fleet_map
from slipd_client.fleet.fleet_network import message_key, split_key
from slipd_client.fleet.fleet_state import BRIDGE, DAEMON, MOST_RUNS, SILENT_AFTER_S, FleetState, RobotRow
from slipd_client.messages import Health, encode
from slipd_client.terminal import Terminal


class Robot:
    """One robot, as a bridge forwards it, with signs of life of its bridge and its daemon from the beginning."""

    def __init__(
        self,
        state: FleetState,
        name: str = "arm3",
        boot: str = "boot-1",
        peer: str = "",
        signs: tuple[str, ...] = (BRIDGE, DAEMON),
    ) -> None:
        self.state, self.name, self.boot, self.peer = state, name, boot, peer
        self.seq: Counter[tuple[str, str]] = Counter()
        self.t_ns = 0
        self.joins(signs)

    def joins(self, signs: tuple[str, ...] = (BRIDGE, DAEMON)) -> None:
        for what in signs:
            self.state.add_token(self.name, what, alive=True)

    def sends(self, topic: str, now_s: float, **fields: Any) -> None:
        self.seq[self.boot, topic] += 1
        self.t_ns += 1
        header = {"v": 1, "seq": self.seq[self.boot, topic], "boot": self.boot, "t_ns": self.t_ns}
        self.state.add_message(self.name, topic, encode(header | fields), now_s, self.peer)

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
        self.seq[self.boot, topic] += count

    def overtakes(self, count: int) -> None:
        """What is sent next is older than what was sent last."""
        self.t_ns -= count

    def ends(self, what: str) -> None:
        self.state.add_token(self.name, what, alive=False)


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
    events: list[tuple[Any, ...]], now_s: float, expected: dict[str, Any]
) -> None:
    robot = Robot(FleetState())
    for what, *arguments in events:
        fields = arguments.pop() if arguments and isinstance(arguments[-1], dict) else {}
        what(robot, *arguments, **fields)
    row = robot.row(now_s)
    assert {name: getattr(row, name) for name in expected} == expected


def test_what_cannot_be_read_is_counted_and_gives_no_row() -> None:
    state = FleetState()
    assert state.add_message("arm3", "status", b"no message", 0.0) is None
    assert (state.rows(0.0), state.unread) == ([], 1)


@pytest.mark.parametrize(
    ("signs", "expected"),
    [
        pytest.param((BRIDGE,), [("silent", None)] * 2, id="what a bridge kept of a silent daemon has no age"),
        pytest.param((), [("gone", None), ("live", 0.0)], id="without signs of life: live from the second status"),
    ],
)
def test_a_robot_whose_signs_of_life_are_missing(signs: tuple[str, ...], expected: list[tuple[str, Any]]) -> None:
    robot = Robot(FleetState(), signs=signs)
    found = []
    for now_s in (10.0, 11.0):
        robot.reports(now_s)
        found.append((robot.row(now_s).state, robot.row(now_s).age_s))
    assert found == expected


def twins(count: int = 2) -> list[Robot]:
    """Robots that call themselves arm3."""
    state = FleetState()
    return [Robot(state, boot=f"boot-{number}") for number in range(count)]


@pytest.mark.parametrize("count", [2, 3 * MOST_RUNS])
def test_robots_of_one_name_are_a_fault_and_not_a_level_until_the_others_are_gone(count: int) -> None:
    robots = twins(count)
    for now_s, (place, robot) in itertools.product(range(10, 20), enumerate(robots)):
        robot.reports(now_s + 0.01 * place)
    row = robots[0].row(19.5)
    assert (row.state, row.level, row.reasons, row.missed_warnings, row.fault.partition(",")[0]) == (
        *("clash", "unknown", ("name_clash",), 0),
        "two or more robots call themselves arm3: give each a name of its own",
    )
    found = []
    for now_s in (20.0, 21.0, 22.0, 23.0):
        robots[0].reports(now_s)
        row = robots[0].row(now_s + 0.1)
        found.append((row.state, row.level, row.fault == ""))
    assert found[1:] == [("clash", "unknown", False), found[2], ("live", "stable", True)]


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
    Robot(state, "early", peer="a").reports(0.0)
    for number in range(120):
        made_up = Robot(state, f"made-up-{number}", peer="flood")
        if not signs_of_life_alone:
            made_up.reports(0.0)
    assert len(state.rows(0.0)) == 100
    late = Robot(state, "late", peer="b")
    for now_s in (1.0, 2.0):
        late.reports(now_s)
    late.warns(2.1, "slipping")
    shown = {row.robot: (row.state, row.level) for row in state.rows(2.1)}
    assert (len(shown), "early" in shown, shown["late"]) == (100, True, ("live", "slipping"))


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
            Robot(state, name, boot=f"boot-{peer}", peer=f"peer-{peer}").reports(0.0)
    robot = Robot(state, "arm3", peer="honest")
    robot.reports(1.0)
    robot.warns(1.1, "slipping")
    rows = state.rows(1.1)
    expected = {row.robot: (row.state, row.level) for row in rows if row.expected}
    assert (len(rows), [*expected], expected["arm3"]) == (min(most, 63), named, ("live", "slipping"))


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
HEAD = "robot state level health age"


@pytest.mark.parametrize(
    ("rows", "lines"),
    [
        (
            [row("arm0", level="slipping", expected=False), row("arm1"), GONE, SLIPPING, ILL],
            [
                "fleet plant 5 robots 1 gone 4 live 2 slipping 2 warnings missed",
                HEAD,
                "arm3 live slipping OK 0.4 s left slipping, right stable; slip_detected",
                "arm2 gone unknown – – last: left stable",
                "arm4 live stable STALE 0.4 s left stable; left.pad: nothing arrives; 2 warnings missed",
                "arm1 live stable OK 0.4 s left stable",
                "arm0 live slipping OK 0.4 s not one of --robots; left stable",
            ],
        ),
        (
            [row("arm5", state="clash", level="slipping", fault="two arm5")],
            ["fleet plant 1 robot 1 clash 1 slipping", HEAD, "arm5 clash slipping OK 0.4 s two arm5; left stable"],
        ),
        ([], ["fleet plant 0 robots"]),
    ],
)
def test_the_most_urgent_robot_comes_first_and_the_head_counts(rows: list[RobotRow], lines: list[str]) -> None:
    shown = fleet_lines("plant", rows, 0, Terminal())
    assert [" ".join(line.split()) for line in shown] == lines
    columns = [re.match(r"(\S+) +(\S+) +(\S+) +(\S+) +(–|age|[\d.]+ s)", line) for line in shown[1:]]
    assert len({(*map(found.start, range(1, 5)), found.end(5)) for found in columns}) <= 1, "they stand below the head"


@pytest.mark.parametrize(
    ("before", "after", "line"),
    [
        (None, row("arm1"), "arm1: live, stable"),
        (row("arm1"), row("arm1", age_s=0.9), ""),
        (row("arm3"), SLIPPING, "arm3: stable → slipping  (left slipping, right stable; slip_detected)"),
        (row("arm2"), GONE, "arm2: live → gone, stable → unknown, OK → –  (last: left stable)"),
    ],
)
def test_a_log_has_a_line_for_each_change_and_none_without(before: RobotRow | None, after: RobotRow, line: str) -> None:
    assert change_text(before, after) == line


def test_json_has_every_field() -> None:
    told = json.loads(json.dumps(fleet_map("plant", [GONE, ILL], 1)))
    robots = [(each["health"], each["missed_warnings"]) for each in told["robots"]]
    assert (told["fleet"], told["unread"], robots) == ("plant", 1, [(None, 0), ("STALE", 2)])


@pytest.mark.parametrize("topic", ["slip.left", "daemon"])
@pytest.mark.parametrize("name", ["a", "Arm-3", "robot_7.left", "9", "x" * 64])
def test_a_name_of_letters_digits_and_joints_is_a_part_of_a_key(name: str, topic: str) -> None:
    assert split_key(message_key("plant", fleet_name(name), topic), "plant") == (name, topic)


@pytest.mark.parametrize(
    ("check", "text", "why"),
    [
        *(
            (fleet_name, name, "must be 1 to 64 of the char")
            for name in ("", "a*", "$b", "c#", "d?", "e/f", "@adv", ".g", "-h", "ä", "a b", "a\n", "x" * 65)
        ),
        *(
            (lambda topic: message_key("plant", "arm3", topic), topic, "topic must be a word")
            for topic in ("", "slip/left", "slip.*", "$", "Slip", "a.b.c")
        ),
    ],
)
def test_what_zenoh_would_read_as_more_than_one_word_is_refused(
    check: Callable[[str], str], text: str, why: str
) -> None:
    with pytest.raises((CallError, ArgumentTypeError), match=why):
        check(text)


@pytest.mark.parametrize("key", ["other/arm3/x", "plant/arm3", "plant/arm3/a/b", "plant/@adv/x", "plant/a*/x"])
def test_a_key_of_another_fleet_or_form_is_not_split(key: str) -> None:
    assert split_key(key, "plant") is None
