"""Scenes of three grippers, through engine and device bytes: found grips, opening, activation, and the reflex."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import pytest
from gripper_peers import PEERS
from motions.cell import BUDGET_N, MOST_N, PART_M, RAISE_N_PER_S, STEP_N, Cell, brought_up
from motions.cell_steps import comes_to_rest, does, exerts, feels, has, jaws, sees, sent, until
from run_courses import Step, ask, follow, lease, let_lease_be, serve

from slipd.events import StateRestored
from slipd.gripper.stored_state import seal
from slipd_client.messages.names import GRIP_UNKNOWN

pytestmark = pytest.mark.uncovered

HELD_N = 6.0
FORCE_OUT, WIDTH_OUT = ("out_of_range", "force_n"), ("out_of_range", "width_m")
NOT_READY, NOT_ACTIVE, ACTIVATING, TOO_FAST = ("not_ready", ""), ("not_active", ""), ("activating", ""), "too_fast"
BEGUN = ask("gripper.close", force_n=12.0)
"""Another grasp: a first force may be any."""
FAR = ask("gripper.close", FORCE_OUT, force_n=MOST_N)
CLOSE = ask("gripper.close", force_n=HELD_N)
DROP = ask("gripper.open", drop=True)
HOLDS = ask("grip.hold", {"force_n": pytest.approx(HELD_N, abs=0.05)})
LET_GO: list[Step] = [DROP, comes_to_rest, exerts(0.0), jaws("put", 0.0), BEGUN]
ROBOTIQ, WSG, DRIVER = PEERS
REPORTING = (WSG, DRIVER)
"""Grippers that report their force."""


def named(*texts: str, without: bool = False) -> Step:
    """Check that ``status`` says this of the gripper, or does not."""

    def step(cell: Cell) -> None:
        said = cell.ask("status")["result"]["streams"]["gripper"]["message"]
        assert all((text in said) is not without for text in texts), said

    return step


def restart(before: Sequence[Step] = (), **changes: str) -> list[Step]:
    """The daemon dies, and begins with what it kept, in which some things changed; or with nothing."""

    def step(cell: Cell) -> None:
        state: dict[str, Any] = json.loads(cell.kept().text.partition(" ")[2])
        follow(cell, before)
        cell.restart(StateRestored(seal(json.dumps(state | changes))) if changes else None)

    return [step, serve(200), lease]


def acted(least_n: float = HELD_N) -> Step:
    """Check that the reflex acted, at first from this force."""

    def step(cell: Cell) -> None:
        assert cell.acts[0]["from_n"] == pytest.approx(least_n, abs=0.05)

    return step


def known(cell: Cell) -> None:
    assert cell.levels.keys() == {"left", "right"}, "known or unknown within 1 s"
    assert set(cell.levels.values()) <= {"stable", "unknown"}


def opened(cell: Cell, width_m: float) -> None:
    assert cell.jaws.width_m == pytest.approx(width_m, abs=2e-4)
    assert cell.code("gripper.open", width_m=cell.body["width_m"]) is None, "the present width, as it is published"


def refusing(op: str, **fields: Any) -> Step:
    """Eve is refused."""

    def step(cell: Cell) -> None:
        assert cell.code(op, b"eve", **fields) in ("no_lease", "lease_held", "in_contact"), op

    return step


def quiet(cell: Cell) -> None:
    assert cell.acts == []


def watch_rate(cell: Cell) -> None:
    """From now on forces rise by a step, and then at the rate."""
    since_ns, began_n = cell.t_ns, cell.jaws.grip_n

    def look(command: Any) -> None:
        most_n = began_n + STEP_N + RAISE_N_PER_S * (cell.t_ns - since_ns) * 1e-9 + 0.01
        assert command.force_n is None or command.force_n <= most_n

    cell.on_sent = look


FOUND = restart()
BLIND: list[Step] = [feels("silent"), *FOUND]
KILLED = "earlier"
UNKNOWN: list[Step] = [
    *(
        ask(op, expected, **fields)
        for expected in (NOT_READY, "put the object down")
        for op, fields in (("gripper.close", {"force_n": MOST_N}), ("gripper.close", {"force_n": 3.0}),
                           ("grip.set", {"force_n": HELD_N}))
    ),
    ask("grip.adjust", "put the object down", delta_n=1.0),
    ask("grip.hold", {"force_n": None}),
    named(GRIP_UNKNOWN),
]  # fmt: skip
Course = tuple[Sequence[str], float, list[Step]]
COURSES: dict[str, Course] = {
    # a daemon that starts while the gripper holds an object adopts that grip
    "A10 a close from 6 to 25 N is refused as the step that it is": (
        PEERS, HELD_N,
        [*FOUND, FAR, ask("gripper.close", "may change by at most 2 N from the ", force_n=MOST_N), serve(100), sent(),
         exerts(HELD_N)],
    ),
    "a grip that is found is held and changed from what it is": (
        [WSG], HELD_N,
        [*FOUND, HOLDS, ask("grip.set", force_n=7.5), ask("grip.adjust", (TOO_FAST, "delta_n"), delta_n=1.0),
         serve(300), exerts(7.5), ask("gripper.close", force_n=9.0), serve(100), exerts(9.0)],
    ),
    "A8 all raises of a grip that is found have one budget": (
        [DRIVER], HELD_N,
        [*FOUND, *[serve(250), ask("grip.adjust", delta_n=STEP_N)] * 5,
         until(lambda cell: cell.code("grip.adjust", delta_n=0.5) == "budget_spent", [serve(250)]),
         exerts(HELD_N + 10.0, HELD_N + BUDGET_N)],
    ),
    "the reflex keeps a grip that is found": (
        [ROBOTIQ], HELD_N, [*FOUND, has(pull=0.46), serve(300), acted(), exerts(HELD_N + 0.2, MOST_N)],
    ),
    "a link that is lost in a grip that is found is latched": (
        [WSG], HELD_N,
        [*FOUND, does("replug"), serve(200), sees(latched_fault="link_lost"), lease,
         ask("gripper.close", ("fault_latched", ""), force_n=MOST_N), ask("fault.ack"), FAR],
    ),
    "a grip that is found is not relieved by a width, since nobody knows to where it was closed": (
        [DRIVER], HELD_N,
        [*FOUND, ask("gripper.close", ("not_ready", "width_m"), force_n=HELD_N, width_m=PART_M - 0.001),
         ask("gripper.open", ("in_contact", "drop")), *LET_GO],
    ),
    "A10 a grip of unknown force stays as it is": ([ROBOTIQ], HELD_N, [*BLIND, *UNKNOWN, serve(100), sent(), *LET_GO]),
    "A10 a grip of unknown force is known once fingers feel it": (
        [ROBOTIQ], HELD_N, [*BLIND, *UNKNOWN, feels("good"), serve(200), HOLDS, named(GRIP_UNKNOWN, without=True)],
    ),
    "an open that was never sent leaves the force unknown": (
        [ROBOTIQ], HELD_N,
        [*BLIND, serve(20), has(mute=True), serve(20), DROP, does("stall"), has(mute=False), serve(400), sent(), lease,
         ask("fault.ack", {"fault": "command_lost"}), ask("gripper.close", NOT_READY, force_n=3.0)],
    ),
    "A10 a kept force that was never sent is not believed where the gripper reports its own": (
        REPORTING, HELD_N,
        [has(mute=True), ask("grip.set", force_n=HELD_N + STEP_N), *restart([has(mute=False)], boot="b00t"), HOLDS],
    ),
    **{
        f"A10 a grip far outside the limits is not changed to them at once: {key}": (
            [ROBOTIQ], HELD_N,
            [does("restart", **{key: n}), serve(200), lease, HOLDS, ask("grip.set", FORCE_OUT, force_n=n)],
        )
        for key, n in (("min_force_n", 9.0), ("max_force_n", 3.5))
    },
    "free fingers begin a grip with any force after a restart": ([ROBOTIQ], 0.0, [*FOUND, jaws("put", PART_M), BEGUN]),
    **{
        f"F6 a restart in a grasp with a state that is {what} moves nothing and goes on within two seconds": (
            grippers, 8.0,
            [*before, *restart([has(mute=False), does("stall", 300)], **kept), serve(800), known, serve(800),
             exerts(8.0), sent(), ask("grip.adjust", delta_n=1.0), serve(500), exerts(8.8, 9.0),
             named(GRIP_UNKNOWN, without=True)],
        )
        for what, grippers, before, kept in (
            ("kept", [ROBOTIQ, DRIVER], [], {"boot": KILLED}), ("lost", [WSG], [], {}),
            ("kept while the gripper was silent", [ROBOTIQ], [has(mute=True), serve(1000)], {"boot": KILLED}),
        )
    },
    # what is opened
    **{
        f"an open to a narrower width is refused and nothing is sent, with drop = {drop}": (
            [gripper], 0.0,
            [jaws("put", PART_M), *(ask("gripper.open", WIDTH_OUT, width_m=m, drop=drop) for m in (0.0, PART_M, 0.078)),
             ask("gripper.open", "gripper.open only widens: width_m must be at least the present ", width_m=0.0),
             comes_to_rest, sent(), exerts(0.0)],
        )
        for drop, gripper in ((True, ROBOTIQ), (False, WSG))
    },
    "an open widens from where the fingers are and goes on widening": (
        REPORTING, HELD_N,
        [ask("gripper.open", width_m=PART_M + 0.02, drop=True), serve(60),
         ask("gripper.open", WIDTH_OUT, width_m=PART_M + 0.01, drop=True),  # it may be there already
         comes_to_rest, lambda cell: opened(cell, PART_M + 0.02), ask("gripper.open")],
    ),
    "fingers that feel nothing, or are silent, have not let go while they move": (
        [ROBOTIQ], HELD_N,
        [feels("silent"), serve(100), DROP, serve(60), sees(moving=True), ask("gripper.close", FORCE_OUT, force_n=12.0),
         comes_to_rest, sees(moving=False), BEGUN],
    ),
    "open and close at once is no way around the step": (
        [DRIVER], HELD_N,
        [*FOUND, DROP, FAR, ask("grip.set", NOT_READY, force_n=HELD_N),  # nothing is gripped for whoever asks
         comes_to_rest, BEGUN],
    ),
    # what is activated
    "nothing closes while the gripper is still activating": (
        [ROBOTIQ, WSG], 0.0,
        [ask("gripper.close", force_n=HELD_N, width_m=0.01), comes_to_rest, ask("gripper.activate", drop=True),
         until(lambda cell: cell.jaws.active,
               [ask("gripper.close", "the gripper is still activating", force_n=HELD_N), serve(20)]),
         comes_to_rest, CLOSE],
    ),
    "a close is refused until the driver has answered the activation": (
        [DRIVER], 0.0,
        [lambda cell: setattr(cell.jaws.driver, "mute", True), ask("gripper.activate", drop=True),
         ask("gripper.close", ACTIVATING, force_n=HELD_N),  # it is not sent yet
         serve(50), sees(active=False), ask("gripper.close", ACTIVATING, force_n=HELD_N),
         lambda cell: setattr(cell.jaws.driver, "mute", False), serve(200), CLOSE],
    ),
    "a stop ends an activation": (
        [WSG], 0.0,
        [ask("gripper.close", force_n=HELD_N, width_m=0.01), comes_to_rest, jaws("inactive"), serve(60),
         ask("fault.ack"), ask("gripper.activate", drop=True), serve(60),
         ask("gripper.close", ACTIVATING, force_n=HELD_N), ask("gripper.stop"), serve(60), ask("fault.ack"),
         ask("gripper.close", NOT_ACTIVE, force_n=HELD_N)],
    ),
    # with a reflex, what a client states may move the gripper: it needs the lease, as a motion does
    **{
        f"A9 a client without the lease makes the reflex do nothing, {how}": (
            [gripper], HELD_N,
            [has(pull=0.2), serve(200), *free,
             *(step for op, fields in (
                 ("friction.set", {"mu_s": 0.02}), ("friction.set", {"mu_s": 0.5, "mu_d": 0.499}), ("tare.undo", {}),
                 ("gravity.set", {"gravity_mps2": [40.0, 0.0, 0.0]}), ("tare", {"seconds": 0.05}),
             ) for finger in ("left", "right")[: 1 + (op != "gravity.set")]
               for step in (refusing(op, finger=finger, **fields), serve(250))),
             refusing("object.set", name="mug"), serve(500), sent(), quiet, exerts(HELD_N)],
        )
        for how, gripper, free in (
            ("while another holds it", ROBOTIQ, []), ("while nobody does", WSG, [ask("lease.release"), let_lease_be]),
        )
    },
    "A9 the reflex keeps step and rate, and spends a budget of its own": (
        [DRIVER], HELD_N,
        [has(pull=0.2), serve(200), watch_rate,
         *(ask("friction.set", finger=finger, mu_s=0.02) for finger in ("left", "right")),  # the holder may
         serve(2000), exerts(HELD_N + 8.0, MOST_N),
         *[serve(300), ask("grip.adjust", delta_n=STEP_N / 2)] * round(BUDGET_N / STEP_N)],
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "gripper"), [(name, gripper) for name, (grippers, *_) in COURSES.items() for gripper in grippers]
)
def test_A8_A9_A10_F6_a_scene_of_a_gripper(name: str, gripper: str) -> None:
    _, held_n, steps = COURSES[name]
    follow(brought_up(PEERS[gripper], held_n), steps)
