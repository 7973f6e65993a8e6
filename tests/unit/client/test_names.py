from __future__ import annotations

import pytest

from slipd_client.messages import (
    LEVELS,
    SEVERITY,
    level_code,
    slip_topic,
    tactile_topic,
    wrench_topic,
)


def test_every_level_has_a_severity() -> None:
    assert set(SEVERITY) == set(LEVELS)
    assert len(set(SEVERITY.values())) == len(LEVELS)
    assert SEVERITY["stable"] < SEVERITY["unknown"] < SEVERITY["caution"], "unknown is not no slip"


def test_a_level_that_is_none_is_refused_with_those_that_are() -> None:
    with pytest.raises(ValueError, match=r"no_contact, stable.*'fine'"):
        level_code("fine")


def test_topics_of_a_finger_are_its_kind_and_name() -> None:
    assert [slip_topic("left"), wrench_topic("left"), tactile_topic("left")] == [
        "slip.left",
        "wrench.left",
        "tactile.left",
    ]
