"""Gripper control over a session that keeps its commands, and a grip policy alone."""

from __future__ import annotations

import pytest
from control_bench import Parse, Recorded, make

from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.gripper_control import GripperControl


@pytest.fixture
def session() -> Recorded:
    return Recorded()


@pytest.fixture
def control(left: str, gripper: str, parse: Parse, session: Recorded) -> GripperControl:
    return make(left + gripper, parse, session)


@pytest.fixture
def policy() -> GripPolicy:
    return GripPolicy(GripLimits(3.0, 25.0, 2.0, 10.0, 2.0, 12.0), max_lease_ms=1000)
