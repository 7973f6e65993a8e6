"""Faults of the clocks, group C: the wall clock, the devices' clocks, a host that sleeps, a loop that is late."""

from __future__ import annotations

import pytest
from simulation.bed import MS, SECOND, Bed, assert_sound
from simulation.edits import pad, wrench
from simulation.faults import Bunch, Chain, Delay, Edit

US_SPAN = 1 << 32


def drifting(ppm, jump_us=0):
    """Both of a finger's clocks run too fast by so much from now on, or jump."""
    begun = {}

    def clock(name):
        def changed(time_us):
            first = begun.setdefault(name, time_us)
            return (time_us + jump_us + round((time_us - first) * ppm * 1e-6)) % US_SPAN

        return changed

    return Edit(wrench(clock_us=clock("wrench")), lies=False), Edit(pad(clock_us=clock("pad")), lies=False)


@pytest.mark.parametrize("seed", [1])
def test_C1_a_wall_clock_that_steps_changes_nothing(seed):
    """The engine is told the wall clock once, at the start: no event can bring it another."""
    early, late = Bed(seed), Bed(seed)
    late.engine = late.engine_at(early.wall_ns - 3600 * SECOND)
    for bed in (early, late):
        bed.hold()
    assert late.watch.changes == early.watch.changes
    told, before = late.watch.slip["left"], early.watch.slip["left"]
    assert before.pop("timestamp") - told.pop("timestamp") == pytest.approx(3600.0)
    assert told == before


@pytest.mark.parametrize("seed", [1])
def test_C2_a_host_that_slept_knows_nothing_and_holds_no_lease(held, seed):
    shift_us = 0
    for slept_s in (1.0, 3600.0):
        assert held.ask("lease.acquire", ttl_ms=200)["ok"]
        held.suspend(slept_s)
        shift_us += round(slept_s * 1e6)
        for stream, fault in zip(("left.wrench", "left.pad"), drifting(0.0, shift_us), strict=True):
            held.line(stream).fault = fault
        told = len(held.watch.changes)
        held.run(0.006)
        assert not held.ask("status")["result"]["lease"]["held"]
        assert ("left", "unknown") in [change[1:] for change in held.watch.changes[told:]]
        for finger in ("left", "right"):
            assert held.recovery_s("stable", finger) <= 1.0
        assert not held.ask("grip.set", force_n=9.0)["ok"]
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("ppm", [-500.0, 500.0])
def test_C3_a_clock_that_drifts_is_learned_and_its_readings_keep_their_place(held, seed, ppm):
    for stream, fault in zip(("left.wrench", "left.pad"), drifting(ppm), strict=True):
        held.line(stream).fault = fault
    held.run(1.5)
    health = held.health("left.wrench")
    assert held.level() == "stable"
    assert health["clock"] == "locked"
    assert health["clock_uncertainty_s"] < 5e-3
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_C3_a_clock_that_begins_anew_is_learned_again_within_a_second(held, seed):
    faults = drifting(0.0, jump_us=-held.said_ns // 1000)
    for stream, fault in zip(("left.wrench", "left.pad"), faults, strict=True):
        held.line(stream).fault = fault
    held.run(1.0)
    assert held.level() == "stable"
    assert held.health("left.wrench")["clock"] == "locked"
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_L12_a_bunched_stream_is_dated_by_its_device_clock(held, seed):
    for line in held.lines.values():
        line.fault = Bunch()
    held.watch.lateness_ns = Bunch.period_ns
    held.run(1.2)
    assert held.health("left.wrench")["clock"] == "locked"
    assert held.health("left.wrench")["clock_uncertainty_s"] < 0.016
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_C4_a_loop_that_stalls_reports_no_reading_as_newer_than_it_is(held, seed):
    held.run(0.5)
    for stalled_s in (0.01, 0.1, 1.0):
        held.stall(stalled_s)
        for finger in ("left", "right"):
            assert held.recovery_s("stable", finger) <= 1.0
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
def test_C4_a_lease_is_judged_by_the_time_that_passed(held, seed):
    assert held.ask("lease.acquire", ttl_ms=200)["ok"]
    held.stall(0.3)
    assert not held.ask("grip.set", force_n=9.0)["ok"]
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize(
    ("delay_ms", "tick_us"),
    [(60, 1), *(pytest.param(*case, marks=pytest.mark.long) for case in ((200, 1000), (500, 1), (3000, 1000)))],
)
def test_F1_a_line_that_is_late_for_good_stays_stale_until_it_is_prompt_again(held, seed, delay_ms, tick_us):
    def coarse(us):
        return us // tick_us * tick_us

    clocks = {
        "left.wrench": Edit(wrench(clock_us=coarse), lies=False),
        "left.pad": Edit(pad(clock_us=coarse), lies=False),
    }
    for stream, clock in clocks.items():
        held.line(stream).fault = clock
    held.run(0.2)
    for stream, clock in clocks.items():
        held.line(stream).fault = Chain([clock, Delay(delay_ms * MS)])
    held.run(0.1)
    told = len(held.watch.changes)
    for _ in range(5):
        held.ask("lease.acquire", ttl_ms=500)
        assert not held.ask("grip.set", force_n=9.0)["ok"]
        held.run(0.25 + delay_ms * 2e-4)
    assert (held.level(), held.reasons()) == ("unknown", ["stale"])
    assert [change for change in held.watch.changes[told:] if change[1] == "left"] == []
    assert (held.health("left.pad")["clock"], held.health("left.pad")["health"]) == ("delayed", 3)
    assert f"are {delay_ms * 1e-3:.2f} s older" in held.health("left.pad")["message"]
    for stream, clock in clocks.items():
        held.line(stream).fault = clock
        held.line(stream).queue.clear()
    held.run(0.3)
    assert held.health("left.pad")["clock"] == "locked"
    if delay_ms < 1000:  # the force sensor's session has given up by then, and begins its conversation anew
        assert held.recovery_s("stable") <= 1.0
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("stream", ["left.wrench", "left.pad"])
def test_C4_F1_readings_that_arrive_late_are_reported_as_old(held, seed, stream):
    held.run(1.0)
    held.line(stream).fault = Delay(150 * MS)
    held.run(0.5)
    assert held.level() == "unknown"
    assert_sound(held)
