"""A grip policy alone."""

from __future__ import annotations

import pytest
from judging import LIMITS

from slipd.gripper.grip_policy import GripPolicy


@pytest.fixture
def policy() -> GripPolicy:
    return GripPolicy(LIMITS, max_lease_ms=1000)
