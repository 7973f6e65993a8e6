from __future__ import annotations

import numpy as np
import pytest

from slipd.signals.gravity import STANDARD_GRAVITY_MPS2, FingerWeight
from slipd.tools.sim.hand import Hand, PadLoad
from slipd.tools.sim.hand_commands import CommandError, parse_command

FINGERS = ("left", "right")


def hand(*lines: str, t_s: float = 0.0) -> Hand:
    made = Hand({name: FingerWeight(0.1, (0.0, 0.0, -0.01)) for name in FINGERS}, frozenset({"right"}))
    give(made, *lines, t_s=t_s)
    return made


def give(made: Hand, *lines: str, t_s: float = 0.0) -> None:
    for line in lines:
        command = parse_command(line, FINGERS)
        assert command is not None
        made.carry_out(command, t_s)


def test_a_press_is_a_force_into_the_finger_at_its_place() -> None:
    load = hand("press left 5 N at 20 -10 mm").load("left", 0.0, 0.0)
    assert load == PadLoad((0.02, -0.01), 5.0)
    assert load.wrench().tolist() == pytest.approx([0.0, 0.0, -5.0, 0.05, 0.1, 0.0])
    assert hand("press left 5 N").load("right", 0.0, 0.0) == PadLoad()


def test_a_push_and_a_twist_add_to_it() -> None:
    load = hand("press left 5 N at 0 10 mm", "push left -y 1 N", "twist left 20 mNm").load("left", 0.0, 0.0)
    assert load.tangential_n == (0.0, -1.0)
    assert load.wrench().tolist() == pytest.approx([0.0, -1.0, -5.0, -0.05, 0.0, 0.02])


def test_a_push_without_a_press_is_refused() -> None:
    with pytest.raises(CommandError, match="press finger left first"):
        hand("push left +x 1 N")


def test_a_ramp_takes_its_time() -> None:
    made = hand("press left 10 N in 2 s")
    assert [made.load("left", t_s, 0.0).normal_n for t_s in (0.5, 1.0, 3.0)] == [2.5, 5.0, 10.0]
    give(made, "press left 0 N in 1 s", t_s=3.0)
    assert made.load("left", 3.25, 0.0).normal_n == 7.5


def test_a_push_beyond_friction_slides_until_it_falls_below_dynamic_friction() -> None:
    made = hand("friction 0.6 0.4", "press left 10 N", "push left +x 10 N in 10 s")
    assert made.load("left", 5.9, 0.0).tangential_n[0] == pytest.approx(5.9)
    assert made.load("left", 6.1, 0.0).tangential_n[0] == pytest.approx(4.0)
    give(made, "push left +x 5 N", t_s=7.0)
    assert made.load("left", 7.0, 0.0).tangential_n[0] == pytest.approx(4.0)
    give(made, "push left +x 3 N", t_s=8.0)
    assert made.load("left", 8.0, 0.0).tangential_n[0] == pytest.approx(3.0)


def test_a_held_object_presses_the_centre_of_both_pads_and_shares_a_pull() -> None:
    made = hand("object 50 mm", "pull +y 4 N")
    assert made.part_m == 0.05
    assert made.load("left", 0.0, 8.0) == PadLoad((0.0, 0.0), 8.0, (0.0, 2.0))
    assert made.load("right", 0.0, 8.0) == PadLoad((0.0, 0.0), 8.0, (0.0, -2.0))
    assert made.load("left", 0.0, 0.0) == PadLoad()


def test_release_lets_go_of_one_finger_or_all() -> None:
    made = hand("press left 5 N", "press right 4 N", "release left")
    assert [made.load(name, 0.0, 0.0).normal_n for name in FINGERS] == [0.0, 4.0]
    give(made, "release")
    assert made.load("right", 0.0, 0.0).normal_n == 0.0


def test_the_weight_follows_the_direction_of_gravity() -> None:
    made = hand()
    assert made.weight("left", 0.0)[:3].tolist() == pytest.approx([0.1 * STANDARD_GRAVITY_MPS2, 0.0, 0.0])
    give(made, "tilt left 0 0 -2", "weight right 50 g")
    assert made.weight("left", 0.0)[:3].tolist() == pytest.approx([0.0, 0.0, -0.1 * STANDARD_GRAVITY_MPS2])
    assert np.abs(made.weight("right", 0.0))[:3].sum() == pytest.approx(0.05 * STANDARD_GRAVITY_MPS2)
    give(made, "tilt 0 1 0", "weight right 50 g at 0 0 -20 mm")
    assert made.weight("right", 0.0)[3:].tolist() == pytest.approx([0.02 * 0.05 * STANDARD_GRAVITY_MPS2, 0.0, 0.0])
