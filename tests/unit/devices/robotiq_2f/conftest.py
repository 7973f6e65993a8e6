"""A Robotiq session whose gripper is active."""

from __future__ import annotations

import pytest
from robotiq_bench import Bench, Gripper


@pytest.fixture
def active() -> Bench:
    bench = Bench(gripper=Gripper(output=(0x0100, 0, 0), stage=3)).start()
    assert bench.session.state == "active"
    bench.sent.clear()
    return bench
