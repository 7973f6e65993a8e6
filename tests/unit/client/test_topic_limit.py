"""The newest message of each topic comes through, at no more than the rate."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from slipd_client.topic_limit import TopicLimit


def played(limit: TopicLimit, times: list[float], end_s: float) -> list[tuple[float, bytes]]:
    """Return what goes on of messages that arrive at these times; nothing held back waits longer than needed."""
    sent: list[tuple[float, bytes]] = []
    for n, now_s in enumerate([*times, end_s]):
        while (due_s := limit.due_s()) is not None and due_s <= now_s:
            sent += [(due_s, payload) for _, payload in limit.due(due_s)]
        if n < len(times) and limit.passes("slip.left", b"%d" % n, now_s):
            sent.append((now_s, b"%d" % n))
    return sent


def test_topics_do_not_wait_for_each_other_nor_for_a_clock_that_was_set_back() -> None:
    limit = TopicLimit(10.0)
    sent = (("slip.left", 0.0), ("slip.right", 0.0), ("slip.left", 0.05), ("slip.left", -1.0), ("slip.left", -0.95))
    assert [limit.passes(topic, b"", now_s) for topic, now_s in sent] == [True, True, False, True, False]


@settings(max_examples=40)
@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=40), st.sampled_from([1.0, 10.0, 50.0]))
def test_the_newest_message_comes_through_and_the_rate_holds(times: list[float], rate_hz: float) -> None:
    times = sorted(times)
    sent = played(TopicLimit(rate_hz), times, 10.0)
    assert sent[-1][1] == b"%d" % (len(times) - 1)
    assert len(sent) <= rate_hz * (sent[-1][0] - sent[0][0]) + 2.0
