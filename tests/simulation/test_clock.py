"""Faults of the clocks, group C: the wall clock, the devices' clocks, a host that sleeps, a loop that is late."""

from __future__ import annotations

import pytest
from simulation.bed import FINGERS, MS, SECOND, Bed
from simulation.edits import pad, wrench
from simulation.faults import Bunch, Chain, Delay, Edit, Split

US_SPAN = 1 << 32


def set_clocks(bed, clock_us):
    """Let both devices of the left finger date their readings by another clock, and return how they do."""
    clocks = {
        "left.wrench": Edit(wrench(clock_us=clock_us), lies=False),
        "left.pad": Edit(pad(clock_us=clock_us), lies=False),
    }
    for stream, clock in clocks.items():
        bed.strike(clock, stream)
    return clocks


def test_C1_a_wall_clock_that_steps_changes_nothing():
    """The engine is told the wall clock once, at the start: no event can bring it another."""
    early, late = Bed(1), Bed(1)
    late.engine = late.engine_at(early.wall_ns - 3600 * SECOND)
    for bed in (early, late):
        bed.hold()
    assert late.watch.changes == early.watch.changes
    told, before = late.watch.slip["left"], early.watch.slip["left"]
    assert before.pop("timestamp") - told.pop("timestamp") == pytest.approx(3600.0)
    assert told == before


def test_C2_a_host_that_slept_knows_nothing_and_holds_no_lease(held):
    shift_us = 0
    for slept_s in (1.0, 3600.0):
        assert held.ask("lease.acquire", ttl_ms=200)["ok"]
        held.suspend(slept_s)
        shift_us += round(slept_s * 1e6)
        set_clocks(held, lambda time_us, shift_us=shift_us: (time_us + shift_us) % US_SPAN)
        held.watch.changes.clear()
        held.run(0.006)
        assert not held.ask("status")["result"]["lease"]["held"]
        assert ("left", "unknown") in [change[1:] for change in held.watch.changes]
        for finger in FINGERS:
            assert held.recovery_s("stable", finger) <= 1.0
        assert not held.ask("grip.set", force_n=9.0)["ok"]
    assert held.replays()


@pytest.mark.parametrize("ppm", [-500.0, 500.0])
def test_C3_a_clock_that_drifts_is_learned_and_its_readings_keep_their_place(held, ppm):
    begun_us = held.said_ns // 1000
    set_clocks(held, lambda time_us: (time_us + round((time_us - begun_us) * ppm * 1e-6)) % US_SPAN)
    held.run(1.5)
    assert (held.level(), held.health("left.wrench")["clock"]) == ("stable", "locked")
    assert held.health("left.wrench")["clock_uncertainty_s"] < 5e-3


def test_C3_a_clock_that_begins_anew_is_learned_again_within_a_second(held):
    jump_us = -held.said_ns // 1000
    set_clocks(held, lambda time_us: (time_us + jump_us) % US_SPAN)
    held.run(1.0)
    assert (held.level(), held.health("left.wrench")["clock"]) == ("stable", "locked")


def test_L12_a_bunched_stream_keeps_its_verdict_and_is_dated_by_its_device_clock(held):
    held.strike(Chain([Bunch(), Split(held.rng, most=400)]))
    held.watch.lateness_ns = Bunch.period_ns
    held.run(1.2)
    assert (held.watch.changes, held.level(), held.health("left.wrench")["clock"]) == ([], "stable", "locked")
    assert held.health("left.wrench")["clock_uncertainty_s"] < 0.016


@pytest.mark.parametrize(
    ("delay_ms", "tick_us"),
    [(60, 1), *(pytest.param(*case, marks=pytest.mark.long) for case in ((200, 1000), (500, 1), (3000, 1000)))],
)
def test_F1_a_line_that_is_late_for_good_stays_stale_until_it_is_prompt_again(held, delay_ms, tick_us):
    clocks = set_clocks(held, lambda us: us // tick_us * tick_us)
    held.run(0.2)
    for stream, clock in clocks.items():
        held.strike(Chain([clock, Delay(delay_ms * MS)]), stream)
    held.run(0.1)
    held.watch.changes.clear()
    for _ in range(5):
        held.ask("lease.acquire", ttl_ms=500)
        assert not held.ask("grip.set", force_n=9.0)["ok"]
        held.run(0.25 + delay_ms * 2e-4)
    assert (held.level(), held.reasons()) == ("unknown", ["stale"])
    assert "left" not in {finger for _, finger, _ in held.watch.changes}
    assert (held.health("left.pad")["clock"], held.health("left.pad")["health"]) == ("delayed", 3)
    assert f"are {delay_ms * 1e-3:.2f} s older" in held.health("left.pad")["message"]
    for stream, clock in clocks.items():
        held.strike(clock, stream)
        held.line(stream).queue.clear()
    held.run(0.3)
    assert held.health("left.pad")["clock"] == "locked"
    if delay_ms < 1000:  # the force sensor's session has given up by then, and begins its conversation anew
        assert held.recovery_s("stable") <= 1.0
    assert held.replays()
