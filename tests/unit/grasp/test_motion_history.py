"""The motion of the arm at any time: interpolated, and unknown where readings are missing."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.grasp.motion_history import KEPT_NS, MOST_GAP_NS, MotionHistory
from slipd.types.samples import ArmSample

MS = 1_000_000
PERIOD_NS = 4 * MS


def filled(turning: tuple[float, ...] | None = None, readings: int = 51) -> MotionHistory:
    """Return a history of γ = (t, 0, 9.81) and ω = (0, 0, 2 t), t in ms, from 1 s on."""
    history = MotionHistory()
    for k in range(readings):
        t_ms = 4.0 * k
        sample = ArmSample(0, None, (t_ms, 0.0, 9.81), (0.0, 0.0, 2.0 * t_ms), turning)
        history.add(sample, 1000 * MS + k * PERIOD_NS)
    return history


def test_motion_is_interpolated_and_its_turn_differentiated() -> None:
    felt = filled().felt(1101 * MS)
    assert felt is not None
    assert felt.gravity_mps2 == pytest.approx((101.0, 0.0, 9.81))
    assert felt.velocity_radps == pytest.approx((0.0, 0.0, 202.0))
    assert felt.acceleration_radps2 == pytest.approx((0.0, 0.0, 2000.0))
    assert felt.std_mps2 == pytest.approx(4.0), "an error of 4 ms"


def test_reported_angular_acceleration_counts() -> None:
    felt = filled((1.0, 2.0, 3.0)).felt(1100 * MS)
    assert felt is not None
    assert felt.acceleration_radps2 == pytest.approx((1.0, 2.0, 3.0))


def test_motion_is_unknown_outside_and_in_gaps() -> None:
    history = filled()
    assert history.newest_ns == 1200 * MS
    assert history.gravity(999 * MS) is None
    assert history.gravity(1201 * MS) is None
    assert history.felt(1190 * MS) is None
    assert history.gravity(1200 * MS) == pytest.approx((200.0, 0.0, 9.81))
    history.add(ArmSample(0, None, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0)), 1200 * MS + MOST_GAP_NS + 1)
    assert history.gravity(1210 * MS) is None


def test_history_is_short_and_begins_anew_when_time_goes_back() -> None:
    history = filled(readings=200)
    assert history.gravity(history.newest_ns - KEPT_NS - PERIOD_NS) is None
    history.add(ArmSample(0, None, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 1000 * MS)
    assert history.newest_ns == 1000 * MS
    assert np.all(history.gravity(1000 * MS) == (1.0, 0.0, 0.0))
    assert MotionHistory().newest_ns == 0
