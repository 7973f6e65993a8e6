from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slipd_client.clock import DRIFT_PPM, ServerClock

SECOND = 10**9


def drifted(now_ns: int, ppm: int) -> int:
    return now_ns + now_ns * ppm // 1_000_000


def test_the_clock_is_unknown_before_the_first_reply_and_after_another_daemon() -> None:
    clock = ServerClock()
    for heard in (False, True):
        if heard:
            clock.observe(0, 10, 5)
            assert clock.known
            clock.forget()
        assert not clock.known
        assert (clock.error_ns(0), clock.server_ns(0), clock.local_ns(0), clock.earliest_ns(0)) == (None,) * 4


def test_a_clock_that_steps_is_believed_anew() -> None:
    clock = ServerClock()
    clock.observe(0, 1_000, 500)
    clock.observe(2_000, 4_000, 50 * SECOND)
    assert abs(clock.server_ns(3_000) - 50 * SECOND) <= clock.error_ns(4_000)


@given(
    offset_ns=st.integers(-(10**15), 10**15),
    ppm=st.integers(-DRIFT_PPM // 2, DRIFT_PPM // 2),
    ways=st.lists(st.tuples(*[st.integers(0, SECOND)] * 3), min_size=1, max_size=20),
)
def test_the_bounds_hold_whatever_the_line_does(offset_ns: int, ppm: int, ways: list[tuple[int, int, int]]) -> None:
    clock, now_ns = ServerClock(), 0
    for pause_ns, there_ns, back_ns in ways:
        sent_ns = now_ns + pause_ns
        now_ns = sent_ns + there_ns + back_ns
        clock.observe(sent_ns, now_ns, drifted(sent_ns + there_ns, ppm) + offset_ns)
        later_ns = now_ns + pause_ns
        truth_ns = drifted(later_ns, ppm) + offset_ns
        assert abs(clock.server_ns(later_ns) - truth_ns) <= clock.error_ns(later_ns) + 2
        assert clock.earliest_ns(later_ns) <= truth_ns + 2
