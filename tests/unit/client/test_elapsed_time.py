"""Time by messages that come out of order: late ones do not turn it back, and gaps count little."""

from __future__ import annotations

import pytest

from slipd_client.friction_session import LONGEST_STEP_S, ElapsedTime


def test_only_what_is_later_than_everything_before_lets_time_pass() -> None:
    elapsed = ElapsedTime()
    passed = [elapsed.update(now_s) for now_s in (100.0, 100.2, 40.0, 100.1, 100.3)]
    assert passed == pytest.approx([0.0, 0.2, 0.2, 0.2, 0.3])


def test_an_old_first_message_and_a_gap_count_as_one_step() -> None:
    elapsed = ElapsedTime()
    passed = [elapsed.update(now_s) for now_s in (40.0, 100.0, 100.1, 160.1)]
    assert passed == pytest.approx([0.0, LONGEST_STEP_S, LONGEST_STEP_S + 0.1, 2 * LONGEST_STEP_S + 0.1])
