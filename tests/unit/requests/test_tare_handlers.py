"""Tares: only what is free is tared, the holder of the lease decides, and what was refused stays refused."""

from __future__ import annotations

import math
from typing import Any

import pytest
from engine_rig import GRIPPER, LEFT, RIG, RIGHT, Run
from run_courses import (
    Step,
    approx,
    ask,
    bring_up,
    feel,
    follow,
    grip,
    image,
    lease,
    level,
    newest,
    no_image,
    play,
    skin,
    tick,
    wait,
    wrench,
)

BEN: dict[str, Any] = {"by": b"ben"}
L: dict[str, Any] = {"finger": "left"}
NO_LEASE, IN_CONTACT, NOT_READY = ("no_lease", ""), ("in_contact", "finger"), ("not_ready", "finger")
BIASED = wrench(25.0, (3.0, 0.0))
ONCE: dict[str, Any] = {"id": "c-1", "deadline_ns": 100_400_000_000, "finger": "left"}


def tared(number: int, **more: Any) -> Step:
    return ask("tare.get", {"tare_id": number} | more, **L)


COURSES: dict[str, tuple[str, list[Step]]] = {
    # tares
    "a free finger is tared and verified": (
        RIG,
        [
            no_image,
            wrench(0.2, (0.1, 0.0)),
            ask(
                "tare",
                {"seconds": 0.01, "verified": True, "tare_id": 0, "tare_ids": {"wrench": 0}, **L},
                seconds=0.01,
                **L,
            ),
            tared(0, busy=True),
            wrench(0.2, (0.1, 0.0), times=12),
            tared(1, busy=False, readings=10, taken_t_ns=100_011_000_000, offset=approx(0.1, 0.0, -0.2, 0.0, 0.0, 0.0)),
            newest("slip.left", tare_id=1),
        ],
    ),
    "a tared finger in contact is not tared again": (
        RIG,
        [
            bring_up,
            wrench(5.0),
            ask("tare", IN_CONTACT, **L),
            wrench(0.0),
            ask("tare", {"seconds": 0.5, "verified": True}, **L),
        ],
    ),
    "a finger whose image is pressed is not tared": (RIG, [image(), wrench(0.0), ask("tare", IN_CONTACT, **L)]),
    "a silent finger is not tared": (
        RIG,
        [ask("tare", NOT_READY, **L), wrench(0.0), wait(100), tick, ask("tare", NOT_READY, **L)],
    ),
    "A2 a tare that was refused stays refused": (
        RIG,
        [ask("tare", NOT_READY, **ONCE), wrench(0.0), ask("tare", NOT_READY, **ONCE)],
    ),
    "an averaging time out of range is refused": (
        RIG,
        [
            wrench(0.0),
            *(ask("tare", ("out_of_range", "seconds"), seconds=s, **L) for s in (0, -1.0, 10.1, 1e300)),
            tared(0, busy=False),
        ],
    ),
    "readings that are not finite stay out of a tare": (
        RIG,
        [
            wrench(0.0),
            ask("tare", seconds=0.02, **L),
            *(wrench(math.nan if k in (5, 11) else 0.3) for k in range(24)),
            tared(1, offset=approx(0.0, 0.0, -0.3, 0.0, 0.0, 0.0)),
        ],
    ),
    "undo restores the tare before, once": (
        RIG,
        [
            ask("tare.undo", NOT_READY, **L),
            bring_up,
            ask("tare.undo", {"tare_id": 0, "taken_t_ns": None}, **L),
            tared(0),
            ask("tare.undo", NOT_READY, **L),
        ],
    ),
    "no other client tares the sensors of the holder": (
        RIG,
        [
            bring_up,
            *(
                ask(op, ("lease_held", ""), stream=stream, **L, **BEN)
                for op in ("tare", "tare.undo")
                for stream in ("wrench", "pad")
            ),
            ask("tare.get", {"tare_id": 1}, **L, **BEN),
            ask("tare.undo", **L),
            ask("lease.release"),
            feel(0.0),
            ask("tare", **L, **BEN),
        ],
    ),
    "only the holder undoes a tare in contact": (
        RIG,
        [
            bring_up,
            ask("lease.release"),
            feel(5.0),
            ask("tare.undo", NO_LEASE, **L),
            tared(1),
            lease,
            ask("tare.undo", **L),
        ],
    ),
}


UNTARED: dict[str, tuple[str, list[Step]]] = {
    "a bias that looks like a contact can be tared but not verified": (
        RIG,
        [BIASED, ask("tare", {"verified": False}, seconds=0.01, **L), *[BIASED] * 12, level("no_contact")],
    ),
    "what a grip holds is not tared away by a sensor that nothing else vouches for": (
        LEFT.partition("[finger.left.pad]")[0] + RIGHT + GRIPPER,
        [
            lambda run: setattr(run, "image", lambda *_: []),
            lambda run: run.bring_up(tare=False),
            *(ask("tare", {"verified": False}, **L), ask("tare.undo", **L), grip(5.0), ask("tare", IN_CONTACT, **L)),
        ],
    ),
}


@pytest.mark.parametrize("name", COURSES | UNTARED)
def test_A2_a_course_of_tares(name: str) -> None:
    text, steps = (COURSES | UNTARED)[name]
    play(text, steps, zeros=name in COURSES)


def test_a_pad_that_measures_the_force_is_tared_by_its_taxels(run: Run) -> None:
    run.exact = True
    light, right = skin(0.4, (0.2, 0.0)), {"finger": "right"}
    offset = pytest.approx([1050.0, 1000.0, 1100.0] * 4)
    follow(
        run,
        [
            light,
            ask("tare", {"verified": True}, seconds=0.1, **right),
            *[light] * 12,
            ask("tare.get", {"tare_id": 1, "offset": offset, "std": [0.0] * 12}, **right),
            skin(5.0),
            ask("tare", IN_CONTACT, **right),
        ],
    )
