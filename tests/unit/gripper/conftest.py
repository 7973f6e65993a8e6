"""A grip policy alone."""

from __future__ import annotations

import pytest

from slipd.gripper.grip_policy import GripLimits, GripPolicy


@pytest.fixture
def policy() -> GripPolicy:
    return GripPolicy(GripLimits(3.0, 25.0, 2.0, 10.0, 2.0, 12.0), max_lease_ms=1000)
