"""The grasp is published as it changes; the reflex raises the grip before the warning is published."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_rig import LEFT, RIG, RIGHT, Run
from grasp_table import grasp_table
from nanoseconds import MS
from run_courses import (
    Step,
    bring_up,
    during,
    follow,
    grip,
    gripper,
    image,
    newest,
    play,
    serve,
    skin,
    slip,
    tick,
    wait,
    wrench,
    wrote,
)

from slipd.events import Publish, Write

GRASP = grasp_table()
REFLEX = f"{GRASP}\n[reflex]\nenabled = true\nraise_n_per_s = 100.0\nceiling_n = 9.0\n"
NO_GRIPPER = LEFT + RIGHT + GRASP
NEAR_N = 2.25
"""A pull on a grip of 5 N and μ = 0.5: λ is 0.9."""


def pull(newtons: float = 0.0, ms: float = 1.0) -> Step:
    """Both fingers feel the grip; the left one feels a pull beside it."""

    def step(run: Run) -> None:
        run.image(np.full((4, 4), 100 + run.t_ns // MS % 7))
        follow(run, [skin(5.0, ms=ms), tick, wrench(5.0, (newtons, 0.0))])

    return step


def acts(*expected: tuple[float, float]) -> Step:
    """Check from which force to which the reflex raised so far."""

    def step(run: Run) -> None:
        found = [body["reflex"] for body in run.published("gripper") if body["reflex"] is not None]
        assert [(act["from_n"], act["force_n"]) for act in found] == list(map(pytest.approx, expected))
        assert {act["reason"] for act in found} <= {"needed", "slipping"}

    return step


def first_of_all(run: Run) -> None:
    """The command leaves before the warning that caused it."""
    at = next(k for k, (_, output) in enumerate(run.out) if isinstance(output, Publish) and output.body.get("reflex"))
    assert [getattr(output, "topic", None) for _, output in run.out[at - 1 : at + 2]] == [None, "gripper", "warning"]
    assert isinstance(run.out[at - 1][1], Write)


def session(link: str, **methods: Any) -> Step:
    """From now on a session has other methods."""
    return lambda run: vars(run.engine._links[link].session).update(methods)


HELD: list[Step] = [bring_up, image(), grip(5.0), pull()]
COURSES: dict[str, tuple[str, list[Step]]] = {
    "a warning raises the grip before it is published": (
        REFLEX,
        # 4.5 N would hold it; the config wants 1.3 times as much
        [*HELD, pull(NEAR_N), newest("warning", level="warning"), acts((5.0, 5.85)), first_of_all],
    ),
    "it goes on to what is needed, at its rate, and no further than its ceiling": (
        f"step_n = 20.0\nraise_n_per_s = 1000.0\n{REFLEX}",
        [*HELD, *[pull(4.0), serve(10)] * 40, acts((5.0, 7.0), (7.0, 9.0)), newest("gripper", force_command_n=9.0)],
    ),
    "A8 a slip raises it again only when the last rise could be felt": (
        REFLEX,
        [
            *HELD, slip, *[pull(0.9), serve(5)] * 5, acts((5.0, 6.0)), *[pull(0.9), serve(5)] * 10,
            acts((5.0, 6.0), (6.0, 7.2)),
        ],
    ),
    "it goes on at a tick between two readings": (
        REFLEX.replace("100.0", "20.0"),
        [
            *HELD, pull(4.0), wait(15), wrench(5.0, (4.0, 0.0)), acts((5.0, 5.4)), wait(4), tick,
            acts((5.0, 5.4), (5.4, 5.8)),
        ],
    ),
    **{
        f"nothing is moved without the switch: {more}": (
            more, [*HELD, wrote(), *[pull(NEAR_N)] * 10, serve(20), wrote(0)],
        )
        for more in ("", GRASP, REFLEX.replace("true", "false"))
    },
    "a gripper with a fault hears nothing": (REFLEX, [*HELD, gripper(fault=14), serve(30), pull(NEAR_N), acts()]),
    "a session that takes no command is no act": (
        REFLEX, [*HELD, session("gripper", execute=lambda *_: False), pull(NEAR_N), acts()],
    ),
    **{
        f"A7 an old reading of the other finger raises nothing, {how}": (
            REFLEX, [*HELD, wait(60), *steps, wrench(5.0, (NEAR_N, 0.0)), newest("slip.right", level=level), acts()],
        )
        for how, steps, level in (
            ("although nothing told that it fell silent", [image()], "stable"), ("which is stale", [tick], "unknown"),
        )
    },
    "a command behind a poll is delayed and not lost": (
        REFLEX, [*HELD, pull(NEAR_N), wrote(), serve(5), pull(NEAR_N), serve(20), wrote(1)],
    ),
    "the grasp is published at its rate and at each change of level": (
        f"[rates]\ngrasp_hz = 10.0\n{GRASP}",
        [
            *HELD, during([pull(ms=4.0)] * 20, "grasp", 1, 2), pull(NEAR_N),
            newest("grasp", level="warning", reasons=["translation"], frame="gripper", width_m=pytest.approx(0.085)),
        ],
    ),
    "a grasp without a gripper knows no width": (
        NO_GRIPPER, [image(), skin(5.0), wrench(5.0), newest("grasp", width_m=None, external_torque_nm=None)],
    ),
    "a tick publishes that the session of a sensor failed": (
        f"[rates]\ngrasp_hz = 1.0\n{GRASP}",
        [
            *HELD, session("left.wrench", receive=lambda *_: 1 / 0), wrench(5.0), during([tick], "grasp", 1),
            newest("grasp", level="unknown"),
        ],
    ),
    "a tick publishes that the fingers fell silent": (
        GRASP,
        [
            *HELD, wait(100), during([tick], "grasp", 1),
            newest("grasp", level="unknown", reasons=["stale"]),
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_A7_a_course_of_a_held_object(name: str) -> None:
    more, steps = COURSES[name]
    play(more if more is NO_GRIPPER else RIG + more, steps)
