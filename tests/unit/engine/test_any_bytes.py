"""The engine on any bytes: no reading breaks a message, and garbage gives none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_rig import LEFT, RIG
from hypothesis import given, settings
from hypothesis import strategies as st
from run_courses import play

from slipd.devices import bota
from slipd.events import Bytes

LINKS = ("left.wrench", "left.pad", "right.pad", "gripper")


@pytest.mark.uncovered
@given(
    values=st.lists(
        st.tuples(*[st.floats(width=32)] * 6, st.integers(0, 15), st.booleans(), st.integers(0, 16)), max_size=12
    )
)
@settings(max_examples=60, deadline=None)
def test_no_reading_of_a_force_sensor_breaks_a_message(values: list[tuple[Any, ...]]) -> None:
    """Every 32-bit float and status, on full, partial and empty images; `feed` checks everything that is published."""
    run = play(LEFT)
    for *wrench, status, fresh, active in values:
        if fresh:
            run.image(np.where(np.arange(16) < active, 100, 0).reshape(4, 4))
        run.wait(1)
        run.feed(Bytes("left.wrench", bota.encode_frame(wrench[:3], wrench[3:], run.t_ns // 1000, status=status)))
    for body in run.published("slip.left"):
        assert body["level"] not in ("stable", "no_contact") or body["normal_n"] is not None


@pytest.mark.uncovered
@given(chunks=st.lists(st.tuples(st.sampled_from(LINKS), st.binary(max_size=200)), max_size=20))
@settings(max_examples=60, deadline=None)
def test_garbage_on_any_line_gives_no_message_and_good_frames_follow(chunks: list[tuple[str, bytes]]) -> None:
    run = play(RIG)
    for link, data in chunks:
        run.feed(Bytes(link, data))
    run.tick()
    assert run.published("slip.left") == []
    run.image()
    run.wrench(0.0)
    run.wrench(0.0)
    assert run.level()[0] == "no_contact", "the next good frames are decoded"
