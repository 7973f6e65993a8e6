"""Only the lease holder moves the gripper, within every limit, and never on doubtful sensors; engine and real bytes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from engine_rig import FULL_IMAGE, GRIPPER, LEFT, MOVES, RIG, Run
from run_courses import (
    Step,
    ask,
    bring_up,
    commanded,
    down,
    feel,
    follow,
    grip,
    gripper,
    image,
    lease,
    let_lease_be,
    level,
    newest,
    play,
    serve,
    skin,
    sleep,
    tick,
    up,
    wait,
    wrench,
    wrote,
)

NO_LIMIT = LEFT + GRIPPER.replace("max_force_n", "# max_force_n")
COARSE = RIG.replace("[[0, 3.0], [255, 28.5]]", "[[0, 20.0], [255, 235.0]]").replace("25.0", "120.0")
WEAK = RIG.replace("[255, 28.5]", "[255, 20.0]").replace("= 25.0", "= 20.0")
BEN: dict[str, Any] = {"by": b"ben"}
NO_LEASE, NOT_READY, LATCHED, TOO_FAST = ("no_lease", ""), ("not_ready", ""), ("fault_latched", ""), "too_fast"
FORCE_OUT, DELTA_OUT, DROP = ("out_of_range", "force_n"), ("out_of_range", "delta_n"), ("in_contact", "drop")
CLOSE = {"force_n": 5.0}
HELD: list[Step] = [bring_up, grip(5.0)]
CLOSED: list[Step] = [bring_up, ask("gripper.close", **CLOSE)]
HALF_CLOSED: list[Step] = [bring_up, gripper(position=128), serve(50)]
FAULTY: list[Step] = [bring_up, gripper(fault=8), serve(50)]
SILENT: list[Step] = [bring_up, gripper(silent=True), serve(500)]
UNANSWERED: list[Step] = [ask("lease.acquire", ttl_ms=200)]
REFUSED: list[tuple[list[Step], str, dict[str, Any], tuple[str, str]]] = [
    *(([bring_up], op, MOVES[op] | BEN, NO_LEASE) for op in MOVES),
    *(([bring_up, ask("lease.release")], op, MOVES[op], NO_LEASE) for op in MOVES),
    *(([*UNANSWERED, serve(50)], op, MOVES[op], ("not_active", "")) for op in MOVES if op != "gripper.activate"),
    (UNANSWERED, "gripper.activate", {}, ("no_gripper", "")),
    (SILENT, "gripper.close", CLOSE, ("no_gripper", "")),
    (SILENT, "gripper.stop", {}, ("no_gripper", "")),
    (FAULTY, "gripper.close", CLOSE, LATCHED),
    ([*FAULTY, ask("fault.ack")], "gripper.close", CLOSE, ("gripper_fault", "")),
    *(([bring_up], "gripper.close", {"force_n": n}, FORCE_OUT) for n in (25.1, 2.9, -5.0, 0, 10**6, 1e308)),
    ([bring_up], "grip.set", {"force_n": 25.1}, FORCE_OUT),
    ([bring_up], "grip.set", {"force_n": math.nan}, ("not_finite", "force_n")),
    ([bring_up], "gripper.close", {"force_n": math.inf}, ("not_finite", "force_n")),
    ([bring_up], "grip.set", CLOSE, NOT_READY),
    ([bring_up], "grip.adjust", {"delta_n": 1.0}, NOT_READY),
    (HALF_CLOSED, "gripper.close", {"force_n": 5.0, "width_m": 0.06}, ("out_of_range", "width_m")),
    (HELD, "grip.set", {"force_n": 7.5}, FORCE_OUT),
    (HELD, "gripper.close", {"force_n": 7.5}, FORCE_OUT),
    *((HELD, "grip.adjust", {"delta_n": n}, DELTA_OUT) for n in (2.5, -2.5, 1e308)),
    (HELD, "grip.adjust", {"delta_n": math.nan}, ("not_finite", "delta_n")),
]


@pytest.mark.parametrize(("before", "op", "fields", "refusal"), REFUSED)
def test_A3_a_motion_that_a_rule_forbids_is_refused_and_nothing_is_sent(
    run: Run, before: list[Step], op: str, fields: dict[str, Any], refusal: tuple[str, str]
) -> None:
    follow(run, [*before, wrote(), ask(op, refusal, **fields), serve(100), wrote(0)])


@pytest.mark.parametrize(
    ("text", "op", "code"),
    [*((LEFT, op, "no_gripper") for op in (*MOVES, "fault.ack")), *((NO_LIMIT, op, "no_limit") for op in MOVES)],
)
def test_a_rig_that_cannot_move_refuses_every_motion(text: str, op: str, code: str) -> None:
    play(text, [serve(50), lease, ask(op, (code, ""), **MOVES.get(op, {})), serve(100), wrote(0)])


def adjusted(applied_n: float, setting: int, op: str, **fields: float) -> list[Step]:
    """The force of a held object is set without motion."""
    return [
        ask(op, {"applied_n": pytest.approx(applied_n)}, **fields),
        serve(50),
        feel(applied_n),
        commanded(position=255, force=setting),
        newest("gripper", force_command_n=pytest.approx(applied_n)),
    ]


COURSES: dict[str, tuple[str, list[Step]]] = {
    "a grip is closed with the setting below the requested force, and stopped": (
        RIG,
        [
            bring_up,
            ask("gripper.close", {"applied_n": pytest.approx(10.0)}, force_n=10.05),
            serve(50),
            commanded(position=255, force=70, go=True),
            newest("gripper", force_command_n=pytest.approx(10.0)),
            ask("gripper.stop", {}),
            serve(50),
            commanded(go=False, activate=True),
        ],
    ),
    "open is allowed while every finger is known to be free": (
        RIG,
        [
            *CLOSED,
            serve(50),
            feel(0.0),
            ask("gripper.open", {"applied_n": pytest.approx(3.0)}),
            serve(50),
            commanded(position=0, go=True),
        ],
    ),
    "open is refused on readings from before a stall, although no tick noticed it": (
        RIG,
        [
            bring_up,
            feel(0.0),
            wait(60),
            ask("gripper.open", DROP),
            level("no_contact", finger="right"),
            serve(20),
            feel(0.0),
            ask("gripper.open"),
        ],
    ),
    "G3 a force outside the range of the gripper is refused": (
        WEAK,
        [bring_up, ask("gripper.close", FORCE_OUT, force_n=2.0), ask("gripper.close", force_n=3.0)],
    ),
    "pending commands are not sent to a replugged gripper": (
        RIG,
        [
            bring_up,
            gripper(silent=True),
            ask("gripper.close", **CLOSE),
            down("gripper"),
            gripper(silent=False),
            wrote(),
            up("gripper"),
            serve(200),
            wrote(0),
            ask("grip.set", NO_LEASE, force_n=5.0),
        ],
    ),
    **{
        f"a command that waited for a poll is not sent after a {what}": (
            RIG,
            [
                bring_up,
                tick,
                feel(0.0),
                gripper(silent=True),
                serve(20),
                feel(0.0),
                ask("gripper.open"),
                let_lease_be,
                gripper(silent=False),
                *steps,
                serve(500),
                wrote(0),
                newest("gripper", latched_fault="command_lost", active=True),
            ],
        )
        for what, steps in (
            ("stall", [wait(10_000), wrench(0.0)]),
            ("sleep", [wait(5), sleep(3600 * 10**9), newest("gripper", active=None, width_m=None, age_s=None)]),
        )
    },
    "the force of a held object is set and adjusted without motion": (
        RIG,
        [
            *HELD,
            *adjusted(6.0, 30, "grip.set", force_n=6),
            *adjusted(6.5, 35, "grip.adjust", delta_n=0.5),
            *adjusted(5.5, 25, "grip.adjust", delta_n=-1.0),
        ],
    ),
    "A8 the force rises no faster than the limit": (
        RIG,
        [
            *HELD,
            ask("grip.adjust", delta_n=2.0),
            ask("grip.adjust", (TOO_FAST, "delta_n"), delta_n=1.0),
            ask("grip.adjust", "100 ms", delta_n=1.0),
            serve(100),
            feel(7.0),
            ask("grip.adjust", delta_n=1.0),
        ],
    ),
    "A6 A8 raises that the gripper has not acknowledged never act all at once": (
        RIG,
        [
            *HELD,
            gripper(silent=True),
            ask("grip.adjust", delta_n=2.0),
            wait(20),
            feel(5.0),
            ask("grip.adjust", "may change at most 10 N/s", delta_n=0.2),
            gripper(silent=False),
            serve(60),
            feel(7.0),
            ask("grip.adjust", delta_n=0.2),
        ],
    ),
    "A8 all raises of a grasp share a budget": (
        RIG + "budget_n = 3.0\n",
        [
            *HELD,
            ask("grip.adjust", delta_n=2.0),
            serve(200),
            feel(7.0),
            ask("grip.adjust", ("budget_spent", "delta_n"), delta_n=2.0),
            ask("gripper.open", drop=True),
            gripper(found=3),
            feel(0.0),
            serve(50),
            grip(8.0),
            ask("grip.adjust", delta_n=2.0),
        ],
    ),
    **{
        f"a lost object ends the grasp unless a finger is pressed: {pressed}": (
            RIG,
            [
                *HELD,
                gripper(found=3),
                *[feel(5.0 if pressed else 0.0), serve(20)] * 5,
                feel(5.0 if pressed else 0.0),
                newest("gripper", object="none"),
                ask("grip.adjust", None if pressed else NOT_READY, delta_n=0.5),
                ask("gripper.close", FORCE_OUT if pressed else None, force_n=12.0),
            ],
        )
        for pressed in (False, True)
    },
    **{
        f"hold keeps {held_n or 5.0} N and stops fingers that move: {not go}": (
            RIG,
            [
                *CLOSED,
                serve(50),
                gripper(found=found),
                serve(50),
                feel(5.0 if found else 0.0),
                *([ask("grip.set", force_n=held_n)] if held_n else []),
                ask("grip.hold", {"force_n": pytest.approx(held_n or 5.0)}),
                serve(100),
                commanded(go=go, activate=True),
            ],
        )
        for held_n, found, go in ((None, 2, True), (6.0, 2, True), (None, 0, False))
    },
}


@pytest.mark.parametrize("name", COURSES)
def test_A6_A8_G3_a_course_of_requests(name: str) -> None:
    play(*COURSES[name])


NOT_FREE: dict[str, list[Step]] = {
    "in contact": [wrench(5.0)],
    "silent": [wait(100), tick],
    "right unplugged": [down("right.pad")],
    "overloaded": [wrench(0.0, status=2)],
    "untared": [ask("tare.undo", finger="left")],
    "half blind": [down("left.pad")],
}


@pytest.mark.parametrize("state", NOT_FREE)
def test_open_is_refused_unless_fingers_are_known_to_be_free_or_drop_is_set(run: Run, state: str) -> None:
    """Unknown is not free. The last image is old, so it shows nothing."""
    follow(run, [*CLOSED, serve(100), wrench(0.0), skin(0.0), *NOT_FREE[state], wrote()])
    named = "right" if state == "right unplugged" else "left"
    refused = [ask("gripper.open", named), ask("gripper.open", DROP, drop=False), ask("gripper.activate", DROP)]
    follow(run, [*refused, serve(20), wrote(0), ask("gripper.open", drop=True), serve(50), commanded(position=0)])


BLIND: dict[str, list[Step]] = {
    "stale": [serve(150), wrench(5.0)],
    "old: fresh enough for a verdict on a slow sensor": [wait(51), skin(5.0, ms=1)],
    "doubtful": [feel(5.0), wrench(5.0, status=2)],
    "unplugged": [down("left.wrench")],
    "without its pad": [feel(5.0), down("left.pad")],
}


@pytest.mark.parametrize("state", BLIND)
def test_F1_no_raise_on_a_stale_or_doubtful_sensor(run: Run, state: str) -> None:
    raises = [("grip.set", "force_n", 6.0), ("grip.adjust", "delta_n", 1.0), ("gripper.close", "force_n", 6.0)]
    refused = [ask(op, ("not_ready", field), **{field: value}) for op, field, value in raises]
    follow(run, [*HELD, *BLIND[state], *refused, ask("grip.set", force_n=4.5)])  # lowering needs no sensor


def test_nothing_moves_without_a_request(run: Run) -> None:
    """Readings, ticks, faults, losses and refusals write nothing to the gripper."""
    happens = {20: down("left.wrench"), 30: up("left.wrench"), 40: sleep(10**12)}
    felt = [wrench(10.0, (4.9, 0.0)), image(FULL_IMAGE), skin(10.0, (4.0, 0.0)), serve(5)]
    follow(run, [*CLOSED, serve(50), wrote()])
    follow(run, [step for k in range(60) for step in (*felt, happens.get(k, wait(0)))])
    follow(run, [wrote(0)])


def test_A8_the_force_falls_no_faster_than_the_limit_also_in_coarse_settings() -> None:
    """Settings are 0.84 N apart, so that every request changes the force by at least that."""
    too_much = ask("grip.adjust", DELTA_OUT, delta_n=-1.9)  # it would be 2.5 N
    run = play(COARSE, [bring_up, grip(60.0), serve(1000), too_much])
    first_n = force_n = run.published("gripper")[-1]["force_command_n"]
    began_ns = run.t_ns
    for _ in range(50):
        follow(run, [feel(60.0), ask("grip.set", force_n=force_n)])  # what is in force may be asked for at any time
        reply = run.ask("grip.adjust", delta_n=-0.01)
        assert reply["ok"] or reply["error"]["code"] == TOO_FAST
        force_n = reply["result"]["applied_n"] if reply["ok"] else force_n
        run.serve_gripper(20)
    assert 2.0 < first_n - force_n <= 2.0 + 2.0 * (run.t_ns - began_ns) * 1e-9
    no_setting_between = ask("grip.adjust", {"applied_n": force_n}, delta_n=0.1)
    follow(run, [serve(1000), feel(60.0), no_setting_between])
