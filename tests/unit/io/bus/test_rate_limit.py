from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slipd.io.bus.rate_limit import MAX_CLIENTS, RateLimit

SECOND = 1_000_000_000


def test_a_burst_of_one_second_passes_and_then_one_request_per_period() -> None:
    limit = RateLimit(50.0)
    assert [limit.allows(b"a", 0) for _ in range(51)] == [True] * 50 + [False]
    assert [limit.allows(b"a", t_ns) for t_ns in (SECOND // 50, SECOND // 50, SECOND // 50 * 2)] == [True, False, True]


def test_clients_have_separate_allowances() -> None:
    limit = RateLimit(2.0)
    assert [limit.allows(client, 0) for client in (b"a", b"a", b"a", b"b", b"b", b"b")] == [True, True, False] * 2


def test_silence_saves_up_no_more_than_a_second() -> None:
    limit = RateLimit(5.0)
    assert limit.allows(b"a", 0)
    assert sum(limit.allows(b"a", 3600 * SECOND) for _ in range(20)) == 5


@given(st.lists(st.integers(0, SECOND // 10), max_size=300))
def test_no_pattern_passes_more_than_the_rate_and_one_burst(gaps: list[int]) -> None:
    limit = RateLimit(50.0)
    t_ns, passed = 0, 0
    for gap in gaps:
        t_ns += gap
        passed += limit.allows(b"a", t_ns)
        assert passed <= 50 + t_ns / SECOND * 50 + 1e-6


def test_the_number_of_remembered_clients_is_bounded() -> None:
    limit = RateLimit(1.0)
    assert limit.allows(b"a", 0)
    for number in range(MAX_CLIENTS * 3):
        assert limit.allows(b"%d" % number, 1)
        assert not limit.allows(b"a", 1)  # who asks on is not forgotten
    assert len(limit._buckets) == MAX_CLIENTS
