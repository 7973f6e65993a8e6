"""How many requests of a client pass."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.io.rate_limit import MOST_KEYS, RateLimit

SECOND = 1_000_000_000
PERIOD = SECOND // 50


@pytest.mark.parametrize(
    ("per_second", "asked", "passed"),
    [
        (50.0, [(b"a", t_ns) for t_ns in [0] * 51 + [PERIOD, PERIOD, 2 * PERIOD]], "y" * 50 + "nyny"),
        (2.0, [(client, 0) for client in (b"a", b"a", b"a", b"b", b"b", b"b")], "yyn" * 2),
        (5.0, [(b"a", t_ns) for t_ns in [0] + [3600 * SECOND] * 20], "y" * 6 + "n" * 15),
    ],
    ids=["a burst of a second, then one per period", "each client by itself", "silence saves up a second"],
)
def test_requests_pass_within_the_rate(per_second: float, asked: list[tuple[bytes, int]], passed: str) -> None:
    limit = RateLimit(per_second)
    assert "".join("ny"[limit.allows(*one)] for one in asked) == passed


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
    for number in range(MOST_KEYS * 3):
        assert limit.allows(b"%d" % number, 1)
        assert not limit.allows(b"a", 1)  # who asks on is not forgotten
    assert len(limit._buckets) == MOST_KEYS
