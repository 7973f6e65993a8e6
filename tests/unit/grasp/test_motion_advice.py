"""How fast the arm may go: never faster than the grip holds, and unknown wherever something of it is not known."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from motion_grips import COLS, GRAVITY_MPS2, ROWS, Advised, Grip, random_grip, true_room, true_use

from slipd.finger.verdict import PAD_FREE, STREAM_STALE, Verdict
from slipd.friction.friction_state import FrictionState
from slipd.fusion.streaming import new_readings
from slipd.grasp.arm_gravity import ERROR_MPS2, ArmGravity
from slipd.grasp.motion_advice import ARM_SILENT, NO_ARM, NO_GRAVITY
from slipd.grasp.motion_answers import MotionCheck, MotionLimits
from slipd.grasp.object_estimate import GYRATION_M, NOT_MOVED, NOTHING_HELD, ObjectState
from slipd.grasp.object_swing import Swing
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample

DOWN = np.array((0.0, 0.0, GRAVITY_MPS2))
STILL = np.zeros(3)
SAFETY = 1.5


def firm(mass_kg: float = 0.2, com_m: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Grip:
    """An object gripped with 15 N, on evenly pressed patches of 5 by 5 taxels whose middle is at the origin."""
    image = np.zeros((ROWS, COLS))
    image[2:7, 6:11] = 1.0 / 25.0
    grip = Grip(mass_kg, np.zeros(3), 0.5, 15.0, np.array([image.ravel(), image[::-1].ravel()]), np.zeros((2, 3)))
    return replace(grip, com_m=grip.middle() + com_m)


def test_the_limits_of_a_small_block_are_those_of_its_friction() -> None:
    found = Advised(firm()).limits()
    friction_n, load_kg = 0.5 * 15.0, 0.1  # on each pad
    upwards = friction_n / SAFETY / load_kg - GRAVITY_MPS2
    assert found.utilisation == pytest.approx(load_kg * GRAVITY_MPS2 / friction_n, rel=0.04)
    assert found.turn_utilisation == pytest.approx(found.utilisation, rel=0.04)
    assert found.accelerations_mps2[5] == pytest.approx(upwards - ERROR_MPS2, rel=0.04)
    spare_n = friction_n - SAFETY * load_kg * GRAVITY_MPS2  # the worst direction also relieves a pad
    assert found.acceleration_mps2 == pytest.approx(spare_n / load_kg / math.hypot(SAFETY, 0.5) - ERROR_MPS2, rel=0.04)
    assert found.worst_direction == pytest.approx((0.0, 0.0, -1.0), abs=0.35)
    assert (found.finger, found.mode, found.speed_scale) == ("left", "translation", 1.0)
    needed = SAFETY * load_kg * (GRAVITY_MPS2 + 3.0) / 0.5
    assert found.grip_needed_n == pytest.approx(needed, rel=0.05)


def test_a_turn_is_limited_by_the_inertia_and_by_the_lever_of_the_object() -> None:
    grip = firm(0.4)
    limit, long = Advised(grip).limits().angular_acceleration_radps2, Advised(grip)
    couple = np.array((0.0, grip.mass_kg * GYRATION_M**2 * limit, 0.0))
    assert 0.95 <= SAFETY * true_use(grip, DOWN, couple) <= 1.0
    long.held.state = replace(long.own, inertia_kgm2=grip.mass_kg * 3.0 * GYRATION_M**2, inertia_std_kgm2=5e-4)
    turn = np.array([[t_s, *DOWN, 0.0, 0.0, 0.0, 0.0, t_s * limit, 0.0] for t_s in (0.0, 1.0)])
    found = long.limits().angular_acceleration_radps2 / limit, long.check(turn).time_scale
    assert found == pytest.approx((0.25, 0.5), rel=0.01), "the deviation counts twice"
    aside = Advised(firm(0.4, (0.03, 0.0, 0.0))).limits()
    assert (aside.mode, aside.angular_acceleration_radps2 < 0.7 * limit) == ("rotation", True)


@pytest.mark.parametrize("carried", [0.0, 0.4])
def test_a_known_object_that_still_stands_on_a_table_is_advised_as_if_it_were_lifted(carried: float) -> None:
    lifted, advised = Advised(firm(0.4)), Advised(firm(0.4))
    advised.held.state, advised.held.supported = ObjectState(unknown=NOT_MOVED), advised.own
    for _ in range(40):
        advised.feel(DOWN, STILL, carried=carried)
    limits = advised.limits()
    assert limits.acceleration_mps2 == pytest.approx(lifted.limits().acceleration_mps2, rel=0.02)
    assert limits.utilisation == pytest.approx(carried * lifted.limits().utilisation, rel=0.02, abs=0.01)
    scales = [each.check(swing(1.0, 30.0)).time_scale for each in (advised, lifted)]
    assert scales[0] == pytest.approx(scales[1], rel=0.02)
    assert scales[1] < 1.0


@pytest.mark.parametrize("seed", range(6))
def test_the_grip_holds_every_motion_within_the_limits_although_little_is_known(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grip, gravity = random_grip(rng), GRAVITY_MPS2 * np.array((0.0, math.sin(seed), math.cos(seed)))
    mass_kg, com_m = grip.mass_kg * rng.normal(1.0, 0.02), grip.com_m + rng.normal(0.0, 0.001, 3)
    own = ObjectState(mass_kg, grip.mass_kg * 0.02, tuple(com_m.tolist()), (0.001,) * 3, "")
    found = Advised(grip, gravity, 0.9 * grip.mu, own, (0.01, 0.0002), rng).limits()
    if found.acceleration_mps2 == 0.0:
        return
    ways = rng.normal(size=(20, 3))
    for way in (found.worst_direction, *(ways / np.linalg.norm(ways, axis=1)[:, None])):
        felt = gravity - found.acceleration_mps2 * np.array(way)
        assert SAFETY * true_use(grip, felt) <= 1.0
        assert true_room(grip, felt, SAFETY, gravity) >= 0.0


def swing(seconds: float, most_mps2: float, count: int = 51) -> Array:
    """A motion along x and back to rest, while the gripper turns by a half about z, which is vertical."""
    points = np.zeros((count, 10))
    part = np.linspace(0.0, 1.0, count)
    points[:, 0] = part * seconds
    points[:, 1] = most_mps2 * np.sin(2.0 * math.pi * part)
    points[:, 3] = GRAVITY_MPS2
    points[:, 6] = math.pi / seconds * (1.0 - np.cos(2.0 * math.pi * part))
    points[:, 9] = 2.0 * math.pi**2 / seconds**2 * np.sin(2.0 * math.pi * part)
    return points


def test_a_motion_that_is_too_fast_holds_with_the_time_scale_and_needs_the_grip_that_is_named() -> None:
    grip = firm(0.4)
    points = swing(1.0, 30.0)
    found = Advised(grip).check(points)
    assert found.at_s in (pytest.approx(0.24, abs=0.05), pytest.approx(0.76, abs=0.05))
    assert 0.3 < found.time_scale < 0.9
    slowed = points * (1.0, *[found.time_scale**2] * 3, *[found.time_scale] * 3, *[found.time_scale**2] * 3)
    slowed[:, 3] = GRAVITY_MPS2
    again = Advised(grip).check(slowed)
    assert again.time_scale == 1.0
    assert again.utilisation == pytest.approx(1.0 / SAFETY, rel=0.04)
    assert found.grip_needed_n == pytest.approx(15.0 * SAFETY * found.utilisation, rel=0.05)
    assert Advised(replace(grip, normal_n=found.grip_needed_n)).check(points).time_scale == pytest.approx(1.0, abs=0.02)


def build_up(seconds: float, most_mps2: float) -> Array:
    """A motion along x that builds up evenly and stays, without a turn."""
    points = np.zeros((200, 10))
    points[:, 0] = np.linspace(0.0, 2.0 * seconds, 200)
    points[:, 1] = most_mps2 * np.minimum(points[:, 0] / seconds, 1.0)
    points[:, 3] = GRAVITY_MPS2
    return points


def test_an_object_that_swings_on_its_pads_uses_more_in_a_motion_of_half_a_period_and_not_in_a_slow_one() -> None:
    advised = Advised(firm(0.2, (0.0, 0.0, 0.03)))
    rigid = [advised.check(build_up(seconds, 12.0)) for seconds in (0.1, 2.0)]
    advised.held.swing = Swing(2.0 * math.pi * 5.0, 0.0)
    fast, slow = (advised.check(build_up(seconds, 12.0)) for seconds in (0.1, 2.0))
    assert slow.utilisation == pytest.approx(rigid[1].utilisation, rel=0.05)
    assert fast.utilisation > 1.4 * rigid[0].utilisation
    assert fast.at_s == pytest.approx(0.15, abs=0.03), "half a period after the middle of the build-up"
    assert 0.4 < fast.time_scale < 0.95 * rigid[0].time_scale
    held = advised.check(build_up(0.1 / fast.time_scale, 12.0 * fast.time_scale**2))
    assert held.time_scale == pytest.approx(1.0, abs=0.03)
    advised.held.swing = Swing(2.0 * math.pi * 5.0, 0.2)
    swings = advised.check(build_up(2.0, 0.1))
    assert (swings.at_s, swings.time_scale) == (0.0, 0.0), "from before: slower is no help"


def test_an_object_that_has_begun_to_tip_is_held_by_no_motion() -> None:
    advised = Advised(firm())
    for _ in range(40):
        wrenches = [np.array(finger.state.wrench) for finger in advised.fingers.values()]
        aside = [np.array((*wrench[:4], -0.01 * wrench[2], wrench[5])) for wrench in wrenches]
        advised.read([advised.state(*pad) for pad in zip(aside, advised.grip.patches, strict=True)])
        advised.look()
    found = advised.advice.check_acceleration((0.0, 0.0, 0.0), advised.t_ns, None)
    assert (found.time_scale, found.grip_needed_n, found.mode) == (0.0, math.inf, "tipping")
    assert found.utilisation > 1.0


def test_one_acceleration_is_a_motion_from_the_present_orientation() -> None:
    advised = Advised(firm())
    found = advised.advice.check_acceleration((0.0, 0.0, -20.0), advised.t_ns, None)
    assert found.utilisation == pytest.approx(0.1 * (GRAVITY_MPS2 + 20.0) / 7.5, rel=0.04)
    assert (found.at_s, found.mode, found.time_scale) == (0.0, "translation", 1.0)


def test_what_no_grip_holds_is_infinite_and_not_slowed_down_to_hold() -> None:
    advised = Advised(firm(2.0))
    found = advised.advice.check_acceleration((0.0, 0.0, -20.0), advised.t_ns, None)
    assert found.time_scale == 0.0, "not even at rest"
    limits = advised.limits()
    assert (limits.acceleration_mps2, limits.speed_scale) == (0.0, 0.0)
    pulled = advised.advice.check_acceleration((0.0, 30.0, 0.0), advised.t_ns, None)
    assert pulled.utilisation == math.inf


def test_a_heavy_object_held_at_its_side_tips_when_it_is_pushed_along_the_pads_normal() -> None:
    advised = Advised(replace(firm(0.2, (0.0, 0.0, 0.12)), mu=3.0))
    found = advised.advice.check_acceleration((0.0, 20.0, 0.0), advised.t_ns, None)
    assert found.mode == "tipping"
    assert advised.limits().mode == "tipping"


@pytest.mark.parametrize(("first", "known"), [("at rest", True), ("as now", True), ("else", False)])
def test_gravity_is_followed_from_rest_or_from_now_and_without_it_there_is_no_time_scale(
    first: str, known: bool
) -> None:
    advised = Advised(firm(0.9))
    points = swing(1.0, 7.5)
    points = {"at rest": points, "as now": points[1:], "else": points[10:]}[first]
    assert (advised.check(points).time_scale is not None) is known
    gentle = swing(1.0, 1.0)[10:]
    assert advised.check(gentle).time_scale == 1.0, "nothing is to be slowed down"


def has(finger: str, **fields: Any) -> Callable[[Advised], None]:
    """Return a change of the state of a finger."""
    return lambda advised: vars(advised.fingers[finger]).update(state=replace(advised.fingers[finger].state, **fields))


def jump(advised: Advised) -> None:
    advised.t_ns += 500_000_000
    advised.feel(DOWN, STILL)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda advised: setattr(advised.fingers["right"], "force", None), "finger right has no force sensor"),
        (has("left", verdict=STREAM_STALE), "finger left: stale"),
        (has("right", reading=None), "finger right: stable"),
        (has("right", reading=new_readings([(0.0,) * 6], [0])), "finger right touches nothing"),
        (has("right", verdict=Verdict("slipping", ("slip_detected",))), "finger right slips"),
        (has("left", load_distribution=None), "rotation_unobserved"),
        (has("left", friction=FrictionState()), "finger left: no friction is known"),
        (
            lambda advised: setattr(advised.fingers["left"].force.gravity, "state", lambda _: "unknown_orientation"),
            "finger left: its own weight",
        ),
        (lambda advised: setattr(advised.held, "state", NOTHING_HELD), "nothing is held"),
        (lambda advised: setattr(advised.arm, "is_used", lambda _: False), ARM_SILENT),
        (jump, NO_GRAVITY),
    ],
)
def test_what_is_not_known_makes_the_advice_unknown_with_the_reason(make: Callable[[Advised], None], why: str) -> None:
    advised = Advised(firm())
    make(advised)
    limits, check = advised.limits(), advised.check(swing(1.0, 1.0))
    assert why in limits.unknown
    assert limits == MotionLimits(limits.unknown)
    assert check == MotionCheck(limits.unknown)
    assert advised.advice.check_acceleration((0.0, 0.0, 0.0), advised.t_ns, None) == check
    advised.arm_is_missing()
    assert advised.limits().unknown == NO_ARM


def test_a_contact_that_ended_begins_with_new_loads() -> None:
    advised = Advised(firm())
    advised.fingers["left"].state.verdict = PAD_FREE
    advised.fingers["left"].state.reading = None
    advised.look()
    advised.held.state = NOTHING_HELD
    advised.feel(DOWN, STILL)
    advised.held.state = advised.own
    assert advised.limits().unknown == "finger left: its load is not known yet"
    advised.feel(DOWN, STILL)
    assert advised.limits().unknown == ""


def test_gravity_is_known_after_a_second_and_survives_a_turn_while_the_arm_speeds_up() -> None:
    arm, angle = ArmGravity(), 0.0
    assert arm.gravity() is None
    for k in range(1, 601):
        t_s, rate = 0.01 * k, 2.0 if k > 500 else 0.0
        angle += 0.01 * rate
        gravity = np.array((math.sin(angle), 0.0, math.cos(angle))) * GRAVITY_MPS2  # the frame turns by −ω about y
        push = np.array((0.0, 2.0, 0.0)) * (5.2 < t_s < 5.7)
        arm.update(ArmSample(0, None, tuple(gravity - push), (0.0, -rate, 0.0)), round(1e10 + t_s * 1e9))
        assert arm.gravity() is None or k >= 100
    assert np.linalg.norm(np.array(arm.gravity()) - gravity) < 0.3
