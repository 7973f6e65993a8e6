"""Steps of a course of a cell, beside those of `run_courses` that need no more than the engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pytest
from motions.cell import Cell
from run_courses import Step, serve


def does(name: str, *arguments: Any, **more: Any) -> Step:
    """Let something happen to the cell: a method of it."""
    return lambda cell: getattr(cell, name)(*arguments, **more)


def jaws(name: str, *arguments: Any) -> Step:
    """Let something happen to the gripper: a method of it."""
    return lambda cell: getattr(cell.jaws, name)(*arguments)


def has(**changes: Any) -> Step:
    """Change attributes of the cell."""
    return lambda cell: [setattr(cell, name, value) for name, value in changes.items()]


def feels(how: str) -> Step:
    """Both sensors are "good" or "silent"."""
    return has(state=dict.fromkeys(("left", "right"), how))


def sees(**expected: Any) -> Step:
    """Check parts of the newest ``gripper`` message."""

    def step(cell: Cell) -> None:
        assert {name: cell.body[name] for name in expected} == expected

    return step


def exerts(least_n: float, most_n: float | None = None) -> Step:
    """Check what presses on each pad, N: about this, or between two."""

    def step(cell: Cell) -> None:
        assert least_n - 0.1 <= cell.jaws.grip_n <= (least_n if most_n is None else most_n) + 0.1

    return step


def sent(*kinds: str) -> Step:
    """Check the kinds of the commands on the wire since the beginning, without repetitions."""

    def step(cell: Cell) -> None:
        assert list(dict.fromkeys(each.kind for each in cell.sent)) == list(kinds)

    return step


def until(met: Callable[[Cell], bool], steps: Sequence[Step]) -> Step:
    """Repeat steps until something is the case, once at least."""

    def step(cell: Cell) -> None:
        for _ in range(500):
            for each in steps:
                each(cell)
            if met(cell):
                return
        pytest.fail("it is never the case")

    return step


comes_to_rest = until(lambda cell: not cell.body["moving"], [serve(100)])
