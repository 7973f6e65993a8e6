from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from slipd_client.messages import LEVELS, MessageError, encode
from slipd_client.messages.codec import read, typed_message
from slipd_client.messages.typed import (
    Message,
    Slip,
    SlipLevel,
)

HEAD = {"v": 1, "seq": 4, "boot": "b", "t_ns": 7, "timestamp": 1.5, "frame": "left_pad", "config_id": "c"}
OF_A_MESSAGE = {field.name for field in dataclasses.fields(Message)}


def message(topic: str, **fields: Any) -> Any:
    return typed_message(*read([topic.encode(), encode(HEAD | fields)]))


def fault(topic: str, **fields: Any) -> str:
    with pytest.raises(MessageError) as caught:
        message(topic, **fields)
    return str(caught.value)


def test_a_verdict_has_its_fields_as_numbers_words_and_tuples() -> None:
    slip = message(
        "slip.left", finger="left", level="warning", reasons=["rotation"], mu=1, centroid_m=[0.001, 0], age_s=0.5
    )
    assert isinstance(slip, Slip)
    assert (slip.level, slip.reasons, slip.mu, slip.centroid_m) == (SlipLevel.WARNING, ("rotation",), 1.0, (0.001, 0.0))
    assert (slip.seq, slip.boot, slip.t_ns, slip.frame) == (4, "b", 7, "left_pad")
    assert (slip.reading_age_s, slip.spin_nm) == (0.5, None)
    assert type(slip.mu) is float


def test_fields_and_topics_that_are_not_known_stand_in_the_map() -> None:
    assert message("wrench.left", finger="left", later=[1]).raw["later"] == [1]
    other = message("later.topic", more=1)
    assert type(other) is Message
    assert (other.topic, other.raw["more"]) == ("later.topic", 1)


@pytest.mark.parametrize(
    ("topic", "needed"),
    [
        ("slip.left", {"finger": "left", "level": "stable"}),
        ("wrench.left", {"finger": "left"}),
        ("tactile.left", {"finger": "left", "rows": 1, "cols": 1}),
        ("warning", {"finger": "left", "level": "stable", "previous": "unknown", "rising": False}),
        ("grasp", {"level": "unknown"}),
        ("gripper", {}),
        ("status", {}),
    ],
)
def test_what_an_older_daemon_does_not_send_is_none_and_the_rest_must_be_there(
    topic: str, needed: dict[str, Any]
) -> None:
    assert message(topic, **needed).topic == topic
    assert message(topic, **dict.fromkeys(OF_A_MESSAGE & {"frame", "timestamp"}), **needed).frame is None
    for name in needed:
        left = {other: value for other, value in needed.items() if other != name}
        assert f"missing_field: {name}" in fault(topic, **left)


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"level": "fine"}, "level must be one of no_contact, stable"),
        ({"level": 3}, "level"),
        ({"level": ["stable"]}, "level"),
        ({"finger": 1}, "finger must be a string"),
        ({"mu": "0.5"}, "mu must be a number"),
        ({"mu": True}, "mu must be a number"),
        ({"tare_id": 1.0}, "tare_id must be an integer"),
        ({"reasons": "stale"}, "reasons must be a list of strings"),
        ({"reasons": [1]}, "reasons.0 must be a string"),
        ({"centroid_m": [0.0]}, "centroid_m must be a list of two numbers"),
        ({"centroid_m": [0.0, None]}, "centroid_m.1 must be a number"),
        ({"timestamp": "now"}, "timestamp"),
    ],
)
def test_a_known_field_of_another_kind_is_refused_with_its_name(fields: dict[str, Any], complaint: str) -> None:
    told = fault("slip.left", **({"finger": "left", "level": "stable"} | fields))
    assert complaint in told
    assert told.startswith("bad_type")


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"fingers": []}, "fingers must be a map"),
        ({"fingers": {"left": 1}}, "fingers.left must be a map"),
        ({"lease": {"held": 1}}, "lease.held must be true or false"),
        ({"fingers": {"left": {"level": "fine"}}}, "fingers.left.level must be one of"),
        ({"streams": {"left.wrench": {"health": 9}}}, "streams.left.wrench.health must be one of 0, 1, 2, 3"),
        ({"streams": {"left.wrench": {}}}, "missing_field: streams.left.wrench.health is missing"),
    ],
)
def test_a_status_within_is_as_strict(fields: dict[str, Any], complaint: str) -> None:
    assert complaint in fault("status", **fields)


def test_levels_are_the_words_of_the_wire_and_two_of_them_alarm() -> None:
    assert [str(level) for level in SlipLevel] == list(LEVELS)
    assert [level for level in SlipLevel if level.alarming] == ["warning", "slipping"]


def test_ages_are_told_in_the_clock_of_this_machine_or_by_one_that_is_known() -> None:
    class Ahead:
        def local_ns(self, server_ns: int) -> int:
            return server_ns - 10**12

    told = message("gripper")
    assert told.age_s > 0
    assert told.age_by(Ahead()) - told.age_s == pytest.approx(1000.0, abs=10.0)
