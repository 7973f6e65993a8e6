"""A daemon that stood still knows it, and what it then reads may be as old."""

from __future__ import annotations

from slipd.pipeline.events import Bytes, Tick
from slipd.pipeline.lateness import CATCH_UP_NS, STALL_NS, TOLD_NS, Lateness

MS = 1_000_000
READ = Bytes("left.wrench", b"")


def ticked(until_ms: int) -> Lateness:
    lateness = Lateness()
    for ms in range(0, until_ms + 1, 5):
        lateness.note(Tick(), ms * MS)
    return lateness


def test_C4_what_is_read_after_a_stall_may_have_waited_as_long() -> None:
    lateness = ticked(100)
    lateness.note(READ, 100 * MS + STALL_NS)
    assert lateness.late_ns == 0
    lateness.note(READ, 400 * MS)
    assert lateness.late_ns == 300 * MS
    lateness.note(Tick(), 401 * MS)
    lateness.note(READ, 401 * MS + CATCH_UP_NS)
    assert lateness.late_ns > 0, "several reads empty what has waited"
    lateness.note(READ, 402 * MS + CATCH_UP_NS)
    assert lateness.late_ns == 0


def test_the_worst_stall_is_told_for_a_while() -> None:
    lateness = ticked(100)
    assert lateness.worst_ns(100 * MS) == 0
    lateness.note(Tick(), 300 * MS)
    lateness.note(Tick(), 400 * MS)
    assert lateness.worst_ns(400 * MS) == 200 * MS
    assert lateness.worst_ns(301 * MS + TOLD_NS) == 0


def test_before_the_first_tick_nothing_is_late() -> None:
    lateness = Lateness()
    lateness.note(READ, 10**12)
    assert lateness.late_ns == 0
