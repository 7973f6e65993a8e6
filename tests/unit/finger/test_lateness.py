"""Lateness of the daemon: after a stall, the bytes that it reads may be as old as the stall."""

from __future__ import annotations

import pytest
from nanoseconds import MS

from slipd.events import Bytes, Tick
from slipd.finger.freshness import LATE_NS, LEAST_CATCH_UP_NS, LONGEST_WAIT_NS, MOST_CATCH_UP_NS, SHOWN_NS, Lateness

READ = Bytes("left.wrench", b"")
UNREAD = Tick(unread=True)


def ticked(until_ms: int) -> Lateness:
    lateness = Lateness()
    for ms in range(0, until_ms + 1, 5):
        lateness.update(Tick(), ms * MS)
    return lateness


def test_C4_bytes_read_after_a_stall_may_have_waited_until_the_lines_are_empty() -> None:
    lateness = ticked(100)
    lateness.update(READ, 100 * MS + LATE_NS)
    assert (lateness.late_ns, lateness.arrival(100 * MS + LATE_NS).waited_ns) == (0, 0)
    lateness.update(READ, 400 * MS)
    assert (lateness.late_ns, lateness.arrival(400 * MS).waited_ns) == (300 * MS, 300 * MS)
    lateness.update(UNREAD, 401 * MS)
    lateness.update(READ, 440 * MS)
    assert lateness.arrival(440 * MS).waited_ns == 340 * MS, "many reads empty what has waited"
    lateness.update(Tick(), 441 * MS)
    assert (lateness.late_ns, lateness.arrival(441 * MS).waited_ns, lateness.unread_ns(441 * MS)) == (0, 0, None)


@pytest.mark.parametrize(
    ("stall_ns", "bound_ns"),
    [(30 * MS, LEAST_CATCH_UP_NS), (300 * MS, 300 * MS), (10_000 * MS, MOST_CATCH_UP_NS)],
)
def test_C4_P3_a_daemon_that_never_catches_up_excuses_silence_only_within_the_bound(
    stall_ns: int, bound_ns: int
) -> None:
    lateness, begun_ns = ticked(100), 100 * MS
    t_ns = begun_ns + stall_ns
    lateness.update(UNREAD, t_ns)
    until_ns = t_ns + bound_ns
    while t_ns < until_ns:
        t_ns += 5 * MS
        lateness.update(UNREAD, t_ns)
        assert lateness.unread_ns(t_ns) == t_ns - begun_ns
        assert lateness.arrival(t_ns).waited_ns == min(t_ns - begun_ns, LONGEST_WAIT_NS)
    lateness.update(UNREAD, t_ns + 5 * MS)
    assert lateness.unread_ns(t_ns + 5 * MS) == 0, "what brings nothing is silent"
    assert lateness.arrival(t_ns + 5 * MS).waited_ns > 0, "what comes has waited nevertheless"


def test_C4_P3_each_of_several_stalls_excuses_silence_within_its_own_bound() -> None:
    lateness, t_ns, waited = ticked(100), 100 * MS, []
    for _ in range(40):
        t_ns += 15 * MS
        lateness.update(UNREAD, t_ns)
        waited.append(lateness.unread_ns(t_ns) or 0)
        assert lateness.arrival(t_ns).waited_ns == t_ns - 100 * MS, "since the lines were last empty"
    assert waited[0] == 15 * MS
    assert max(waited) <= LEAST_CATCH_UP_NS + 30 * MS
    assert waited.count(15 * MS) > 3, "each begins anew where the bound of the one before was reached"


def test_the_worst_stall_is_reported_for_a_second_and_nothing_is_late_before_the_first_tick() -> None:
    untouched = Lateness()
    untouched.update(READ, 10**12)
    assert untouched.late_ns == 0
    lateness = ticked(100)
    assert (lateness.worst_ns(100 * MS), lateness.first_ns, lateness.paused_ns) == (0, 0, 5 * MS)
    lateness.update(Tick(), 300 * MS)
    lateness.update(Tick(), 400 * MS)
    assert lateness.worst_ns(400 * MS) == 200 * MS
    assert lateness.worst_ns(301 * MS + SHOWN_NS) == 0
