"""No grip is raised on readings that only look fresh, by request or reflex; engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import msgpack
import numpy as np
import pytest
from engine_rig import LEFT, RIG, Run
from grasp_table import grasp_table
from nanoseconds import MS
from run_courses import (
    Step,
    ask,
    bring_up,
    count,
    down,
    during,
    follow,
    grip,
    health,
    image,
    level,
    play,
    serve,
    skin,
    sleep,
    status,
    tick,
    up,
    wait,
    wrench,
)

from slipd.devices import bota
from slipd.events import Bytes
from slipd_client.messages import Health

SENSORS = {
    "rate_hz = 1000.0": "rate_hz = 200.0",
    "stuck_after = 0": "stuck_after = 50\nrange_n = 80.0",
    'device = "pvdf"\nport = "/dev/left-pad"': 'device = "external"\nport = "ipc:///run/pad"\nsensor = "left.pad"',
    "axis_scale = [0.01]": "axis_scale = [1.0]",
}
"""The left force sensor at 200 Hz, whose repeats count; the left pad is pushed by another process, as numbers in N."""
GRASP = f"{grasp_table()}\n[reflex]\nenabled = true\n"
PULL_N = 4.0
"""A pull on a grip of 5 N that asks for far more."""


class Hand(Run):
    """Both fingers hold an object with 5 N; readings carry noise unless their values are given."""

    def __init__(self, more: str = "", **changes: str) -> None:
        text = RIG + more
        for old, new in (SENSORS | changes).items():
            assert old in text
            text = text.replace(old, new, 1)
        super().__init__(text)
        self.rng = np.random.default_rng(1)
        self.up()
        self.bring_up()
        self.grip(5.0)
        self.live(20)

    def image(self, counts: Iterable[float] | None = None) -> None:  # type: ignore[override]
        """Send an image of the left pad: the given one, or one in which every taxel differs from the last."""
        values = 0.3 + 0.01 * self.rng.random(16) if counts is None else 0.01 * np.ravel(counts)
        body = {"stream": "left.pad", "t_ns": self.t_ns, "values": values.tolist()}
        self.feed(Bytes("left.pad", msgpack.packb(body)))

    def read(self, force: Any = None, torque: Any = None, *, pull_n: float = 0.0) -> None:
        """Serve the gripper for 5 ms, then send a reading of the left force sensor."""
        self.serve_gripper(5)
        if force is None:
            force = np.array((pull_n, 0.0, -5.0)) + self.rng.normal(0.0, 0.02, 3)
            torque = self.rng.normal(0.0, 0.0005, 3)
        self.last = np.asarray(force, dtype=float), np.zeros(3) if torque is None else np.asarray(torque)
        self.feed(Bytes("left.wrench", bota.encode_frame(*self.last, self.t_ns // 1000)))

    def live(self, times: int, *reading: Any, **more: float) -> None:
        """Send readings of every sensor."""
        for _ in range(times):
            self.read(*reading, **more)
            self.image()
            self.skin(5.0, ms=0.0)


RAISE = ("not_ready", "delta_n")
LOWERED = ask("grip.set", force_n=4.5)
"""Lowering needs no sensor."""
RAISED = ask("grip.adjust", delta_n=0.2)
REFUSED = ask("grip.adjust", RAISE, delta_n=0.2)
"""A raise that is too small to break any other rule."""


def live(times: int = 1, **reading: float) -> Step:
    return lambda hand: hand.live(times, **reading)


def freeze(times: int, *steps: Step) -> Step:
    """Repeat a reading beside new ones of the other sensors, and then check something, so many times."""
    return lambda hand: [(hand.live(1, *hand.last), follow(hand, steps)) for _ in range(times)]


def force(*force_n: float, std_n: float = 0.0, **reading: float) -> Step:
    """Send one reading of the left force sensor: this one, or one with noise."""
    return lambda hand: hand.read(force_n + hand.rng.normal(0.0, std_n, 3) if force_n else None, **reading)


def coarse(hand: Hand) -> None:
    """Send readings in counts that are wider than the noise: seven of ten repeat the one before."""
    hand.live(1, np.array((0.0, 0.0, -5.0)) + 0.02 * np.rint(0.31 * hand.rng.normal(size=3)), np.zeros(3))


def mostly_raises(hand: Hand) -> None:
    """Check that coarse readings are trusted at most times."""
    granted = 0
    for _ in range(100):
        coarse(hand)
        granted += hand.engine._fingers["left"].trust.for_raise(hand.t_ns)
    assert granted > 75
    assert {body["level"] for body in hand.published("slip.left")[-100:]} == {"stable"}


def acts(least: int, most: int | None = None) -> Step:
    """Check how often the reflex acted so far."""

    def step(hand: Hand) -> None:
        found = [body["reflex"] for body in hand.published("gripper") if body["reflex"] is not None]
        assert least <= len(found) <= (least if most is None else most)

    return step


def alarmed(hand: Hand) -> None:
    assert hand.level()[0] in ("warning", "slipping")


def images(*expected: tuple[bool, list[str]]) -> Step:
    """Check the last messages about images of the left pad."""

    def step(hand: Hand) -> None:
        bodies = hand.published("tactile.left")[-len(expected) :]
        assert [(body["image_ok"], body["image_reasons"]) for body in bodies] == list(expected)
        assert all(body["loads_n"] is None for body in bodies if not body["image_ok"])

    return step


def faulty(words: str, stream: str = "left.pad") -> Step:
    """Check that a stream is not used, and why."""
    return health(stream, words, severity=Health.ERROR)


def stuck_within_100_ms(hand: Hand) -> None:
    """Every level since the last reading that was new: stable, and then unknown, without a flicker."""
    levels = [(body["level"], body["reasons"]) for body in hand.published("slip.left")[-60:]]
    stuck = levels.count(("unknown", ["stuck"]))
    assert levels == [("stable", [])] * (60 - stuck) + [("unknown", ["stuck"])] * stuck
    assert stuck > 60 - 20, "at 200 Hz"


NEWTONS = {"axis_scale = [0.01]": "axis_scale = [1.0]\ngain_error = 0.1"}
MAY_REST = {"stuck_after = 0": "stuck_after = 0\nrange_n = 80.0"}
SAME, SPOILT = image(np.full(16, 30.0)), image(np.where(np.arange(16) == 5, math.nan, 30.0))
HELD, PADLESS = skin(5.0, ms=0.0), LEFT.partition("[finger.left.pad]")[0]
PATCH = [image(np.where(np.isin(np.arange(16), (5, 6, 9, 10)), counts, 0.0)) for counts in (300.0, 301.0)]
WELL, RARELY = health("left.pad", severity=Health.OK), "[rates]\ntactile_hz = 0.001\n"
PULLED = level("unknown", "pulled")
NOTHING = force(0.0, 0.0, 0.0, std_n=0.02)
REST: list[Step] = [force(0.0, 0.0, 0.0), image([0.0] * 16), skin(0.0, ms=0.0)]
COURSES: dict[str, tuple[str, dict[str, str], list[Step]]] = {
    "no raise from the first repeated reading on, and unknown within 100 ms": (
        "",
        {},
        [
            *(level("stable"), RAISED, live(60), freeze(60, REFUSED, LOWERED), stuck_within_100_ms),
            *(live(), level("stable"), RAISED),
        ],
    ),
    **{
        f"a sensor that stands still but for {std_n} N is {what} where its noise is stated": (
            "",
            {"force_std_n = 0.0": "force_std_n = 0.02", "torque_std_nm = 0.0": "torque_std_nm = 0.0005"},
            [*[force(0.0, 0.0, -5.0, std_n=std_n), image(None), HELD] * 60, expected],
        )
        for std_n, what, expected in ((1e-9, "stuck", level("unknown", "stuck")), (5e-4, "well", level("stable")))
    },
    "the reflex does not raise again on a frozen sensor": (
        GRASP,
        {},
        [force(pull_n=PULL_N), acts(1), freeze(40), acts(1), live(1, pull_n=PULL_N), acts(2)],
    ),
    "a sensor whose readings may repeat is never stuck, and never raises while they do": (
        "",
        MAY_REST,
        [RAISED, freeze(100, REFUSED), level("stable"), LOWERED, live(), RAISED],
    ),
    "the reflex does not raise while readings that may repeat do": (
        GRASP,
        MAY_REST,
        [force(pull_n=PULL_N), acts(1), freeze(40), alarmed, acts(1), live(4, pull_n=PULL_N), acts(2, 9)],
    ),
    "a sensor with coarse counts may raise and keeps its level": ("", {}, [*[coarse] * 100, mostly_raises]),
    "levels do not flicker when readings repeat now and then": (
        "",
        {},
        [during([freeze(1), live(6)] * 15, "warning", 0)],
    ),
    **{
        f"no raise on an image with a taxel of {bad}": (
            "",
            {},
            [
                *[
                    live(),
                    image(np.where(np.arange(16) == 5, 100.0 * bad, 30.0)),
                    REFUSED,
                    force(),
                    level("unknown", "rotation_unobserved"),
                ]
                * 10,
                live(2),
                level("stable"),
                RAISED,
            ],
        )
        for bad in (math.nan, math.inf, 3e38)
    },
    "no raise on an image that repeats while the force changes": (
        "",
        {},
        [
            step
            for normal_n, refused in ((5.0, None), (5.0, None), (5.7, RAISE), (5.7, RAISE))
            for step in (
                *(live(60), SAME, *[force(0.0, 0.0, -normal_n, std_n=0.002), SAME, HELD] * 2),
                ask("grip.adjust", refused, delta_n=0.2),
            )
        ],
    ),
    "the reflex does not raise on an unusable image, although translation alone proves the warning": (
        GRASP,
        {},
        [SPOILT, *[force(pull_n=PULL_N), SPOILT, HELD] * 20, level("warning", "translation"), acts(0)],
    ),
    "an image is published when it becomes unusable, with reasons, and usable again": (
        RARELY,
        {},
        [
            *(
                step
                for shown, seen in (
                    (image(None), WELL),
                    (SPOILT, faulty("not finite numbers")),
                    (SPOILT, faulty("not finite numbers")),
                    (image(None), WELL),
                    (image(np.full(16, 1e14)), faulty("larger than those of any pad")),
                    (image(None), WELL),
                )
                for step in (force(), shown, seen)
            ),
            images((False, ["invalid", "not_finite"]), (True, []), (False, ["garbage"]), (True, [])),
        ],
    ),
    "a missing image is published as stale after silence, and after loss of the link": (
        RARELY,
        {},
        [
            *[force(), tick] * 10,
            *(image(None), down("left.pad"), up("left.pad"), image(None)),
            images((False, ["stale"]), (True, []), (False, ["stale"]), (True, [])),
        ],
    ),
    **{
        f"a force of {force_n} N along axis {axis} is unknown from the first reading on": (
            "",
            {},
            [
                force(*(force_n if k == axis else n for k, n in enumerate((0.0, 0.0, -5.0)))),
                level("unknown", "garbage"),
                REFUSED,
                faulty("range_n", stream="left.wrench"),
                live(),
            ]
            * 3,
        )
        for force_n in (3e38, -3e38, 81.0, 1e30)
        for axis in (0, 2)
    },
    "a finger is unknown until 50 ms after a pull, which nothing exerts": (
        "",
        {},
        [*[force(0.0, 0.0, 5.0), PULLED, live(10), PULLED, REFUSED] * 5, live(), level("stable"), RAISED],
    ),
    "no raise on a force sensor that measures nothing of what its pad shows": (
        "",
        NEWTONS,
        [
            *(RAISED, *[NOTHING, image(None), HELD] * 4, level("no_contact"), REFUSED),
            *(health("left.wrench", "the pad image shows one", severity=Health.WARN), LOWERED, live(2), RAISED),
        ],
    ),
    "pressed taxels of a pad whose force sensor died are not hot, and the finger is unknown": (
        "",
        {},
        [
            *[step for shown in PATCH * 15 for step in (force(), shown, HELD)],
            *[step for shown in PATCH * 200 for step in (NOTHING, shown, HELD)],
            *(level("unknown", "disagreement", "disagreement_contact"), REFUSED),
            status(streams={"left.pad": {"masked": []}}),
            health("left.wrench", "the pad image shows one", severity=Health.WARN),
            *[NOTHING, image(np.zeros(16)), HELD] * 2,
            level("no_contact"),
        ],
    ),
    "a force sensor that died before the grasp that its pad and the gripper show leaves the finger unknown": (
        "",
        {},
        [
            *[step for _ in range(30) for step in (NOTHING, image(np.zeros(16)), HELD)],
            level("no_contact"),
            *[step for shown in PATCH * 10 for step in (NOTHING, shown, HELD)],
            *(level("unknown", "disagreement", "disagreement_contact"), REFUSED),
            *[NOTHING, image(np.zeros(16)), HELD] * 2,
            level("no_contact"),
        ],
    ),
    "a jump allows no raise before the next reading confirms it": (
        "",
        {},
        [force(0.0, 0.0, -30.0), REFUSED, force(0.0, 0.0, -30.1), RAISED],
    ),
    **{
        f"repeated readings show a free finger only where they may repeat: stuck_after = {stuck_after}": (
            "",
            {"stuck_after = 0": f"stuck_after = {stuck_after}\nrange_n = 80.0"},
            [
                *REST * 2,
                ask("tare", finger="left", seconds=0.1),
                *(step for k in range(70) for step in (force(0.0, 0.0, 1e-3 * (k % 2 if k < 40 else 1)), *REST[1:])),
                level("no_contact"),
                ask("gripper.open", refusal),
            ],
        )
        for stuck_after, refusal in ((0, None), (200, ("in_contact", "drop")))
    },
}


@pytest.mark.parametrize("name", COURSES)
def test_F1_a_course_of_a_hand(name: str) -> None:
    more, changes, steps = COURSES[name]
    follow(Hand(more, **changes), steps)


def test_a_finger_without_a_pad_publishes_no_image() -> None:
    play(PADLESS, [wrench(5.0), tick, wait(5), sleep(1_000 * MS), level("unknown", "stale"), count("tactile.left", 0)])


@pytest.mark.parametrize("stuck_after", [50, 0])
def test_a_pad_that_measures_the_force_and_repeats_never_raises_and_is_stuck_unless_it_may_rest(
    stuck_after: int,
) -> None:
    run = Run(RIG.replace('sensor = "2"', f'sensor = "2"\nstuck_after = {stuck_after}'))
    run.exact, levels = True, []
    run.up()

    def live(right_n: float, *steps: Step) -> None:
        counts = np.full((4, 4), 100 + run.t_ns // MS % 7)
        follow(run, [serve(5), wrench(5.0), image(counts), skin(right_n, ms=4.0), *steps])

    follow(run, [bring_up, grip(5.0), *[lambda _: live(5.0), lambda _: live(5.01)] * 20, RAISED])
    for _ in range(12):
        live(5.01, REFUSED)
        levels.append(run.level("right"))
    stuck = levels.count(("unknown", ["stuck"]))
    assert levels == [("stable", [])] * (12 - stuck) + [("unknown", ["stuck"])] * stuck
    assert (stuck >= 3) is (stuck_after > 0), "within 100 ms at 100 Hz"
    follow(run, [health("right.pad", *["it hangs"] * (stuck > 0), severity=Health.ERROR if stuck else Health.WARN)])
    live(5.0, level("stable", finger="right"), RAISED)
