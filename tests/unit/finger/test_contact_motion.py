"""Evidence of motion of one finger: which sensors give it, and when it counts."""

from __future__ import annotations

import pytest
from finger_bench import make_finger, read_force
from fixture_types import Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger


def test_only_images_in_front_of_a_force_sensor_are_looked_at(left: str, parse: Parse) -> None:
    finger = make_finger(left, parse)
    with pytest.raises(ValueError, match="before it is confirmed"):
        finger.motion.confirm()
    assert make_finger(left.split("[finger.left.pad]")[0], parse).motion is None


def test_evidence_from_elsewhere_is_a_slip_only_of_a_finger_that_touches_and_is_trusted(
    finger: Finger, wrench: Wrench
) -> None:
    assert finger.note_motion(T0 + 500 * MS, ("width",)) is None, "no reading yet"
    for t_ns, normal_n, status, slips in (
        (T0, 0.0, (), False),
        (T0 + MS, 8.0, ("invalid",), False),
        (T0 + 2 * MS, 8.0, (), True),
    ):
        read_force(finger, wrench(t_ns, normal_n, status=status))
        state = finger.note_motion(T0 + 500 * MS, ("width",))
        assert (state is not None) == slips
    assert (state.verdict.level, state.verdict.reasons[0]) == ("slipping", "slip_detected")
