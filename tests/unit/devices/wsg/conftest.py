"""A WSG session that is active, and one that holds an object."""

from __future__ import annotations

import pytest
from permits import move
from wsg_bench import Bench


@pytest.fixture
def bench() -> Bench:
    made = Bench().start()
    assert made.session.state == "active"
    made.sent.clear()
    return made


@pytest.fixture
def holding(bench: Bench) -> Bench:
    bench.gripper.part_mm = 40.0
    assert move(bench.session, 0.0, 0.2, 10.0) == 10.0
    bench.run(0.5)
    assert (bench.last.object, bench.last.moving) == ("contact_closing", False)
    bench.sent.clear()
    return bench
