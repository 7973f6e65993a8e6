"""A WSG session that is active, and one that holds an object."""

from __future__ import annotations

import pytest
from wsg_bench import Bench


@pytest.fixture
def bench() -> Bench:
    made = Bench().start()
    assert made.session.state == "active"
    made.sent.clear()
    return made


@pytest.fixture
def holding(bench: Bench) -> Bench:
    bench.gripper.part_m = 0.04
    assert bench.move(0.0, 0.2, 10.0, 0.5) == 10.0
    assert (bench.last.object, bench.last.moving) == ("contact_closing", False)
    bench.sent.clear()
    return bench
