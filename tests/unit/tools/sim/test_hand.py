"""The commands of a hand, a line each, and the loads on the pads that follow from them."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from slipd.signals.gravity import STANDARD_GRAVITY_MPS2, FingerWeight
from slipd.tools.sim.hand import Hand, PadLoad
from slipd.tools.sim.hand_commands import HELP, Command, CommandError, parse_command

FINGERS = {"left": (0.025, 0.015), "right": (math.inf, math.inf)}


def hand(*lines: str, t_s: float = 0.0) -> Hand:
    made = Hand({name: FingerWeight(0.1, (0.0, 0.0, -0.01)) for name in FINGERS}, frozenset({"right"}))
    give(made, *lines, t_s=t_s)
    return made


def give(made: Hand, *lines: str, t_s: float = 0.0) -> None:
    for line in lines:
        command = parse_command(line, FINGERS)
        assert command is not None
        made.carry_out(command, t_s)


def test_a_press_a_push_and_a_twist_add_up_at_their_place_and_of_one_finger() -> None:
    made = hand("press left 5 N at 20 -10 mm")
    assert [made.load(name, 0.0, 0.0) for name in FINGERS] == [PadLoad((0.02, -0.01), 5.0), PadLoad()]
    assert made.load("left", 0.0, 0.0).wrench().tolist() == pytest.approx([0.0, 0.0, -5.0, 0.05, 0.1, 0.0])
    give(made, "press left 5 N at 0 10 mm", "push left -y 1 N", "twist left 20 mNm")
    assert made.load("left", 0.0, 0.0).wrench().tolist() == pytest.approx([0.0, -1.0, -5.0, -0.05, 0.0, 0.02])


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
    for t_s, line, carried_n in (
        (5.9, "show", 5.9),
        (6.1, "show", 4.0),
        (7.0, "push left +x 5 N", 4.0),
        (8.0, "push left +x 3 N", 3.0),
    ):
        give(made, line, t_s=t_s)
        assert made.load("left", t_s, 0.0).tangential_n[0] == pytest.approx(carried_n)


def test_a_held_object_presses_the_centre_of_both_pads_and_shares_a_pull() -> None:
    made = hand("object 50 mm", "pull +y 4 N")
    loads = [made.load(finger, 0.0, grip_n) for finger, grip_n in (("left", 8.0), ("right", 8.0), ("left", 0.0))]
    held = [PadLoad((0.0, 0.0), 8.0, (0.0, pull_n)) for pull_n in (2.0, -2.0)]
    assert (made.part_m, loads) == (0.05, [*held, PadLoad()])


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


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("press left 5 N", Command("press", "left", (5.0,))),
        ("press left 5N at 20 -10 mm in 2 s", Command("press", "left", (5.0,), (0.02, -0.01), seconds=2.0)),
        ("press right 5 at 100 2", Command("press", "right", (5.0,), (0.1, 0.002))),
        ("push left +x 1.5 N in 1", Command("push", "left", (1.5,), direction=(1.0, 0.0), seconds=1.0)),
        ("push left -3 4 N in 1 s", Command("push", "left", (5.0,), direction=(-0.6, 0.8), seconds=1.0)),
        ("push left 0 0", Command("push", "left", (0.0,))),
        ("push left -y 1e0", Command("push", "left", (1.0,), direction=(0.0, -1.0))),
        ("twist left -30 mNm", Command("twist", "left", (-0.03,))),
        ("twist left 0.03 N·m", Command("twist", "left", (0.03,))),
        ("release", Command("release")),
        ("release left", Command("release", "left")),
        ("pull +y 2 N", Command("pull", values=(2.0,), direction=(0.0, 1.0))),
        ("object 60 mm", Command("object", values=(0.06,))),
        ("friction 0.8", Command("friction", values=(0.8, pytest.approx(0.6)))),
        ("friction 0.8 0.5", Command("friction", values=(0.8, 0.5))),
        ("tilt 0 0 -1", Command("tilt", values=(0.0, 0.0, -1.0))),
        ("tilt left 1 0 0", Command("tilt", "left", (1.0, 0.0, 0.0))),
        ("weight left 80 g at 0 0 -15 mm", Command("weight", "left", (0.08,), (0.0, 0.0, -0.015))),
        ("wait 0.5 s  # and then", Command("wait", seconds=0.5)),
        ("show", Command("show")),
        ("", None),
        ("# only a comment", None),
    ],
)
def test_a_line_is_one_command_in_si_units(line: str, command: Command | None) -> None:
    assert parse_command(line, FINGERS) == command


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("squeeze left", "a command must begin with press, push, twist"),
        ("press thumb 5 N", "FINGER must be one of left, right, got 'thumb'; usage: press FINGER FORCE N"),
        ("press left", "FORCE must be a number, got ''"),
        ("press left five", "FORCE must be a number, got 'five'"),
        ("press left -5 N", "FORCE must be from 0 to 1000, got '-5'"),
        ("press left 5 kg", "the unit must be N, got 'kg'"),
        ("press left 5 N at 1", "Y must be a number, got ''"),
        ("press left 5 N at 1 900", "Y must be from -500 to 500"),
        (
            "press left 5 N at 26 0",
            "at 26 0 mm the left pad has no taxel: X must be from -25 to 25 mm, and Y from -15 to 15",
        ),
        ("press left 5 N now", "nothing may follow, got 'now'"),
        ("press left 5 N at 0 0 mm 7", "nothing may follow, got '7'"),
        ("push left 1 +x 5", "FY must be a number, got '+x'"),
        ("push left up 5", "the direction must be one of +x, -x, +y, -y, got 'up'"),
        ("friction 0.5 0.6", "MU_D must be from 0.01 to 0.5"),
        ("tilt 0 0 0", "the direction must not be 0 0 0"),
        ("tilt 1 nan 0", "GY must be a number"),
        ("wait 1e9", "S must be from 0 to 3600"),
        ("quit now", "nothing may follow"),
    ],
)
def test_a_wrong_line_is_refused_with_what_would_be_right(line: str, words: str) -> None:
    with pytest.raises(CommandError, match=re.escape(words)):
        parse_command(line, FINGERS)


def test_the_help_has_every_command() -> None:
    verbs = {line.split()[0] for line in HELP.splitlines()}
    with pytest.raises(CommandError) as refused:
        parse_command("?", FINGERS)
    assert verbs == set(str(refused.value).partition(", got")[0].removeprefix("a command must begin with ").split(", "))
