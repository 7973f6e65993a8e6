"""Names in a fleet: what a key may hold."""

from __future__ import annotations

import pytest

from slipd_client.errors import CallError
from slipd_client.fleet.fleet_keys import check_name, message_key, split_key, token_key


@pytest.mark.parametrize("name", ["a", "Arm-3", "robot_7.left", "9", "x" * 64])
def test_a_name_of_letters_digits_and_joints_is_kept(name: str) -> None:
    assert check_name("--robot", name) == name


@pytest.mark.parametrize("name", ["", "a*", "$b", "c#", "d?", "e/f", "@adv", ".g", "-h", "ä", "a b", "a\n", "x" * 65])
def test_a_name_that_zenoh_would_read_as_more_than_one_word_is_refused(name: str) -> None:
    with pytest.raises(CallError, match="--robot must be 1 to 64 of the characters"):
        check_name("--robot", name)


def test_a_key_has_fleet_robot_and_topic() -> None:
    assert message_key("plant", "arm3", "slip.left") == "plant/arm3/slip.left"
    assert token_key("plant", "arm3", "daemon") == "plant/arm3/daemon"


@pytest.mark.parametrize("topic", ["", "slip/left", "slip.*", "$", "Slip", "a.b.c"])
def test_a_topic_that_is_none_of_a_daemon_is_refused(topic: str) -> None:
    with pytest.raises(CallError, match="topic must be a word"):
        message_key("plant", "arm3", topic)


def test_a_key_of_this_fleet_is_split_and_another_is_not() -> None:
    assert split_key("plant/arm3/status", "plant") == ("arm3", "status")
    for key in ("other/arm3/status", "plant/arm3", "plant/arm3/a/b", "plant/@adv/status", "plant/a*/status"):
        assert split_key(key, "plant") is None
