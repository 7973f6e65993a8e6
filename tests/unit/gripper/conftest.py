"""Gripper control over a session that keeps its commands."""

from __future__ import annotations

import pytest
from control_bench import Parse, Recorded, make

from slipd.gripper.gripper_control import GripperControl


@pytest.fixture
def session() -> Recorded:
    return Recorded()


@pytest.fixture
def control(left: str, gripper: str, parse: Parse, session: Recorded) -> GripperControl:
    return make(left + gripper, parse, session)
