"""No grip is raised on readings that only look fresh, by request or reflex; engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import msgpack
import numpy as np
import pytest
from grasp_table import grasp_table

from slipd.devices import bota
from slipd.events import Bytes
from slipd_client.messages import Health

MS = 1_000_000
RAISE = ("not_ready", "delta_n")
Run = Any
Make = Callable[[str], Run]

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

    def raises(self) -> tuple[str, str] | None:
        """Return the refusal of a raise that is too small to break any other rule."""
        return self.run.refusal("grip.adjust", delta_n=0.2)


@pytest.fixture
def hold(rig: str, make_run: Make) -> Callable[..., Hand]:
    def make(more: str = "", **changes: str) -> Hand:
        text = rig + more
        for old, new in (SENSORS | changes).items():
            assert old in text
            text = text.replace(old, new, 1)
        return Hand(make_run(text))

    return make


def acts(hand: Hand) -> list[dict[str, Any]]:
    """Messages about acts of the reflex."""
    return [body for body in hand.run.published("gripper") if body["reflex"] is not None]


def health(run: Run, stream: str) -> tuple[int, str]:
    found = run.ask("status")["result"]["streams"][stream]
    return found["health"], found["message"]


@pytest.mark.no_cover
def test_F1_no_raise_from_the_first_repeated_reading_on_and_unknown_within_100_ms(
    hold: Callable[..., Hand],
) -> None:
    hand = hold()
    assert hand.run.level() == ("stable", [])
    assert hand.raises() is None
    hand.live(60)
    last_good_ns = hand.run.t_ns
    levels = []
    for _ in range(60):
        hand.freeze()
        assert hand.raises() == RAISE
        assert hand.run.refusal("grip.set", force_n=4.5) != ("not_ready", "force_n"), "lowering needs no sensor"
        levels.append((hand.run.t_ns - last_good_ns, hand.run.level()))
    unknown = [t_ns for t_ns, level in levels if level == ("unknown", ["stuck"])]
    assert unknown[0] <= 100 * MS
    at = len(levels) - len(unknown)
    assert [level for _, level in levels] == at * [("stable", [])] + len(unknown) * [("unknown", ["stuck"])]
    hand.live(1)
    assert hand.run.level() == ("stable", [])
    assert hand.raises() is None


def test_the_reflex_does_not_raise_again_on_a_frozen_sensor(hold: Callable[..., Hand]) -> None:
    hand = hold(GRASP)
    run = hand.run

    def acts() -> list[dict[str, Any]]:
        return [body["reflex"] for body in run.published("gripper") if body["reflex"] is not None]

    hand.wrench(pull_n=PULL_N)
    assert len(acts()) == 1, "the first alarming reading is trusted"
    for _ in range(40):
        hand.freeze()
    assert len(acts()) == 1
    hand.live(1, pull_n=PULL_N)
    assert len(acts()) == 2


@pytest.mark.no_cover
def test_a_sensor_with_coarse_counts_may_raise_and_keeps_its_level(hold: Callable[..., Hand]) -> None:
    """One count is wider than the noise, so that seven of ten readings repeat the one before."""
    hand = hold()
    granted, levels = 0, set()
    for k in range(400):
        step = np.array((0.0, 0.0, -5.0)) + 0.02 * np.rint(0.31 * hand.rng.normal(size=3))
        hand.wrench(step, np.zeros(3))
        hand.image()
        hand.run.skin(5.0, ms=0.0)
        levels.add(hand.run.level()[0])
        granted += k >= 200 and hand.run.engine._fingers["left"].trust.for_raise(hand.run.t_ns)
    assert levels == {"stable"}
    assert granted > 150


def test_a_sensor_whose_readings_may_repeat_is_never_stuck_and_never_raises_while_they_do(
    hold: Callable[..., Hand],
) -> None:
    hand = hold(**{"stuck_after = 0": "stuck_after = 0\nrange_n = 80.0"})
    assert hand.raises() is None
    for _ in range(100):
        hand.freeze()
        assert hand.raises() == RAISE
    assert hand.run.level() == ("stable", [])
    assert hand.run.refusal("grip.set", force_n=4.5) is None, "lowering needs no sensor"
    hand.live(1)
    assert hand.raises() is None


def test_the_reflex_does_not_raise_while_readings_that_may_repeat_do(hold: Callable[..., Hand]) -> None:
    hand = hold(GRASP, **{"stuck_after = 0": "stuck_after = 0\nrange_n = 80.0"})
    hand.wrench(pull_n=PULL_N)
    before = len(acts(hand))
    for _ in range(40):
        hand.freeze()
    assert hand.run.level()[0] in ("warning", "slipping")
    assert len(acts(hand)) == before
    hand.live(4, pull_n=PULL_N)
    assert len(acts(hand)) > before


@pytest.mark.parametrize(("stuck_after", "refusal"), [(0, None), (200, ("in_contact", "drop"))])
def test_repeated_readings_show_a_free_finger_only_where_they_may_repeat(
    hold: Callable[..., Hand], stuck_after: int, refusal: tuple[str, str] | None
) -> None:
    hand = hold(**{"stuck_after = 0": f"stuck_after = {stuck_after}\nrange_n = 80.0"})
    run = hand.run
    for _ in range(2):
        hand.wrench(np.zeros(3))
        hand.image([0.0] * 16)
        run.skin(0.0, ms=0.0)
    assert run.ask("tare", finger="left", seconds=0.1)["ok"]
    for k in range(40):
        hand.wrench(np.array((0.0, 0.0, 1e-3 * (k % 2))))
        hand.image([0.0] * 16)
        run.skin(0.0, ms=0.0)
    for _ in range(30):
        hand.wrench(*hand.last)
        hand.image([0.0] * 16)
        run.skin(0.0, ms=0.0)
    assert run.level() == ("no_contact", [])
    assert run.refusal("gripper.open") == refusal


@pytest.mark.parametrize("bad", [math.nan, math.inf, 3e38])
def test_no_raise_on_an_unusable_image(hold: Callable[..., Hand], bad: float) -> None:
    hand = hold()
    spoilt = np.full(16, 30.0)
    spoilt[5] = 100.0 * bad
    for _ in range(50):
        hand.live(1)
        hand.image(spoilt)
        assert hand.raises() == RAISE
        hand.wrench()
        assert hand.run.level() == ("unknown", ["rotation_unobserved"])
    hand.live(2)
    assert hand.run.level() == ("stable", [])
    assert hand.raises() is None


def test_the_reflex_does_not_raise_on_an_unusable_image(hold: Callable[..., Hand]) -> None:
    hand = hold(GRASP)
    hand.image(np.full(16, math.nan))
    for _ in range(20):
        hand.wrench(pull_n=PULL_N)
        hand.image(np.full(16, math.nan))
        hand.run.skin(5.0, ms=0.0)
    assert hand.run.level() == ("warning", ["translation"]), "which translation alone proves"
    assert [body for body in hand.run.published("gripper") if body["reflex"] is not None] == []


def test_an_image_is_published_when_it_becomes_unusable_with_reasons_and_usable_again(
    hold: Callable[..., Hand],
) -> None:
    hand = hold("[rates]\ntactile_hz = 0.001\n")
    run = hand.run
    before = len(run.published("tactile.left"))
    spoilt = np.full(16, 30.0)
    spoilt[5] = math.nan
    found = []
    for image in (None, spoilt, spoilt, None, np.full(16, 1e14), None):
        hand.wrench()
        hand.image(image)
        found.append(health(run, "left.pad"))
    published_images = [(body["image_ok"], body["image_reasons"]) for body in run.published("tactile.left")[before:]]
    assert published_images == [(False, ["invalid", "not_finite"]), (True, []), (False, ["garbage"]), (True, [])]
    assert found[1][0] == Health.ERROR
    assert "not finite numbers" in found[1][1]
    assert "larger than those of any pad" in found[4][1]
    assert all(level == Health.OK for level, _ in (found[0], found[3], found[5]))


def test_a_missing_image_is_published_as_stale_after_silence_and_after_loss_of_the_link(
    hold: Callable[..., Hand],
) -> None:
    hand = hold("[rates]\ntactile_hz = 0.001\n")
    run = hand.run
    before = len(run.published("tactile.left"))
    for _ in range(10):
        hand.wrench()
        run.tick()
    hand.image()
    run.down("left.pad")
    run.up("left.pad")
    hand.image()
    published_images = [(body["image_ok"], body["image_reasons"]) for body in run.published("tactile.left")[before:]]
    assert published_images == [(False, ["stale"]), (True, []), (False, ["stale"]), (True, [])]
    assert all(body["loads_n"] is None for body in run.published("tactile.left")[before:] if not body["image_ok"])


def test_a_finger_without_a_pad_publishes_no_image(make_run: Make, left: str) -> None:
    run = make_run(left.partition("[finger.left.pad]")[0])
    run.up()
    run.wrench(5.0)
    run.tick()
    run.wait(5)
    run.tick(suspended_ns=1_000 * MS)
    assert run.published("tactile.left") == []
    assert run.level() == ("unknown", ["stale"])


@pytest.mark.no_cover
def test_no_raise_on_an_image_that_repeats_while_the_force_changes(hold: Callable[..., Hand]) -> None:
    hand = hold()
    same = np.full(16, 30.0)
    for normal_n, refusal in ((5.0, None), (5.0, None), (5.7, RAISE), (5.7, RAISE)):
        hand.live(60)
        hand.image(same)
        for _ in range(2):
            hand.wrench(np.array((0.0, 0.0, -normal_n)) + hand.rng.normal(0.0, 0.002, 3))
            hand.image(same)
            hand.run.skin(5.0, ms=0.0)
        assert hand.raises() == refusal


@pytest.mark.parametrize("force_n", [3e38, -3e38, 81.0, 1e30])
@pytest.mark.parametrize("axis", [0, 2])
def test_a_force_out_of_range_is_unknown_from_the_first_reading_on(
    hold: Callable[..., Hand], force_n: float, axis: int
) -> None:
    hand = hold()
    force = np.array((0.0, 0.0, -5.0))
    force[axis] = force_n
    for _ in range(3):
        hand.wrench(force)
        assert hand.run.level() == ("unknown", ["garbage"])
        assert hand.raises() == RAISE
        level, message = health(hand.run, "left.wrench")
        assert (level, "range_n" in message) == (Health.ERROR, True)
        hand.live(1)


def test_a_pad_that_measures_the_force_and_hangs_is_stuck_and_never_raises(make_run: Make, rig: str) -> None:
    run = make_run(rig.replace('sensor = "2"', 'sensor = "2"\nstuck_after = 50'))
    run.exact = True
    run.up()
    run.bring_up()
    run.grip(5.0)

    def live(right_n: float) -> None:
        run.serve_gripper(5)
        run.wrench(5.0)
        run.image(np.full((4, 4), 100 + run.t_ns // MS % 7))
        run.skin(right_n, ms=4.0)

    for k in range(40):
        live(5.0 + 0.01 * (k % 2))
    assert run.refusal("grip.adjust", delta_n=0.2) is None
    levels = []
    for _ in range(12):
        live(5.01)
        levels.append(run.level("right"))
        assert run.refusal("grip.adjust", delta_n=0.2) == RAISE
    at = levels.index(("unknown", ["stuck"]))
    assert at <= 9, "within 100 ms at 100 Hz"
    assert set(map(str, levels[at:])) == {str(levels[at])}
    assert "it hangs" in health(run, "right.pad")[1]
    live(5.0)
    assert run.level("right") == ("stable", [])
    assert run.refusal("grip.adjust", delta_n=0.2) is None


def test_a_pad_whose_images_may_repeat_is_never_stuck_and_never_raises_while_they_do(run: Run) -> None:
    """The default of ``stuck_after``, 0."""
    run.exact = True
    run.bring_up()
    run.grip(5.0)
    for k in range(60):
        run.serve_gripper(5)
        run.wrench(5.0)
        run.image(np.full((4, 4), 100 + run.t_ns // MS % 7))
        run.skin(5.0 + 0.01 * (k % 2 if k < 40 else 0), ms=4.0)
        if k == 39:
            assert run.refusal("grip.adjust", delta_n=0.2) is None
        if k > 40:
            assert run.refusal("grip.adjust", delta_n=0.2) == RAISE
            assert run.level("right") == ("stable", [])


def test_a_jump_allows_no_raise_before_the_next_reading_confirms_it(hold: Callable[..., Hand]) -> None:
    hand = hold()
    hand.wrench(np.array((0.0, 0.0, -30.0)))
    assert hand.raises() == RAISE
    assert hand.run.level()[0] != "garbage"
    hand.wrench(np.array((0.0, 0.0, -30.1)))
    assert hand.raises() is None


@pytest.mark.no_cover
def test_levels_do_not_flicker_when_readings_repeat_now_and_then(hold: Callable[..., Hand]) -> None:
    hand = hold()
    before = len(hand.run.published("warning"))
    for k in range(100):
        if k % 7:
            hand.live(1)
        else:
            hand.freeze()
    assert hand.run.published("warning")[before:] == []
