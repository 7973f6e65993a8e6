"""Messages are numbered without gaps, and dated."""

from __future__ import annotations

from slipd.events import Publish, WallClock
from slipd.publish.message_sequencer import MessageSequencer

T0 = 77_000_000_000


def test_each_topic_is_numbered_without_gaps() -> None:
    sequencer = MessageSequencer("b00t", "c0ffee", WallClock(0))
    topics = ["slip.left", "warning", "slip.left", "slip.right", "slip.left", "warning"]
    numbers = [sequencer.message(topic, T0, "", {}).body["seq"] for topic in topics]
    assert numbers == [0, 0, 1, 0, 2, 1]
    assert sequencer.published == 6


def test_every_message_has_the_head() -> None:
    sequencer = MessageSequencer("b00t", "c0ffee", WallClock(1_700_000_000_000_000_000))
    assert sequencer.message("warning", 1_500_000_000, "left_pad", {"x": 1}) == Publish(
        "warning",
        {
            "v": 1,
            "seq": 0,
            "boot": "b00t",
            "t_ns": 1_500_000_000,
            "timestamp": 1_700_000_001.5,
            "frame": "left_pad",
            "config_id": "c0ffee",
            "x": 1,
        },
        "left_pad",
    )
