"""Faults of an arm stream that the load shows: each is named, and a load that has other causes accuses nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slipd.grasp.arm_check import SHIFTS_NS, ArmCheck
from slipd.types.arrays import Array

Reported = Callable[[float], Array]
TURN = np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))


def felt(t_s: float) -> Array:
    """Return what the gripper really feels."""
    return np.array((2.0 * np.sin(9.0 * t_s), 1.5 * np.cos(7.0 * t_s), 9.81 + np.sin(5.0 * t_s)))


def run(check: ArmCheck, reported: Reported, load: Reported = lambda t_s: 0.4 * felt(t_s), seconds: float = 1.0) -> str:
    """Return the fault after some motion; the load has a constant error."""
    for t_s in np.arange(0.0, seconds, 0.02):
        noise = 0.01 * np.sin(t_s * np.array((991.0, 577.0, 313.0)))
        check.update(load(t_s) + noise + (0.3, -0.1, 0.2), [reported(t_s + shift * 1e-9) for shift in SHIFTS_NS])
    return check.fault


@pytest.mark.parametrize("mass_kg", [0.4, 0.08])
@pytest.mark.parametrize(
    ("reported", "words"),
    [
        (felt, ""),
        (lambda t_s: -felt(t_s), "its sign is wrong"),
        (
            lambda t_s: TURN @ felt(t_s),
            "its frame is wrong: x of the gripper is y of the stream, y of the gripper is -x",
        ),
        (lambda t_s: felt(t_s)[[1, 0, 2]], "x of the gripper is y of the stream, y of the gripper is x"),
        (lambda t_s: felt(t_s - 0.05), "its times are about 50 ms late"),
        (lambda t_s: felt(t_s + 0.1), "its times are about 100 ms early"),
        (lambda t_s: felt(t_s - 0.02), ""),
    ],
)
def test_D6_fault_is_named_within_a_second_of_motion(reported: Reported, words: str, mass_kg: float) -> None:
    fault = run(ArmCheck(0.03), reported, lambda t_s: mass_kg * felt(t_s))
    assert words in fault if words else fault == ""


def stopped(t_s: float) -> Array:
    """Return what the gripper feels while it stands, but for a jerk of 50 ms."""
    return np.array((20.0 * (0.5 < t_s < 0.55), 0.0, 9.81))


@pytest.mark.parametrize(
    ("reported", "load"),
    [
        (felt, lambda t_s: np.array((0.0, 3.0 * (t_s > 0.5), 1.0))),
        (felt, lambda t_s: -6.0 * felt(t_s) * (0.5 < t_s < 0.55)),
        (felt, lambda t_s: (-1.2 if 0.5 < t_s % 2.7 < 0.9 else 0.4) * felt(t_s)),
        (stopped, lambda t_s: -stopped(t_s)),
        (felt, lambda t_s: np.zeros(3)),
        (felt, lambda t_s: np.array((np.sin(23.0 * t_s), 0.0, np.cos(31.0 * t_s)))),
    ],
    ids=[
        "a grip",
        "a collision",
        "now and then as if reversed",
        "a collision that stops the arm",
        "nothing is carried",
        "a hand that shakes",
    ],
)
def test_load_with_another_cause_accuses_nothing(reported: Reported, load: Reported) -> None:
    assert run(ArmCheck(0.03), reported, load, seconds=4.0) == ""


def test_fault_stays_until_the_stream_fits_in_motion() -> None:
    check = ArmCheck(0.03)
    assert run(check, lambda t_s: -felt(t_s))
    assert run(check, lambda t_s: felt(0.0), lambda t_s: felt(0.0)), "rest shows nothing"
    assert run(check, felt, seconds=2.0) == ""
