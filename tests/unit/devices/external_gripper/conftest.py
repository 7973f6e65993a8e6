"""A session that has an active driver, and one whose gripper holds an object."""

from __future__ import annotations

import pytest
from external_gripper_bench import Bench
from permits import move


@pytest.fixture
def bench() -> Bench:
    made = Bench().start()
    assert made.session.state == "active"
    assert made.gripper.notices == [{"v": 1, "registered": "emulated driver"}]
    made.sent.clear()
    return made


@pytest.fixture
def holding(bench: Bench) -> Bench:
    assert move(bench.session, 0.0, 0.2, 10.0) == 10.0
    bench.run(0.4)
    assert (bench.last.object, bench.last.width_m) == ("contact_closing", 0.04)
    bench.sent.clear()
    return bench
