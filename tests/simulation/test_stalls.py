"""A stalled daemon is distinguished from a sensor that really falls silent."""

from __future__ import annotations

import copy
import functools
from collections.abc import Iterator

import pytest
from simulation.bed import FINGERS, MS, Bed
from simulation.edits import wrench
from simulation.faults import Delay, Drop, Edit
from simulation.slow_reader import SlowReader
from simulation.watch import STALE_NS

from slipd.finger.freshness import LEAST_CATCH_UP_NS
from slipd_client.messages import Health

STALLS_MS = [5, 12, 21, 30, 60, 150, 500]


@functools.cache
def held_bed() -> SlowReader:
    """A bed that holds the box, its clocks learned."""
    bed = SlowReader(1)
    bed.hold()
    bed.run(0.3)
    assert bed.health("left.wrench")["clock"] == "locked"
    bed.watch.changes.clear()
    return bed


@pytest.fixture
def bed() -> Iterator[SlowReader]:
    bed = copy.deepcopy(held_bed())
    yield bed
    assert bed.watch.faults == [], "no verdict rests on what was older than it may be"


def changes(bed: Bed) -> list[tuple[str, str]]:
    """Finger and level of every change."""
    return [change[1:] for change in bed.watch.changes]


@pytest.mark.parametrize("force_first", [False, True])
@pytest.mark.parametrize("tick_first", [False, True])
def test_C4_a_daemon_that_stood_still_does_not_call_its_sensors_silent(
    bed: SlowReader, tick_first: bool, force_first: bool
) -> None:
    bed.tick_first, bed.force_first = tick_first, force_first
    for ms in STALLS_MS:
        bed.stall(ms / 1000)
        bed.run(0.1)
        assert changes(bed) == [], f"{ms} ms"
    assert bed.replays()


def test_C4_the_same_holds_for_devices_without_a_clock(bed: SlowReader) -> None:
    for finger in FINGERS:  # a clock that runs backwards is no clock
        bed.strike(Edit(wrench(clock_us=lambda us: 2**32 - us)), f"{finger}.wrench")
    bed.run(0.2)
    assert bed.health("left.wrench")["clock"] == "not_a_clock"
    bed.watch.changes.clear()
    bed.watch.faults.clear()
    for ms in STALLS_MS:
        bed.stall(ms / 1000)
        bed.run(0.1)
        assert changes(bed) == [], f"{ms} ms"
    message = bed.health("left.wrench")["message"]
    assert message.startswith("the daemon was late")
    assert "failed" not in message, "it is no sensor that comes and goes"
    bed.watch.faults.clear()  # readings with such a clock count as untrue


@pytest.mark.parametrize("force_first", [False, True])
@pytest.mark.parametrize(
    ("stream", "reason", "ms", "tick_first"),
    [
        *(("left.wrench", "stale", *case) for case in ((30, False), (150, True), (500, False))),
        *(("left.pad", "rotation_unobserved", *case) for case in ((60, False), (500, False))),
    ],
)
def test_C4_F1_a_sensor_that_stopped_meanwhile_is_missed_as_soon_as_its_line_is_empty(
    bed: SlowReader, stream: str, reason: str, ms: int, tick_first: bool, force_first: bool
) -> None:
    bed.tick_first, bed.force_first = tick_first, force_first
    bed.watch.lateness_ns = STALE_NS if ms < 50 else 0  # how long the last reading took to the host, nobody knows
    bed.stop(ms * 0.1)
    bed.strike(Drop(bed.rng), stream)
    bed.stop(ms * 0.9)
    bed.go_on()
    bed.catch_up()
    bed.run(0.005 if stream == "left.wrench" and ms > 50 else 0.03)
    assert (bed.level("left"), bed.reasons("left")) == ("unknown", [reason])
    assert changes(bed) == [("left", "unknown")], "the other finger's sensor went on"


@pytest.mark.parametrize(("ms", "silent"), [(30, False), (150, True)])
def test_C4_F1_A7_no_grip_is_raised_on_what_a_late_daemon_has_not_read(bed: SlowReader, ms: int, silent: bool) -> None:
    if silent:
        bed.strike(Drop(bed.rng), "left.wrench")
    bed.stop(ms)
    assert bed.ask("lease.acquire", ttl_ms=200)["ok"]
    error = bed.ask("grip.set", force_n=9.0)["error"]
    assert error["code"] == "not_ready"
    assert "left" in error["message"]
    assert bed.level("left") == "stable", "whether readings are missing is not known yet"
    bed.go_on()
    bed.run(0.2)
    assert bed.ask("lease.acquire", ttl_ms=200)["ok"]
    assert bed.ask("grip.set", force_n=9.0)["ok"] is not silent


def test_C4_a_line_that_was_late_already_is_not_excused(bed: SlowReader) -> None:
    bed.strike(Delay(150 * MS), "left.wrench")
    bed.run(0.5)
    assert (bed.level("left"), bed.reasons("left")) == ("unknown", ["stale"])
    bed.watch.changes.clear()
    bed.stall(0.3)
    bed.catch_up()
    assert ("left", "stable") not in changes(bed)


def test_C4_P3_a_daemon_that_never_catches_up_calls_no_sensor_silent_whose_readings_it_reads(bed: SlowReader) -> None:
    bed.overloaded = True
    until_ns = bed.now_ns + 6 * LEAST_CATCH_UP_NS
    while bed.now_ns < until_ns:
        bed.stall(0.015)
        bed.step()
    assert changes(bed) == []


@pytest.mark.parametrize(("stream", "reason"), [("left.wrench", "stale"), ("left.pad", "rotation_unobserved")])
def test_C4_P3_a_dead_sensor_does_not_hide_behind_a_daemon_that_never_catches_up(
    bed: SlowReader, stream: str, reason: str
) -> None:
    bed.overloaded = True
    bed.strike(Drop(bed.rng), stream)
    until_ns = bed.now_ns + 2 * LEAST_CATCH_UP_NS
    while bed.level("left") != "unknown":
        bed.stall(0.015)
        bed.step()
        assert bed.now_ns < until_ns
    assert (bed.reasons("left"), bed.level("right")) == ([reason], "stable")


def test_C4_the_health_of_a_stream_names_the_late_daemon_and_not_the_sensor(bed: SlowReader) -> None:
    bed.stall(0.3)
    bed.run(0.1)
    late = (Health.WARN, "the daemon was late by 0.30 s: readings waited, the sensor went on")
    for stream in ("left.wrench", "right.pad"):
        assert (bed.health(stream)["health"], bed.health(stream)["message"]) == late
    bed.run(2.0)
    assert (bed.health("left.wrench")["health"], bed.health("left.wrench")["message"]) == (Health.OK, "")


def test_C4_a_lease_is_judged_by_the_time_that_passed(bed: SlowReader) -> None:
    assert bed.ask("lease.acquire", ttl_ms=200)["ok"]
    bed.stall(0.3)
    bed.catch_up()
    assert bed.ask("grip.set", force_n=9.0)["error"]["code"] == "no_lease"


def test_C2_C4_after_a_suspend_all_is_unknown_even_if_readings_wait(bed: SlowReader) -> None:
    bed.stop(50)
    bed.suspend(10.0)
    bed.tick_first = True
    bed.go_on()
    assert sorted(changes(bed)) == [("left", "unknown"), ("right", "unknown")]
    assert bed.reasons("left") == ["stale"]
