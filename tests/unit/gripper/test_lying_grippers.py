"""A gripper that lies is caught, and an honest one is not accused; through engine and device bytes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from gripper_peers import PEERS
from motions.cell import PART_M, brought_up
from motions.cell_steps import comes_to_rest, jaws, sees
from run_courses import Step, ask, follow, health, serve

from slipd.tools.sim.emulated_wsg import encode_reply
from slipd_client.messages import Health

HELD_N = 6.0
ROBOTIQ, WSG, DRIVER = PEERS
CLOSE, LATCHED, ACKNOWLEDGE = (
    ask("gripper.close", force_n=HELD_N), ask("gripper.close", ("fault_latched", ""), force_n=HELD_N), ask("fault.ack"),
)  # fmt: skip
NO_FAULT, NOT_OPEN = sees(latched_fault=""), health("gripper", without="open fingers")


def has(**changes: Any) -> Step:
    """Change attributes of the emulated gripper."""
    return lambda cell: vars(cell.jaws.line).update(changes)


def reports(**changes: Any) -> Step:
    """Let a driver report something else from now on, whatever its gripper does."""
    return lambda cell: has(_goal_m=None, report=replace(cell.jaws.line.report, **changes))(cell)


IGNORES = {
    ROBOTIQ: has(advance=lambda _: []),
    WSG: has(_begin=lambda command, *_: [encode_reply(command)]),
    DRIVER: has(_carry_out=lambda _: None),
}
"""Each gripper accepts its motions, and stays where it is."""
COURSES: dict[str, tuple[str, float, list[Step]]] = {
    # a force that cannot be true
    **{
        f"a {gripper} that reports far more force than it was sent is latched, and again while it lasts": (
            gripper, HELD_N,
            [lies, serve(150), NO_FAULT, serve(100), sees(latched_fault="force_mismatch"), LATCHED, ACKNOWLEDGE,
             serve(150), NO_FAULT, serve(100), sees(latched_fault="force_mismatch")],
        )
        for gripper, lies in {WSG: has(limit=150.0), DRIVER: has(excess=10.0)}.items()
    },
    "an impact is short": (
        DRIVER, HELD_N, [*[has(excess=10.0), serve(150), has(excess=0.0), serve(40)] * 3, NO_FAULT],
    ),
    "a screw goes on pressing with what it was sent before": (
        DRIVER, 18.0,
        [*(step for n in (16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0) for step in (serve(1000), ask("grip.set", force_n=n))),
         serve(200), reports(force_n=18.0), serve(300), reports(moving=True), serve(40), reports(moving=False),
         serve(300), NO_FAULT],
    ),
    "another client may grip with more when nothing is gripped for us": (
        DRIVER, HELD_N,
        [ask("gripper.open", drop=True), comes_to_rest, jaws("put", PART_M), has(force_n=60.0, _goal_m=0.0),
         serve(1500), sees(object="contact_closing", force_n=60.0), NO_FAULT],
    ),
    # a motion that is ignored
    **{
        f"a {gripper} that ignores a motion is latched within a second, and again": (
            gripper, 0.0,
            [lies, CLOSE, serve(990), NO_FAULT, serve(60), sees(latched_fault="motion_ignored"), LATCHED, ACKNOWLEDGE,
             CLOSE, serve(990), NO_FAULT, serve(60), sees(latched_fault="motion_ignored")],
        )
        for gripper, lies in IGNORES.items()
    },
    "one that ignores a motion is latched as soon where the motion is commanded again and again": (
        DRIVER, 0.0,
        [IGNORES[DRIVER], *[CLOSE, serve(330)] * 3, NO_FAULT, CLOSE, serve(60), sees(latched_fault="motion_ignored")],
    ),
    **{
        f"fingers that stay where they are {why}": (DRIVER, 0.0, [*steps, serve(2500), NO_FAULT])
        for why, steps in {
            "may be held by a part": [IGNORES[DRIVER], CLOSE, reports(object="contact_closing")],
            "may be held by what presses": [IGNORES[DRIVER], CLOSE, has(_blocked=True)],
            "may be as near as they get": [IGNORES[DRIVER], ask("gripper.close", force_n=HELD_N, width_m=0.06)],
            "may be halted": [IGNORES[DRIVER], CLOSE, serve(20), ask("gripper.stop")],
            "may be called back": [IGNORES[DRIVER], CLOSE, serve(500), ask("gripper.open", width_m=0.08)],
            "must be known to be there": [IGNORES[DRIVER], CLOSE, reports(width_m=None)],
            "must not have moved": [IGNORES[DRIVER], CLOSE, serve(20), reports(width_m=0.05)],
            "may be stopped by a fault, which is over": [
                IGNORES[DRIVER], CLOSE, reports(fault="no_power"), serve(100), sees(latched_fault="no_power"),
                reports(fault=""), serve(40), ACKNOWLEDGE,
            ],
        }.items()
    },
    "a gripper that reports for ever that it moves is named": (
        DRIVER, HELD_N,
        [reports(moving=True), serve(2900), health("gripper", without="stay where"), serve(200),
         health("gripper", "its fingers move, and they stay where they are", severity=Health.WARN)],
    ),
    # a width that cannot be true
    "a gripper that reports open fingers, which measure a contact, is named": (
        DRIVER, HELD_N,
        [NOT_OPEN, reports(width_m=0.1, object="none"), serve(100),
         health("gripper", "reports open fingers, and every finger measures a contact", severity=Health.WARN)],
    ),
    "a part may be as wide as the gripper": (DRIVER, HELD_N, [reports(width_m=0.1), serve(100), NOT_OPEN]),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_D5_a_gripper_that_lies_is_caught_and_an_honest_one_is_not_accused(name: str) -> None:
    gripper, held_n, steps = COURSES[name]
    follow(brought_up(PEERS[gripper], held_n), steps)
