"""Permits that every gripper session refuses in every state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from slipd.devices import external_gripper, robotiq_2f, wsg
from slipd.types.permit import Permit

sessions = pytest.mark.parametrize("make", [robotiq_2f.Session, wsg.Session, external_gripper.Session])


@sessions
@pytest.mark.parametrize(
    ("permit", "wrong"),
    [
        (Permit("move", 0.05), "a permit of kind 'move' must have a force"),
        (Permit("set_force"), "a permit of kind 'set_force' must have a force"),
        (Permit("move", force_n=5.0), "a permit of kind 'move' must have a width"),
        (Permit("move", 0.05, None, float("nan")), "a force must be finite, got nan N"),
        (Permit("set_force", force_n=float("inf")), "a force must be finite, got inf N"),
    ],
)
def test_an_incomplete_permit_raises_an_error(make: Callable[[], Any], permit: Permit, wrong: str) -> None:
    session = make()
    for _ in range(2):
        with pytest.raises(ValueError, match=wrong):
            session.execute(permit, 0)
        session.start(0)


def test_no_table_gives_a_force_that_is_not_finite() -> None:
    with pytest.raises(ValueError, match="must be finite"):
        robotiq_2f.Session().applied_n(float("nan"))
