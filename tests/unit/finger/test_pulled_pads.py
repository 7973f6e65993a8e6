"""A clearly negative normal force, through the engine: the finger is unknown; nothing is tared, raised or let go."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_rig import LEFT, RIG, RIGHT, Run
from run_courses import (
    Step,
    ask,
    bring_up,
    feel,
    follow,
    got,
    grip,
    health,
    image,
    level,
    newest,
    play,
    serve,
    skin,
    status,
    tick,
    wait,
    wrench,
)

from slipd_client.messages import Health

UPSIDE_DOWN = RIGHT.replace("-0.001", "0.001")
L: dict[str, Any] = {"finger": "left"}
R: dict[str, Any] = {"finger": "right"}
NOT_READY, IN_CONTACT, DROP = ("not_ready", "finger"), ("in_contact", "finger"), ("in_contact", "drop")
NOT_TARED, PULLED = level("unknown", "not_tared"), level("unknown", "pulled")


def not_pulled(run: Run) -> None:
    assert run.level()[1] != ["pulled"]


COURSES: dict[str, tuple[str, bool, list[Step]]] = {
    # a clearly negative normal force
    **{
        f"a pad pulled with {n} N is unknown, neither tared nor opened, and status says what to check": (
            RIG,
            True,
            [
                bring_up,
                feel(0.0),
                ask("gripper.open"),
                serve(50),
                *[feel(0.0)] * 3,
                wrench(n),
                PULLED,
                newest("slip.left", normal_n=pytest.approx(n, rel=1e-6)),
                newest("warning", previous="no_contact"),
                health(
                    "left.wrench",
                    *("sign", "pad_from_sensor", "quat_xyzw", "x, y, z, w", "the sensor's own configuration"),
                    severity=Health.ERROR,
                ),
                ask("tare", NOT_READY, **L),
                ask("gripper.open", DROP),
                ask("gripper.activate", DROP),
                ask("gripper.open", drop=True),
                serve(60),
                wrench(0.0),
                level("no_contact"),
                health("left.wrench", without="pulls"),
            ],
        )
        for n in (-25.0, -71_768.0)
    },
    "no grip is raised on a pulled pad": (
        RIG,
        True,
        [
            bring_up,
            grip(5.0),
            feel(5.0),
            wrench(-5.0),
            ask("grip.adjust", ("not_ready", "delta_n"), delta_n=1.0),
            *(serve(60), feel(5.0), ask("grip.adjust", delta_n=1.0)),
        ],
    ),
    "a pull ends a tare, and a pad that shows a contact forbids one": (
        RIG,
        True,
        [
            bring_up,
            ask("tare", seconds=0.1, **L),
            wrench(-25.0),
            got(1, busy=False, given_up_reason="pulled"),
            got(1, given_up="the normal force became negative, as if the pad were pulled"),
            image(),
            wrench(-25.0),
            ask("tare", IN_CONTACT, unloaded=True, **L),
            health(
                "left.wrench",
                "the pad image shows a contact, so the force sensor is wrong",
                severity=Health.ERROR,
            ),
        ],
    ),
    "unloaded = true tares a negative bias": (
        RIG,
        False,
        [
            wrench(-25.0),
            tick,
            PULLED,
            health("left.wrench", "tare it with unloaded = true", severity=Health.ERROR),
            ask("tare", NOT_READY, seconds=0.01, **L),
            ask("tare", ("bad_type", "unloaded"), seconds=0.01, unloaded="yes", **L),
            ask("tare", {"verified": False}, seconds=0.01, unloaded=True, **L),
            wrench(-25.0, times=20),
            got(1),
            level("no_contact"),
        ],
    ),
    **{
        f"the least pull follows from noise, weight, drift and min_normal_n: {more}": (
            (LEFT.replace("force_std_n = 0.0\n", "") if "force_std_n" in more else LEFT).replace(
                "stuck_after = 0", f"stuck_after = 0\n{more}"
            ),
            False,
            [
                wrench(-9.0),
                NOT_TARED,  # before its tare a sensor reads its own bias
                ask("tare", seconds=0.01, **L),
                wrench(0.0, times=20),
                got(1),
                wrench(0.01 - least_n, ms=5.0),
                not_pulled,
                wrench(-0.01 - least_n, ms=5.0),
                PULLED,
            ],
        )
        for more, least_n in (
            ("", 0.5 + 1.0),
            ("drift_limit_n = 0.2", 0.5 + 0.2),
            ("force_std_n = 0.1", 0.5 + 1.0 + 4 * 0.1),
            ("mass_kg = 0.1", 0.5 + 1.0 + 0.1 * 2 * 9.80665),
        )
    },
    "a three-axis pad with a wrong sign is pulled": (
        UPSIDE_DOWN,
        True,
        [
            skin(5.0, times=3),
            level("unknown", "pulled", finger="right"),
            ask("tare", NOT_READY, **R),
            health("right.pad", "axis_scale", severity=Health.ERROR),
        ],
    ),
    "raw counts below zero may be tared": (
        UPSIDE_DOWN.partition("tare = ")[0],
        False,
        [
            skin(1.0, times=3),
            level("unknown", "not_tared", finger="right"),
            ask("tare", seconds=0.05, **R),
            skin(1.0, times=10),
            level("no_contact", finger="right"),
        ],
    ),
}


@pytest.mark.parametrize("name", COURSES)
def test_a_course_of_a_pulled_finger(name: str) -> None:
    text, zeros, steps = COURSES[name]
    play(text, steps, zeros=zeros)


def test_taxels_pressed_during_a_pull_are_not_masked_as_hot(run: Run) -> None:
    """The force sensor has the wrong sign: its pull presses the pad, first lightly and then hard."""
    run.bring_up()
    rng = np.random.default_rng(2)
    for k in range(400):
        normal_n = min(0.005 * k, 8.0) if k < 100 else 8.0 + np.sin(0.1 * k)
        counts = np.rint(10.0 * normal_n + rng.normal(size=(4, 4))).astype(int)
        follow(run, [wait(7), tick, wrench(-normal_n, ms=2.0), image(counts)])
    follow(run, [status(streams={"left.pad": {"masked": []}}), PULLED, ask("tare", IN_CONTACT, **L)])
