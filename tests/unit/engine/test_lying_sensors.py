"""No grip is raised on readings that only look fresh, by request or reflex; engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import msgpack
import numpy as np
import pytest
from engine_rig import GRIPPER, LEFT, RIGHT, Run
from grasp_table import grasp_table
from run_courses import (
    Step,
    ask,
    bring_up,
    down,
    follow,
    grip,
    image,
    level,
    serve,
    skin,
    sleep,
    tick,
    up,
    wait,
    wrench,
)

from slipd.devices import bota
from slipd.events import Bytes
from slipd_client.messages import Health

MS = 1_000_000
RAISE = ("not_ready", "delta_n")

SENSORS = {
    "rate_hz = 1000.0": "rate_hz = 200.0",
    "stuck_after = 0": "stuck_after = 50\nrange_n = 80.0",
    'device = "pvdf"\nport = "/dev/left-pad"': 'device = "external"\nport = "ipc:///run/pad"\nsensor = "left.pad"',
    "axis_scale = [0.01]": "axis_scale = [1.0]",
}
GRASP = f"""
{grasp_table()}
[reflex]
enabled = true
"""
"""The left force sensor at 200 Hz, whose repeats count; the left pad is pushed by another process, as numbers in N."""
PULL_N = 4.0
"""A pull on a grip of 5 N that asks for far more."""


class Hand:
    """Both fingers hold an object with 5 N; readings carry noise unless their values are given."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.rng = np.random.default_rng(1)
        run.image = self.image
        run.up()
        run.bring_up()
        run.grip(5.0)
        self.last: tuple[np.ndarray, np.ndarray] = np.zeros(3), np.zeros(3)
        self.live(20)

    def image(self, counts: Iterable[float] | None = None) -> None:
        """Send an image of the left pad: the given one, or one in which every taxel differs from the last."""
        run = self.run
        values = 0.3 + 0.01 * self.rng.random(16) if counts is None else 0.01 * np.ravel(counts)
        body = {"stream": "left.pad", "t_ns": run.t_ns, "values": values.tolist()}
        run.feed(Bytes("left.pad", msgpack.packb(body)))

    def wrench(self, force: Any = None, torque: Any = None, *, pull_n: float = 0.0) -> None:
        """Serve the gripper for 5 ms, then send a reading of the left force sensor."""
        run = self.run
        run.serve_gripper(5)
        if force is None:
            force = np.array((pull_n, 0.0, -5.0)) + self.rng.normal(0.0, 0.02, 3)
            torque = self.rng.normal(0.0, 0.0005, 3)
        self.last = np.asarray(force, dtype=float), np.zeros(3) if torque is None else np.asarray(torque)
        run.feed(Bytes("left.wrench", bota.encode_frame(*self.last, run.t_ns // 1000)))

    def live(self, count: int, **reading: float) -> None:
        """Send readings of every sensor."""
        for _ in range(count):
            self.wrench(**reading)
            self.image()
            self.run.skin(5.0, ms=0.0)

    def freeze(self) -> None:
        """Repeat the last reading of the force sensor, beside new readings of the others."""
        self.wrench(*self.last)
        self.image()
        self.run.skin(5.0, ms=0.0)


MAY_REST = {"stuck_after = 0": "stuck_after = 0\nrange_n = 80.0"}
SPOILT = np.where(np.arange(16) == 5, math.nan, 30.0)
LOWERED = ask("grip.set", force_n=4.5)
"""Lowering needs no sensor."""
RAISED = ask("grip.adjust", delta_n=0.2)
REFUSED = ask("grip.adjust", RAISE, delta_n=0.2)
"""A raise that is too small to break any other rule."""
HandStep = Callable[[Hand], object]


def on_run(*steps: Step) -> HandStep:
    """Steps of the engine's run."""
    return lambda hand: follow(hand.run, steps)


def live(count: int = 1, **reading: float) -> HandStep:
    return lambda hand: hand.live(count, **reading)


def freeze(count: int, *steps: Step) -> HandStep:
    """Repeat a reading, and then check something, so many times."""
    return lambda hand: [(hand.freeze(), follow(hand.run, steps)) for _ in range(count)]


def force(*force_n: float, **reading: float) -> HandStep:
    """Send one reading of the left force sensor: this one, or one with noise."""
    return lambda hand: hand.wrench(np.array(force_n) if force_n else None, **reading)


def look(counts: Any = None) -> HandStep:
    """Send one image of the left pad."""
    return lambda hand: hand.image(counts)


def acts(least: int, most: int | None = None) -> HandStep:
    """Check how often the reflex acted so far."""

    def step(hand: Hand) -> None:
        found = [body["reflex"] for body in hand.run.published("gripper") if body["reflex"] is not None]
        assert least <= len(found) <= (least if most is None else most)

    return step


def alarmed(hand: Hand) -> None:
    assert hand.run.level()[0] in ("warning", "slipping")


def images(*expected: tuple[bool, list[str]]) -> HandStep:
    """Check the last messages about images of the left pad."""

    def step(hand: Hand) -> None:
        bodies = hand.run.published("tactile.left")[-len(expected) :]
        assert [(body["image_ok"], body["image_reasons"]) for body in bodies] == list(expected)
        assert all(body["loads_n"] is None for body in bodies if not body["image_ok"])

    return step


def healthy(*words: str, severity: Health = Health.ERROR, stream: str = "left.pad") -> HandStep:
    """Check severity and message of a stream."""

    def step(hand: Hand) -> None:
        found = hand.run.ask("status")["result"]["streams"][stream]
        assert found["health"] == severity
        assert all(word in found["message"] for word in words), found["message"]

    return step


WELL, RARELY = healthy(severity=Health.OK), "[rates]\ntactile_hz = 0.001\n"
REST: list[HandStep] = [force(0.0, 0.0, 0.0), look([0.0] * 16), on_run(skin(0.0, ms=0.0))]
COURSES: dict[str, tuple[str, dict[str, str], list[HandStep]]] = {
    "the reflex does not raise again on a frozen sensor": (
        GRASP,
        {},
        [force(pull_n=PULL_N), acts(1), freeze(40), acts(1), live(1, pull_n=PULL_N), acts(2)],
    ),
    "a sensor whose readings may repeat is never stuck, and never raises while they do": (
        "",
        MAY_REST,
        [on_run(RAISED), freeze(100, REFUSED), on_run(level("stable"), LOWERED), live(), on_run(RAISED)],
    ),
    "the reflex does not raise while readings that may repeat do": (
        GRASP,
        MAY_REST,
        [
            force(pull_n=PULL_N),
            acts(1),
            freeze(40),
            alarmed,
            acts(1),
            live(4, pull_n=PULL_N),
            acts(2, 9),
        ],
    ),
    **{
        f"no raise on an image with a taxel of {bad}": (
            "",
            {},
            [
                *[
                    live(),
                    look(np.where(np.arange(16) == 5, 100.0 * bad, 30.0)),
                    on_run(REFUSED),
                    force(),
                    on_run(level("unknown", "rotation_unobserved")),
                ]
                * 50,
                live(2),
                on_run(level("stable"), RAISED),
            ],
        )
        for bad in (math.nan, math.inf, 3e38)
    },
    "the reflex does not raise on an unusable image, although translation alone proves the warning": (
        GRASP,
        {},
        [
            look(np.full(16, math.nan)),
            *[force(pull_n=PULL_N), look(np.full(16, math.nan)), on_run(skin(5.0, ms=0.0))] * 20,
            on_run(level("warning", "translation")),
            acts(0),
        ],
    ),
    "an image is published when it becomes unusable, with reasons, and usable again": (
        RARELY,
        {},
        [
            *(
                step
                for shown, seen in (
                    (None, WELL),
                    (SPOILT, healthy("not finite numbers")),
                    (SPOILT, healthy("not finite numbers")),
                    (None, WELL),
                    (np.full(16, 1e14), healthy("larger than those of any pad")),
                    (None, WELL),
                )
                for step in (force(), look(shown), seen)
            ),
            images((False, ["invalid", "not_finite"]), (True, []), (False, ["garbage"]), (True, [])),
        ],
    ),
    "a missing image is published as stale after silence, and after loss of the link": (
        RARELY,
        {},
        [
            *[force(), on_run(tick)] * 10,
            look(),
            on_run(down("left.pad"), up("left.pad")),
            look(),
            images((False, ["stale"]), (True, []), (False, ["stale"]), (True, [])),
        ],
    ),
    **{
        f"a force of {force_n} N along axis {axis} is unknown from the first reading on": (
            "",
            {},
            [
                force(*(force_n if k == axis else n for k, n in enumerate((0.0, 0.0, -5.0)))),
                on_run(level("unknown", "garbage"), REFUSED),
                healthy("range_n", stream="left.wrench"),
                live(),
            ]
            * 3,
        )
        for force_n in (3e38, -3e38, 81.0, 1e30)
        for axis in (0, 2)
    },
    "a jump allows no raise before the next reading confirms it": (
        "",
        {},
        [force(0.0, 0.0, -30.0), on_run(REFUSED), force(0.0, 0.0, -30.1), on_run(RAISED)],
    ),
    **{
        f"repeated readings show a free finger only where they may repeat: stuck_after = {stuck_after}": (
            "",
            {"stuck_after = 0": f"stuck_after = {stuck_after}\nrange_n = 80.0"},
            [
                *REST * 2,
                on_run(ask("tare", finger="left", seconds=0.1)),
                *(step for k in range(70) for step in (force(0.0, 0.0, 1e-3 * (k % 2 if k < 40 else 1)), *REST[1:])),
                on_run(level("no_contact"), ask("gripper.open", refusal)),
            ],
        )
        for stuck_after, refusal in ((0, None), (200, ("in_contact", "drop")))
    },
}


def make_hand(more: str = "", **changes: str) -> Hand:
    text = LEFT + RIGHT + GRIPPER + more
    for old, new in (SENSORS | changes).items():
        assert old in text
        text = text.replace(old, new, 1)
    return Hand(Run(text))


@pytest.mark.parametrize("name", COURSES)
def test_a_course_of_a_hand(name: str) -> None:
    more, changes, steps = COURSES[name]
    hand = make_hand(more, **changes)
    for step in steps:
        step(hand)


@pytest.mark.no_cover
def test_F1_no_raise_from_the_first_repeated_reading_on_and_unknown_within_100_ms() -> None:
    hand, levels = make_hand(), []
    follow(hand.run, [level("stable"), RAISED])
    hand.live(60)
    last_good_ns = hand.run.t_ns
    for _ in range(60):
        hand.freeze()
        REFUSED(hand.run)
        assert hand.run.refusal("grip.set", force_n=4.5) != ("not_ready", "force_n"), "lowering needs no sensor"
        levels.append((hand.run.t_ns - last_good_ns, hand.run.level()))
    unknown = [t_ns for t_ns, found in levels if found == ("unknown", ["stuck"])]
    assert unknown[0] <= 100 * MS
    at = len(levels) - len(unknown)
    assert [found for _, found in levels] == at * [("stable", [])] + len(unknown) * [("unknown", ["stuck"])]
    hand.live(1)
    follow(hand.run, [level("stable"), RAISED])


@pytest.mark.no_cover
def test_a_sensor_with_coarse_counts_may_raise_and_keeps_its_level() -> None:
    """One count is wider than the noise, so that seven of ten readings repeat the one before."""
    hand, granted, levels = make_hand(), 0, set()
    for k in range(400):
        hand.wrench(np.array((0.0, 0.0, -5.0)) + 0.02 * np.rint(0.31 * hand.rng.normal(size=3)), np.zeros(3))
        hand.image()
        hand.run.skin(5.0, ms=0.0)
        levels.add(hand.run.level()[0])
        granted += k >= 200 and hand.run.engine._fingers["left"].trust.for_raise(hand.run.t_ns)
    assert levels == {"stable"}
    assert granted > 150


def test_a_finger_without_a_pad_publishes_no_image() -> None:
    run = Run(LEFT.partition("[finger.left.pad]")[0])
    run.up()
    follow(run, [wrench(5.0), tick, wait(5), sleep(1_000 * MS), level("unknown", "stale")])
    assert run.published("tactile.left") == []


@pytest.mark.no_cover
def test_no_raise_on_an_image_that_repeats_while_the_force_changes() -> None:
    hand, same = make_hand(), np.full(16, 30.0)
    for normal_n, refusal in ((5.0, None), (5.0, None), (5.7, RAISE), (5.7, RAISE)):
        hand.live(60)
        hand.image(same)
        for _ in range(2):
            hand.wrench(np.array((0.0, 0.0, -normal_n)) + hand.rng.normal(0.0, 0.002, 3))
            hand.image(same)
            hand.run.skin(5.0, ms=0.0)
        ask("grip.adjust", refusal, delta_n=0.2)(hand.run)


@pytest.mark.parametrize("stuck_after", [50, 0])
def test_a_pad_that_measures_the_force_and_repeats_never_raises_and_is_stuck_unless_it_may_rest(
    stuck_after: int,
) -> None:
    run = Run((LEFT + RIGHT + GRIPPER).replace('sensor = "2"', f'sensor = "2"\nstuck_after = {stuck_after}'))
    run.exact, levels = True, []
    run.up()
    follow(run, [bring_up, grip(5.0)])

    def live(right_n: float, *steps: Step) -> None:
        counts = np.full((4, 4), 100 + run.t_ns // MS % 7)
        follow(run, [serve(5), wrench(5.0), image(counts), skin(right_n, ms=4.0), *steps])

    for k in range(40):
        live(5.0 + 0.01 * (k % 2))
    RAISED(run)
    for _ in range(12):
        live(5.01, REFUSED)
        levels.append(run.level("right"))
    stuck = levels.count(("unknown", ["stuck"]))
    assert levels == [("stable", [])] * (12 - stuck) + [("unknown", ["stuck"])] * stuck
    assert (stuck >= 3) is (stuck_after > 0), "within 100 ms at 100 Hz"
    assert ("it hangs" in run.ask("status")["result"]["streams"]["right.pad"]["message"]) is (stuck > 0)
    live(5.0, level("stable", finger="right"), RAISED)


@pytest.mark.no_cover
def test_levels_do_not_flicker_when_readings_repeat_now_and_then() -> None:
    hand = make_hand()
    before = len(hand.run.published("warning"))
    for k in range(100):
        if k % 7:
            hand.live(1)
        else:
            hand.freeze()
    assert hand.run.published("warning")[before:] == []
