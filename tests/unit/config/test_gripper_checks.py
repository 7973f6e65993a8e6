"""Limits and tables of a gripper must fit each other."""

from __future__ import annotations

import pytest
from config_faults import GOOD, assert_one_fault

from slipd import config

FAULTS = [
    (
        "max_force_n = 25.0",
        "max_force_n = 30.5",
        "gripper.max_force_n",
        "must be at most the largest force of force_table, 30 N, got 30.5",
    ),
    (
        "max_force_n = 25.0",
        "max_force_n = 3.0",
        "gripper.max_force_n",
        "must be above the least force of force_table, 3 N, got 3",
    ),
    (
        "max_force_n = 25.0",
        "max_force_n = 25.0\nmin_force_n = 2.0",
        "gripper.min_force_n",
        "must be at least the smallest force of force_table, 3 N, got 2",
    ),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[9, 3.0], [0, 30.0]]", "gripper.force_table", "rise"),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[0, 3.0], [256, 30.0]]", "gripper.force_table", "255"),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[-1, 3.0], [9, 30.0]]", "gripper.force_table", "0"),
    ("force_table = [[0, 3.0], [255, 30.0]]", "force_table = [[0, -3.0], [9, 30.0]]", "gripper.force_table", "or more"),
    ("  [1.0, 0.0]", "  [1.5, 0.0]", "gripper.width_table", "closure must rise within 0…1"),
    ("  [1.0, 0.0]", "  [1.0, 0.1]", "gripper.width_table", "while the width falls"),
    ("  [1.0, 0.0]", "  [0.0, 0.085]", "gripper.width_table", "closure must rise within 0…1"),
    ("speed_table = [[0, 0.02], [255, 0.15]]", "speed_table = [[9, 0.2], [1, 1]]", "gripper.speed_table", "rise"),
    ("speed_table = [[0, 0.02], [255, 0.15]]", "speed_table = [[0, 0.2], [300, 1]]", "gripper.speed_table", "255"),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), FAULTS)
def test_G3_keys_of_a_gripper_that_do_not_fit_are_reported(old: str, new: str, path: str, expected: str) -> None:
    assert_one_fault(old, new, path, expected)


def test_the_tables_of_a_gripper_may_start_at_zero() -> None:
    """The smallest setting may stand for 0 N and 0 m/s."""
    text = GOOD.replace("[[0, 3.0],", "[[0, 0.0],").replace("[[0, 0.02],", "[[0, 0.0],")
    assert config.parse(text, "rig.toml").gripper is not None
