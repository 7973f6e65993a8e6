"""How often each topic is forwarded, and that its last message always is."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slipd_client.fleet.robot_bridge import TopicLimit


def played(limit: TopicLimit, times: list[float], end_s: float) -> list[tuple[float, bytes]]:
    """Return what goes on of messages that arrive at these times; nothing held back waits longer than needed."""
    sent: list[tuple[float, bytes]] = []
    for n, now_s in enumerate([*times, end_s]):
        while (due_s := limit.due_s()) is not None and due_s <= now_s:
            sent += [(due_s, payload) for _, payload in limit.due(due_s)]
        if n < len(times) and limit.passes("slip.left", b"%d" % n, now_s):
            sent.append((now_s, b"%d" % n))
    return sent


def test_a_fast_topic_is_sent_at_the_rate_and_none_of_it_waits() -> None:
    sent = played(TopicLimit(8.0), [n / 64 for n in range(64)], 63 / 64)
    assert [payload for _, payload in sent] == [b"%d" % n for n in range(0, 64, 8)]


def test_the_last_message_of_a_burst_follows_when_nothing_else_does() -> None:
    assert played(TopicLimit(10.0), [0.0, 0.01, 0.02], 5.0) == [(0.0, b"0"), (0.2, b"2")]


def test_the_rate_is_reached_by_messages_that_do_not_come_in_step_with_it() -> None:
    assert len(played(TopicLimit(10.0), [0.07 * n for n in range(101)], 7.0)) == 71


def test_a_message_soon_after_one_that_was_held_back_waits_too() -> None:
    assert played(TopicLimit(10.0), [0.0, 0.01, 0.21], 5.0) == [(0.0, b"0"), (0.2, b"1"), (0.4, b"2")]


def test_topics_do_not_wait_for_each_other() -> None:
    limit = TopicLimit(10.0)
    assert limit.passes("slip.left", b"", 0.0)
    assert limit.passes("slip.right", b"", 0.0)
    assert not limit.passes("slip.left", b"", 0.05)


def test_without_a_rate_everything_goes_on_at_once() -> None:
    limit = TopicLimit(None)
    assert all(limit.passes("wrench.left", b"", now_s) for now_s in (0.0, 0.0, 1e-6, 1e-6))
    assert limit.due_s() is None


@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=40), st.sampled_from([1.0, 10.0, 50.0]))
def test_the_newest_message_comes_through_and_the_rate_holds(times: list[float], rate_hz: float) -> None:
    times = sorted(times)
    sent = played(TopicLimit(rate_hz), times, 10.0)
    assert sent[-1][1] == b"%d" % (len(times) - 1)
    assert len(sent) <= rate_hz * (sent[-1][0] - sent[0][0]) + 2.0
