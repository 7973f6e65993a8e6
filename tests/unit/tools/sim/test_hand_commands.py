from __future__ import annotations

import re

import pytest

from slipd.tools.sim.hand_commands import HELP, Command, CommandError, parse_command

FINGERS = ("left", "right")


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("press left 5 N", Command("press", "left", (5.0,))),
        ("press left 5N at 20 -10 mm in 2 s", Command("press", "left", (5.0,), (0.02, -0.01), seconds=2.0)),
        ("press right 5 at 1 2", Command("press", "right", (5.0,), (0.001, 0.002))),
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
