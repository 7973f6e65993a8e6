"""Every change of level is published at once, everything else at its rate, and status once a second."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from engine_rig import LEFT, RIG, Run
from run_courses import (
    Step,
    count,
    down,
    image,
    level,
    newest,
    play,
    skin,
    tick,
    up,
    wait,
    wrench,
)

from slipd_client.messages import MESSAGE_LIMITS, Health, decode, encode

STALE, HELD_LIGHTLY = ("unknown", "stale"), wrench(10.0, (1.0, 0.0))
NEAR = wrench(10.0, (4.6, 0.0))
CONTACTS: dict[str, list[tuple[Any, ...]]] = {
    "no_contact": [(0.0,)],
    "stable": [(10.0, (1.0, 0.0))],
    "caution": [(10.0, (3.75, 0.0))],
    "warning": [(10.0, (4.6, 0.0))],
    "slipping": [(10.0, (2.0 + 0.005 * k if k < 580 else 3.9, 0.0)) for k in range(620)],
    "unknown": [(math.nan,)],
}
"""Readings that bring the left finger to each level; "slipping" needs a pull that grows and falls."""


LEVELS_IN_TURN = (
    *("no_contact", "stable", "stable", "caution", "warning"),
    *("caution", "unknown", "stable", "no_contact"),
)


def changes(*expected: tuple[str, str, bool]) -> Step:
    """Check every change of level of the left finger so far: the level before, the level, and whether it is worse."""

    def step(run: Run) -> None:
        warnings = [body for body in run.published("warning") if body["finger"] == "left"]
        assert [(body["previous"], body["level"], body["rising"]) for body in warnings] == list(expected)

    return step


COURSES: dict[str, tuple[str, list[Step]]] = {
    # levels
    **{
        f"the level {word} is reached": (
            RIG,
            [
                image(),
                wrench(0.0),
                *(wrench(*contact) for contact in CONTACTS[word]),
                newest("slip.left", level=word, level_code=code),
            ],
        )
        for code, word in enumerate(CONTACTS)
    },
    "every change of level is published at once, with the one before": (
        RIG,
        [
            *(
                step
                for n, word in enumerate(LEVELS_IN_TURN)
                for k in range(4 if n in (5, 7) else 1)  # a level is left after a while
                for step in (wait(100), image(np.full((4, 4), 100 + (n + k) % 2)), wrench(*CONTACTS[word][0]))
            ),
            changes(
                ("unknown", "no_contact", False),
                ("no_contact", "stable", True),
                ("stable", "caution", True),
                ("caution", "warning", True),
                ("warning", "caution", False),
                ("caution", "unknown", False),
                ("unknown", "caution", True),
                ("caution", "stable", False),
                ("stable", "no_contact", False),
            ),
            newest("warning", frame="left_pad"),
        ],
    ),
    "unknown is worse than stable": (
        RIG,
        [
            image(),
            HELD_LIGHTLY,
            wrench(math.nan),
            changes(("unknown", "stable", False), ("stable", "unknown", True)),
        ],
    ),
    "every reading gets a verdict, whatever is published": (
        RIG,
        [
            image(),
            *(wrench(10.0, (pull, 0.0)) for pull in (3.0, 3.75, 4.3)),  # at 250 Hz one of them would be published
            changes(("unknown", "stable", False), ("stable", "caution", True), ("caution", "warning", True)),
            count("slip.left", 3),
        ],
    ),
    "a warning has reasons and utilisation": (
        RIG,
        [
            image(),
            NEAR,
            newest("warning", reasons=["translation"], utilisation=pytest.approx(0.92, rel=1e-5), level_code=3),
            wrench(0.0),
            newest("warning", utilisation=None),
        ],
    ),
    "a contact that no grip holds has no utilisation": (
        RIG,
        [
            image(100 * np.eye(16, dtype=int)[5].reshape(4, 4)),
            wrench(10.0, (0.0, 0.0), 0.01, (-0.002, -0.002)),
            newest("warning", utilisation=None, reasons=["unsupportable", "rotation", "tipping"]),
        ],
    ),
    "a pad that measures the force gives verdicts too": (
        RIG,
        [
            skin(0.0),
            level("no_contact", finger="right"),
            skin(8.0, (1.0, 0.0)),
            level("stable", finger="right"),
            skin(8.0, (3.6, 0.0)),
            newest("slip.right", level="warning", model="exact"),
            newest("wrench.right", force_n=pytest.approx([3.6, 0.0, -8.0])),
            newest("tactile.right", loads_n=pytest.approx([2.0] * 4)),
        ],
    ),
    "an overloaded sensor makes the verdict unknown": (
        RIG,
        [
            image(),
            wrench(10.0, (1.0, 0.0), status=2),
            level("unknown", "overload"),
            newest("wrench.left", status=["overload"]),
        ],
    ),
    # rates
    "rates are limited by the time of the readings": (
        RIG,
        [
            *[image(), *[HELD_LIGHTLY] * 5] * 200,
            count("slip.left", 248, 252),
            count("wrench.left", 248, 252),
            count("tactile.left", 48, 52),
        ],
    ),
    "a rate may be raised until every reading is published": (
        LEFT + "[rates]\nslip_hz = 1000.0\nwrench_hz = 100.0\n",
        [wrench(0.0, times=500), count("slip.left", 500), count("wrench.left", 49, 51)],
    ),
    "status is published once a second, and when a link changes": (
        RIG,
        [
            *[wait(5), tick] * 1000,
            count("status", 8, 10),  # four of them for the links
            down("left.pad"),
            newest("status", streams={"left.pad": {"health": Health.ERROR}}),
            up("left.pad"),
            newest("status", streams={"left.pad": {"health": Health.STALE}}, uptime_s=pytest.approx(5.0)),
            lambda run: set_equal(run.published("status")[-1]["streams"], "left.wrench left.pad right.pad gripper"),
            newest("status", object_name=None, object_by=None, object_t_ns=None),
            newest("status", fingers={"left": {"level": "unknown", "reasons": ["stale"], "evidence": []}}),
            newest("status", fingers={"left": {"tare_id": 0, "tare_busy": False, "mu": 0.5, "mu_source": "config"}}),
            newest("status", fingers={"left": {"mu_low": pytest.approx(0.4242, abs=1e-4)}}),
            newest("status", fingers={"left": {"mu_high": pytest.approx(0.5894, abs=1e-4), "mu_d": None}}),
            newest("status", fingers={"left": {"mu_by": None, "mu_t_ns": None}}),
        ],
    ),
}


def set_equal(found: Any, words: str) -> None:
    assert set(found) == set(words.split())


@pytest.mark.parametrize("name", COURSES)
def test_a_course_of_readings(name: str) -> None:
    play(*COURSES[name])


def test_the_largest_message_is_within_the_limits_of_a_client() -> None:
    run = Run(LEFT.replace("rows = 4", "rows = 64").replace("cols = 4", "cols = 64"))
    run.image(np.random.default_rng(0).integers(6, 30000, (64, 64)))
    body = run.published("tactile.left")[-1]
    assert len(body["loads_n"]) == decode(encode(body), MESSAGE_LIMITS)["active"] == 4096
