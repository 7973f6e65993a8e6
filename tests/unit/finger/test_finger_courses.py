"""Zeros of a finger, through the engine: what is not known is unknown, and never free or safe."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_rig import GRIPPER, LEFT, NO_IMAGE, RIG, RIGHT, Run
from run_courses import (
    Step,
    ask,
    bring_up,
    follow,
    got,
    grip,
    health,
    image,
    lease,
    level,
    newest,
    no_image,
    play,
    serve,
    skin,
    status,
    tick,
    wait,
    wrench,
)

from slipd.events import Bytes
from slipd.tools.sim.emulated_pads import encode_message

RAW_PAD = RIGHT.partition("tare =")[0]
PADLESS = LEFT.partition("[finger.left.pad]")[0]
L: dict[str, Any] = {"finger": "left"}
R: dict[str, Any] = {"finger": "right"}
PAD: dict[str, Any] = {"finger": "left", "stream": "pad"}
NOT_READY, IN_CONTACT, DROP = ("not_ready", "finger"), ("in_contact", "finger"), ("in_contact", "drop")
NOT_TARED, PULLED = level("unknown", "not_tared"), level("unknown", "pulled")
RAW = np.array([[16456, 16671, 37526], [16310, 16789, 37346], [16149, 16718, 37182], [15712, 16733, 37971]])
"""Counts of a real pad without a load: 150 N, if they were forces."""


def counted(number: float) -> Step:
    """Send an image of equal counts of the left pad."""
    return image(np.full((4, 4), number, dtype=int))


def images(times: int, number: float, normal_n: float | None = None) -> list[Step]:
    """Images of equal counts every 10 ms, and a force before each where one is named."""
    force = [] if normal_n is None else [wrench(normal_n, ms=0.0)]
    return [wait(5), tick, *force, wait(5), counted(number)] * times


def noisy_images(times: int) -> list[Step]:
    """Images of a pad that nothing touches, whose counts flicker by one, and a force of 0.2 N before each."""
    return [step for k in range(times) for step in images(1, 300 + k % 2, 0.2)]


def readings(times: int, number: int, normal_n: float = 0.0, pull_n: float = 0.0) -> list[Step]:
    """Both sensors of the left finger every 10 ms; a pressed pad flickers."""
    return [
        step
        for k in range(times)
        for step in (wait(5), tick, counted(number + k % 2 * (number > 0)), wrench(normal_n, (pull_n, 0.0), ms=5.0))
    ]


def raw(times: int = 3, press: int = 0, counts: np.ndarray = RAW) -> Step:
    """Messages of the right pad, whose counts flicker a little."""

    def step(run: Run) -> None:
        for k in range(times):
            run.wait(10)
            run._message += 1
            shown = counts + np.array((0, 0, press + k % 2))
            run.feed(Bytes("right.pad", encode_message(run._message, {"2": shown}, 1.7e9)))

    return step


PAD_ALIKE: Any = pytest.approx([300.0] * 16)
TARED: list[Step] = [bring_up, counted(4)]
COURSES: dict[str, tuple[str, bool, list[Step]]] = {
    # tares of pad and force sensor, each with a zero of its own
    "a pad is tared and undone apart from the force sensor": (
        RIG,
        True,
        [
            *TARED,
            ask("tare", {"seconds": 0.1, "verified": True, "tare_id": 0, "tare_ids": {"pad": 0}}, seconds=0.1, **PAD),
            status(streams={"left.pad": {"tare_busy": True}}),
            *images(14, 4, 0.0),
            got(1, "pad", busy=False, by="ann", offset=pytest.approx([4.0] * 16)),
            got(1),
            status(streams={"left.pad": {"tare_id": 1}}, fingers={"left": {"tare_id": 1}}),
            *images(20, 104),
            newest("tactile.left", tare_id=1, loads_n=pytest.approx([1.0] * 16)),
            lease,  # something presses
            ask("tare.undo", {"stream": "pad", "tare_id": 0, "by": "config"}, **PAD),
            *images(20, 104),
            newest("tactile.left", tare_id=0, loads_n=pytest.approx([1.04] * 16)),
            lease,
            ask("tare.undo", NOT_READY, **PAD),
            got(1),
        ],
    ),
    "stream all tares both, and then each shows whether the finger is free": (
        RIG,
        False,
        [
            counted(300),
            wrench(0.2),
            ask(
                "tare",
                {"verified": False, "tare_id": 0, "tare_ids": {"wrench": 0, "pad": 0}},
                stream="all",
                seconds=0.1,
                **L,
            ),
            *images(14, 300, 0.2),
            got(1, busy=False, offset=pytest.approx([0.0, 0.0, -0.2, 0.0, 0.0, 0.0], abs=1e-6)),
            got(1, "pad", busy=False, offset=PAD_ALIKE),
            ask("tare", {"verified": True}, stream="all", seconds=0.1, **L),
            # the two in progress, and the one before
            *(ask("tare.undo", stream=stream, **L) for stream in ("wrench", "pad", "wrench")),
            wrench(0.2),
            counted(400),
            *(ask("tare", IN_CONTACT, stream=stream, **L) for stream in ("all", "wrench")),
        ],
    ),
    "the noise of a pad without a threshold does not prevent a tare of the force sensor, and a touch does": (
        RIG.replace("threshold = 0.05", "threshold = 0.0"),
        False,
        [
            counted(300),
            wrench(0.2),
            ask("tare", seconds=0.1, **PAD),
            *noisy_images(14),
            ask("tare", {"verified": False}, seconds=0.1, **L),  # noise may hide a touch
            *noisy_images(14),
            got(1, busy=False, offset=pytest.approx([0.0, 0.0, -0.2, 0.0, 0.0, 0.0], abs=1e-6)),
            counted(310),
            wrench(0.2),
            ask("tare", "only its pad shows this", **L),
        ],
    ),
    "a stream that is unknown or silent is refused": (
        RIG,
        True,
        [
            wrench(0.0),
            skin(0.4),
            ask("tare", ("out_of_range", "stream"), stream="both", **L),
            ask("tare.get", ("out_of_range", "stream"), stream="all", **L),
            ask("tare.undo", ("out_of_range", "stream"), stream="all", **L),
            ask("tare", ("not_ready", "stream"), stream="wrench", **R),
            ask("tare", ("unknown_finger", "finger"), finger="middle", stream="pad"),
            ask("tare", ("bad_type", "stream"), stream=1, **L),
            ask("tare", NOT_READY, **PAD),  # it is silent
            ask("tare", stream="all", **R),
        ],
    ),
    # fingers that were never tared
    "a pad with raw counts is unknown until it is tared, and again after an undo": (
        RAW_PAD + GRIPPER,
        False,
        [
            raw(),
            level("unknown", "not_tared", finger="right"),
            newest("slip.right", normal_n=None, utilisation=None, tare_origin=None),
            health("right.pad", "tare it while nothing touches the finger"),
            lease,
            serve(50),
            ask("gripper.activate", DROP),
            raw(),
            ask("tare", {"verified": False}, seconds=0.1, **R),
            raw(14),
            level("no_contact", finger="right"),
            health("right.pad", without="tare it"),
            raw(1, press=1000),
            level("stable", finger="right"),
            raw(),
            ask("tare.undo", **R),
            raw(1),
            level("unknown", "not_tared", finger="right"),
        ],
    ),
    **{
        f"a pad that reads {counts} before its tare may hide a load, or show one that is none": (
            RAW_PAD + GRIPPER,
            False,
            [raw(3, counts=np.full((4, 3), (0, 0, counts))), level("unknown", "not_tared", finger="right")],
        )
        for counts in (0, 10, 5000, 9000)
    },
    **{
        f"an untared force sensor that reads {n} N is unknown, and a clear pull is one": (
            LEFT,
            False,
            [
                *[no_image, wrench(n, ms=10.0)] * 30,
                NOT_TARED,
                newest("tactile.left", image_reasons=["not_tared"]),
                wrench(-30.0, ms=10.0),
                PULLED,
            ],
        )
        for n in (0.0, 8.0, -8.0)
    },
    **{
        f"images with an offset of {offset} count once the pad is seen to read nothing, or tared": (
            LEFT,
            False,
            [
                wrench(0.0),
                ask("tare", {"verified": False}, seconds=0.05, **L),
                wrench(0.0, times=60),
                *readings(30, offset),
                level("no_contact"),  # by the force sensor
                *(
                    [
                        *readings(1, offset, 8.0),
                        level("unknown", "not_tared", "rotation_unobserved"),
                        *readings(3, offset, 8.0, 7.0),
                        level("warning", "not_tared", "translation"),  # the force alone proves it
                        *readings(1, offset),
                        ask("tare", {"verified": True}, seconds=0.1, **PAD),
                        *readings(14, offset),
                    ]
                    if offset
                    else []
                ),
                newest("tactile.left", tare_origin="measured" if offset else "observed"),
                *readings(1, offset + 100, 8.0),
                level("stable"),
            ],
        )
        for offset in (0, 300)
    },
    "a touch that the pad shows first is not an offset": (
        RIG,
        True,
        [bring_up, *readings(10, 100), wrench(8.0), level("stable")],
    ),
    "an untared sensor is not tared while a grip is in force, which may be its bias": (
        PADLESS + RIGHT + GRIPPER,
        False,
        [
            lambda run: setattr(run, "image", lambda *_: []),
            lambda run: run.bring_up(tare=False),
            ask("tare", {"verified": False}, seconds=0.1, **L),
            ask("tare.undo", **L),
            grip(5.0),
            ask("tare", IN_CONTACT, seconds=0.1, **L),
            ask("tare", "a grip is in force", seconds=0.1, **L),
        ],
    ),
}


@pytest.mark.parametrize("name", COURSES)
def test_a_course_of_a_finger(name: str) -> None:
    text, zeros, steps = COURSES[name]
    play(text, steps, zeros=zeros)


ENDS: dict[str, tuple[str, str, Callable[[str], list[Step]]]] = {
    "press": ("contact", "a contact began", lambda _: [wrench(5.0, ms=10.0)]),
    "silence": (
        "silent",
        "the stream fell silent",
        lambda stream: [wait(10), tick, wrench(0.0, ms=0.0) if stream == "pad" else image(NO_IMAGE)] * 60,
    ),
    "unplug": ("ended", "the stream ended", lambda stream: [lambda run: run.down(f"left.{stream}")]),
    "undo": ("undone", "undone before it was taken", lambda stream: [ask("tare.undo", stream=stream, **L)]),
}


@pytest.mark.parametrize("stream", ["wrench", "pad"])
@pytest.mark.parametrize("event", ENDS)
def test_a_tare_is_given_up(run: Run, stream: str, event: str) -> None:
    reason, text, steps = ENDS[event]
    follow(run, [bring_up, no_image])
    before = run.ask("tare.get", finger="left", stream=stream)["result"]["tare_id"]
    happens = steps(stream)
    follow(run, [ask("tare", stream=stream, seconds=0.9, **L), *happens[: 48 * 3]])
    survives = [got(before, stream, busy=True), *happens[48 * 3 :]] if event == "silence" else []
    follow(run, [*survives, got(before, stream, busy=False, given_up=text, given_up_reason=reason)])
    if event == "press":
        ask("tare", IN_CONTACT, stream=stream, **L)(run)


def test_tare_of_a_charge_pad_keeps_its_loads() -> None:
    loads = []
    for tares in (False, True):
        tare = [ask("tare", seconds=0.1, **PAD)] if tares else []
        held = [*images(30, 40, 0.0), wrench(16.0, ms=0.0), *images(20, 140, 16.0)]
        offset = pytest.approx([40.0 if tares else 0.0] * 16)
        course = [*images(10, 40, 0.0), *tare, *held, ask("tare.get", {"offset": offset}, **PAD)]
        run = play(LEFT + "charge_tau_s = 2.0\n", course)
        loads.append(run.published("tactile.left")[-1]["loads_n"])
    assert loads[0] == pytest.approx([1.0] * 16, rel=0.1)
    assert loads[1] == pytest.approx(loads[0], abs=1e-9)
