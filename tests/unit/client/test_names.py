from __future__ import annotations

import pytest

from slipd_client.messages import (
    HEALTH,
    LEVELS,
    SEVERITY,
    Health,
    decode,
    encode,
    level_code,
    slip_topic,
    tactile_topic,
    wrench_topic,
)


def test_levels_count_from_no_contact_to_unknown() -> None:
    assert {level: level_code(level) for level in LEVELS} == {
        "no_contact": 0,
        "stable": 1,
        "caution": 2,
        "warning": 3,
        "slipping": 4,
        "unknown": 5,
    }


def test_every_level_has_a_severity() -> None:
    assert set(SEVERITY) == set(LEVELS)
    assert len(set(SEVERITY.values())) == len(LEVELS)
    assert SEVERITY["stable"] < SEVERITY["unknown"] < SEVERITY["caution"], "unknown is not no slip"


def test_a_level_that_is_none_is_refused_with_those_that_are() -> None:
    with pytest.raises(ValueError, match=r"no_contact, stable.*'fine'"):
        level_code("fine")


def test_health_is_numbered_as_ros_diagnostics_are() -> None:
    assert HEALTH == ("OK", "WARN", "ERROR", "STALE")
    assert decode(encode({"health": Health.STALE})) == {"health": 3}


def test_topics_of_a_finger_are_its_kind_and_name() -> None:
    assert [slip_topic("left"), wrench_topic("left"), tactile_topic("left")] == [
        "slip.left",
        "wrench.left",
        "tactile.left",
    ]
