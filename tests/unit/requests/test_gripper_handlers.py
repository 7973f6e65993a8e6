"""Only the lease holder moves the gripper, within every limit, and never on doubtful sensors; engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from engine_rig import FULL_IMAGE, GRIPPER, LEFT, MOVES, Run

BEN = {"client": b"ben"}
NO_GRIPPER = LEFT
NO_LIMIT = LEFT + GRIPPER.replace("max_force_n", "# max_force_n")


def free(run: Run) -> None:
    run.bring_up()


def released(run: Run) -> None:
    run.bring_up()
    run.ask("lease.release")


def inactive(run: Run) -> None:
    run.ask("lease.acquire", ttl_ms=200)
    run.serve_gripper(50)


def unanswered(run: Run) -> None:
    run.ask("lease.acquire", ttl_ms=200)


def silent(run: Run) -> None:
    run.bring_up()
    run.gripper.silent = True
    run.serve_gripper(500)


def faulty(run: Run) -> None:
    run.bring_up()
    run.gripper.fault = 8
    run.serve_gripper(50)


def faulty_and_acknowledged(run: Run) -> None:
    faulty(run)
    run.ask("fault.ack")


def half_closed(run: Run) -> None:
    run.bring_up()
    run.gripper.position = 128
    run.serve_gripper(50)


def held(run: Run) -> None:
    run.bring_up()
    run.grip(5.0)


FORCE_OUT = "out_of_range", "force_n"
CLOSE = {"force_n": 5.0}
REFUSED: list[tuple[Callable[[Run], None], str, dict[str, Any], tuple[str, str]]] = [
    *((free, op, MOVES[op] | BEN, ("no_lease", "")) for op in MOVES),
    *((released, op, MOVES[op], ("no_lease", "")) for op in MOVES),
    *((inactive, op, MOVES[op], ("not_active", "")) for op in MOVES if op != "gripper.activate"),
    (unanswered, "gripper.activate", {}, ("no_gripper", "")),
    (silent, "gripper.close", CLOSE, ("no_gripper", "")),
    (silent, "gripper.stop", {}, ("no_gripper", "")),
    (faulty, "gripper.close", CLOSE, ("fault_latched", "")),
    (faulty_and_acknowledged, "gripper.close", CLOSE, ("gripper_fault", "")),
    *((free, "gripper.close", {"force_n": force_n}, FORCE_OUT) for force_n in (25.1, 2.9, -5.0, 0, 10**6, 1e308)),
    (free, "grip.set", {"force_n": 25.1}, FORCE_OUT),
    (free, "grip.set", {"force_n": math.nan}, ("not_finite", "force_n")),
    (free, "gripper.close", {"force_n": math.inf}, ("not_finite", "force_n")),
    (free, "grip.set", CLOSE, ("not_ready", "")),
    (free, "grip.adjust", {"delta_n": 1.0}, ("not_ready", "")),
    (half_closed, "gripper.close", {"force_n": 5.0, "width_m": 0.06}, ("out_of_range", "width_m")),
    (held, "grip.set", {"force_n": 7.5}, FORCE_OUT),
    (held, "gripper.close", {"force_n": 7.5}, FORCE_OUT),
    *((held, "grip.adjust", {"delta_n": delta_n}, ("out_of_range", "delta_n")) for delta_n in (2.5, -2.5, 1e308)),
    (held, "grip.adjust", {"delta_n": math.nan}, ("not_finite", "delta_n")),
]


@pytest.mark.parametrize(
    ("state", "op", "fields", "refusal"), REFUSED, ids=lambda value: getattr(value, "__name__", None)
)
def test_A3_a_motion_that_a_rule_forbids_is_refused_and_nothing_is_sent(
    run: Run, state: Callable[[Run], None], op: str, fields: dict[str, Any], refusal: tuple[str, str]
) -> None:
    state(run)
    run.writes()
    assert run.refusal(op, **fields) == refusal
    run.serve_gripper(100)
    assert run.writes() == []


@pytest.mark.parametrize(
    ("text", "op", "code"),
    [
        *((NO_GRIPPER, op, "no_gripper") for op in (*MOVES, "fault.ack")),
        *((NO_LIMIT, op, "no_limit") for op in MOVES),
    ],
)
def test_a_rig_that_cannot_move_refuses_every_motion(text: str, op: str, code: str) -> None:
    run = Run(text)
    run.up()
    run.serve_gripper(50)
    run.lease()
    assert run.refusal(op, **MOVES.get(op, {})) == (code, "")
    run.serve_gripper(100)
    assert run.writes() == []


def test_G3_a_force_outside_the_gripper_range_is_refused(rig: str) -> None:
    run = Run(rig.replace("[255, 28.5]", "[255, 20.0]").replace("= 25.0", "= 20.0"))
    run.up()
    run.bring_up()
    assert run.refusal("gripper.close", force_n=2.0) == FORCE_OUT
    assert run.refusal("gripper.close", force_n=3.0) is None


@pytest.mark.parametrize(("ms", "suspended_ns"), [(200, 0), (5, 10**9)])
def test_a_rig_without_gripper_publishes_the_end_of_a_lease_at_once(ms: int, suspended_ns: int) -> None:
    run = Run(NO_GRIPPER + "[rates]\nstatus_hz = 0.001\n")
    run.up()
    run.tick()
    run.ask("lease.acquire", ttl_ms=200)
    before = len(run.published("status"))
    for wait_ms, slept_ns, ends in ((5, 0, []), (ms, suspended_ns, [False]), (5, suspended_ns, [False])):
        run.wait(wait_ms)
        run.tick(slept_ns)
        assert [body["lease"]["held"] for body in run.published("status")[before:]] == ends


def test_a_grip_is_closed_with_the_setting_below_the_requested_force(run: Run) -> None:
    run.bring_up()
    assert run.ask("gripper.close", force_n=10.05)["result"] == {"applied_n": pytest.approx(10.0)}
    run.serve_gripper(50)
    assert (run.gripper.command.position, run.gripper.command.force, run.gripper.command.go) == (255, 70, True)
    assert run.published("gripper")[-1]["force_command_n"] == pytest.approx(10.0)
    assert run.ask("gripper.stop")["result"] == {}
    run.serve_gripper(50)
    assert (run.gripper.command.go, run.gripper.command.activate) == (False, True)


def test_open_is_allowed_while_every_finger_is_known_to_be_free(run: Run) -> None:
    run.bring_up()
    run.ask("gripper.close", force_n=5.0)
    run.serve_gripper(50)
    run.feel(0.0)
    assert run.ask("gripper.open")["result"] == {"applied_n": pytest.approx(3.0)}
    run.serve_gripper(50)
    assert (run.gripper.command.position, run.gripper.command.go) == (0, True)


NOT_FREE: dict[str, Callable[[Run], object]] = {
    "in contact": lambda run: run.wrench(5.0),
    "silent": lambda run: (run.wait(100), run.tick()),
    "right unplugged": lambda run: run.down("right.pad"),
    "overloaded": lambda run: run.wrench(0.0, status=2),
    "untared": lambda run: run.ask("tare.undo", finger="left"),
    "half blind": lambda run: run.down("left.pad"),
}


@pytest.mark.parametrize("state", NOT_FREE)
def test_open_is_refused_unless_fingers_are_known_to_be_free_or_drop_is_set(run: Run, state: str) -> None:
    """Unknown is not free."""
    run.bring_up()
    run.ask("gripper.close", force_n=5.0)
    run.serve_gripper(100)  # the last image is old, so it shows nothing
    run.wrench(0.0)
    run.skin(0.0)
    NOT_FREE[state](run)
    run.writes()
    refused = run.ask("gripper.open")["error"]
    assert (refused["code"], refused["field"]) == ("in_contact", "drop")
    assert ("right" if state == "right unplugged" else "left") in refused["message"]
    assert run.refusal("gripper.activate") == run.refusal("gripper.open", drop=False) == ("in_contact", "drop")
    run.serve_gripper(20)
    assert run.writes() == []
    assert run.refusal("gripper.open", drop=True) is None
    run.serve_gripper(50)
    assert run.gripper.command.position == 0


def test_open_is_refused_on_readings_from_before_a_stall(run: Run) -> None:
    """No tick lies between: the readings are old, and it is not known yet whether newer ones wait."""
    run.bring_up()
    run.feel(0.0)
    run.wait(60)
    assert run.refusal("gripper.open") == ("in_contact", "drop")
    assert run.level("right") == ("no_contact", []), "the sensor is not silent: its line was not read"
    run.serve_gripper(20)
    run.feel(0.0)
    assert run.refusal("gripper.open") is None


def test_nothing_moves_without_a_request(run: Run) -> None:
    """Readings, ticks, faults, losses and refusals write nothing to the gripper."""
    run.bring_up()
    run.ask("gripper.close", force_n=5.0)
    run.serve_gripper(50)
    run.writes()
    happens = {
        20: lambda: run.down("left.wrench"),
        30: lambda: run.up("left.wrench"),
        40: lambda: run.tick(suspended_ns=10**12),
    }
    for k in range(60):
        run.wrench(10.0, (4.9, 0.0))
        run.image(FULL_IMAGE)
        run.skin(10.0, (4.0, 0.0))
        run.serve_gripper(5)
        happens.get(k, lambda: None)()
    assert run.writes() == []


def test_pending_commands_are_not_sent_to_a_replugged_gripper(run: Run) -> None:
    run.bring_up()
    run.gripper.silent = True
    run.ask("gripper.close", force_n=5.0)
    run.down("gripper")
    run.gripper.silent = False
    run.writes()
    run.up("gripper")
    run.serve_gripper(200)
    assert run.writes() == []
    assert run.refusal("grip.set", force_n=5.0) == ("no_lease", "")


@pytest.mark.parametrize("how", ["stall", "sleep"])
def test_a_command_that_waited_for_a_poll_is_not_sent_after_a_stall(run: Run, how: str) -> None:
    run.bring_up()
    run.tick()
    run.feel(0.0)
    run.gripper.silent = True
    run.serve_gripper(20)
    run.feel(0.0)
    assert run.refusal("gripper.open") is None
    run.let_lease_be()
    run.gripper.silent = False
    if how == "stall":
        run.wait(10_000)
        run.wrench(0.0)
    else:
        run.wait(5)
        run.tick(suspended_ns=3600 * 10**9)
        body = run.published("gripper")[-1]
        assert (body["active"], body["width_m"], body["age_s"]) == (None, None, None)
    run.serve_gripper(500)
    assert run.writes() == []
    body = run.published("gripper")[-1]
    assert (body["latched_fault"], body["active"]) == ("command_lost", True)


# -- the force of a held object changes within step, rate and budget


def test_the_force_of_a_held_object_is_set_and_adjusted_without_motion(run: Run) -> None:
    held(run)
    for op, field, wanted_n, applied_n, setting in (
        ("grip.set", "force_n", 6, 6.0, 30),
        ("grip.adjust", "delta_n", 0.5, 6.5, 35),
        ("grip.adjust", "delta_n", -1.0, 5.5, 25),
    ):
        assert run.ask(op, **{field: wanted_n})["result"] == {"applied_n": pytest.approx(applied_n)}
        run.serve_gripper(50)
        run.feel(applied_n)
        assert (run.gripper.command.position, run.gripper.command.force) == (255, setting)
        assert run.published("gripper")[-1]["force_command_n"] == pytest.approx(applied_n)


def test_A8_the_force_rises_no_faster_than_the_limit(run: Run) -> None:
    held(run)
    assert run.refusal("grip.adjust", delta_n=2.0) is None
    refused = run.ask("grip.adjust", delta_n=1.0)["error"]
    assert (refused["code"], refused["field"]) == ("too_fast", "delta_n")
    assert "100 ms" in refused["message"]
    run.serve_gripper(100)
    run.feel(7.0)
    assert run.refusal("grip.adjust", delta_n=1.0) is None


def test_A6_A8_raises_that_the_gripper_has_not_acknowledged_never_act_all_at_once(run: Run) -> None:
    held(run)
    run.gripper.silent = True
    assert run.refusal("grip.adjust", delta_n=2.0) is None
    run.wait(20)
    run.feel(5.0)
    refused = run.ask("grip.adjust", delta_n=0.2)["error"]
    assert (refused["code"], refused["field"]) == ("too_fast", "delta_n")
    assert "within 2 N of the 5 N that the gripper acknowledged last" in refused["message"]
    run.gripper.silent = False
    run.serve_gripper(60)
    run.feel(7.0)
    assert run.refusal("grip.adjust", delta_n=0.2) is None


def test_A8_the_force_falls_no_faster_than_the_limit_also_in_coarse_settings(rig: str) -> None:
    """Settings are 0.84 N apart, so that every request changes the force by at least that."""
    run = Run(rig.replace("[[0, 3.0], [255, 28.5]]", "[[0, 20.0], [255, 235.0]]").replace("25.0", "120.0"))
    run.up()
    run.bring_up()
    run.grip(60.0)
    run.serve_gripper(1000)
    first_n = force_n = run.published("gripper")[-1]["force_command_n"]
    began_ns = run.t_ns
    assert run.refusal("grip.adjust", delta_n=-1.9) == ("out_of_range", "delta_n"), "it would be 2.5 N"
    for _ in range(50):
        run.feel(60.0)
        assert run.refusal("grip.set", force_n=force_n) is None, "what is in force may be asked for at any time"
        reply = run.ask("grip.adjust", delta_n=-0.01)
        assert reply["ok"] or reply["error"]["code"] == "too_fast"
        force_n = reply["result"]["applied_n"] if reply["ok"] else force_n
        run.serve_gripper(20)
    assert 2.0 < first_n - force_n <= 2.0 + 2.0 * (run.t_ns - began_ns) * 1e-9
    run.serve_gripper(1000)
    run.feel(60.0)
    assert run.ask("grip.adjust", delta_n=0.1)["result"] == {"applied_n": force_n}, "no setting lies between"


def test_A8_all_raises_of_a_grasp_share_a_budget(rig: str) -> None:
    run = Run(rig + "budget_n = 3.0\n")
    run.up()
    held(run)
    assert run.refusal("grip.adjust", delta_n=2.0) is None
    run.serve_gripper(200)
    run.feel(7.0)
    assert run.refusal("grip.adjust", delta_n=2.0) == ("budget_spent", "delta_n")
    assert run.refusal("gripper.open", drop=True) is None
    run.gripper.found = 3
    run.feel(0.0)
    run.serve_gripper(50)
    run.grip(8.0)
    assert run.refusal("grip.adjust", delta_n=2.0) is None, "another grasp has a budget of its own"


@pytest.mark.parametrize("pressed", [False, True])
def test_a_lost_object_ends_the_grasp_unless_a_finger_is_pressed(run: Run, pressed: bool) -> None:
    held(run)
    run.gripper.found = 3
    for _ in range(5):
        run.feel(5.0 if pressed else 0.0)
        run.serve_gripper(20)
    run.feel(5.0 if pressed else 0.0)
    assert run.published("gripper")[-1]["object"] == "none"
    assert run.refusal("grip.adjust", delta_n=0.5) == (None if pressed else ("not_ready", ""))
    assert run.refusal("gripper.close", force_n=12.0) == (FORCE_OUT if pressed else None)


BLIND: dict[str, Callable[[Run], object]] = {
    "stale": lambda run: (run.serve_gripper(150), run.wrench(5.0)),
    "old: fresh enough for a verdict on a slow sensor": lambda run: (run.wait(51), run.skin(5.0, ms=1)),
    "doubtful": lambda run: (run.feel(5.0), run.wrench(5.0, status=2)),
    "unplugged": lambda run: run.down("left.wrench"),
    "without its pad": lambda run: (run.feel(5.0), run.down("left.pad")),
}


@pytest.mark.parametrize("state", BLIND)
def test_F1_no_raise_on_a_stale_or_doubtful_sensor(run: Run, state: str) -> None:
    held(run)
    BLIND[state](run)
    assert run.refusal("grip.set", force_n=6.0) == ("not_ready", "force_n")
    assert run.refusal("grip.adjust", delta_n=1.0) == ("not_ready", "delta_n")
    assert run.refusal("gripper.close", force_n=6.0) == ("not_ready", "force_n")
    assert run.refusal("grip.set", force_n=4.5) is None, "lowering needs no sensor"


@pytest.mark.parametrize(
    ("force_n", "found", "go"), [(None, 2, True), (6.0, 2, True), (None, 0, False)], ids=["held", "changed", "moving"]
)
def test_hold_stops_moving_fingers_alone_and_keeps_the_force(
    run: Run, force_n: float | None, found: int, go: bool
) -> None:
    run.bring_up()
    run.ask("gripper.close", force_n=5.0)
    run.serve_gripper(50)
    run.gripper.found = found
    run.serve_gripper(50)
    run.feel(5.0 if found else 0.0)
    if force_n is not None:
        assert run.refusal("grip.set", force_n=force_n) is None
    assert run.ask("grip.hold")["result"] == {"force_n": pytest.approx(force_n or 5.0)}
    run.serve_gripper(100)
    assert (run.gripper.command.go, run.gripper.command.activate) == (go, True)
