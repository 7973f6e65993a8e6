"""Faults of the force sensors, group F: off, stuck, wrong, slow, late or intermittent; overload; disagreement."""

from __future__ import annotations

import pytest
from simulation.bed import Bed
from simulation.faults import Bursts, Drop


def test_F1_an_intermittent_sensor_is_never_trusted_in_its_gaps(held):
    held.strike(Bursts(held.rng), "left.wrench")
    held.run(1.0)
    assert ("left", "unknown") in [change[1:] for change in held.watch.changes]
    held.recover()
    assert held.replays()


def test_F1_a_slow_sensor_is_reported(held):
    held.strike(Drop(held.rng, share=0.6), "left.wrench")
    held.run(1.1)
    assert held.health("left.wrench")["health"] == 1
    assert "Hz instead of" in held.health("left.wrench")["message"]


def test_F1_streams_that_fall_silent_one_after_the_other_are_each_noticed_in_time(held):
    held.strike(Drop(held.rng), "left.pad")
    held.run(0.015)
    held.strike(Drop(held.rng), "left.wrench")
    held.run(0.04)


def test_F1_no_grip_is_raised_on_a_stale_sensor(held):
    held.ask("lease.acquire", ttl_ms=200)
    held.strike(Drop(held.rng), "left.wrench")
    held.run(0.1)
    assert not held.ask("grip.set", force_n=10.0)["ok"]


def test_F4_a_tare_in_contact_is_refused_and_changes_nothing(held):
    before = held.watch.slip["left"]["tare_id"]
    assert held.ask("tare", finger="left", seconds=0.1)["error"]["code"] == "in_contact"
    held.run(0.3)
    assert held.watch.slip["left"]["tare_id"] == before
    assert held.watch.slip["left"]["normal_n"] == pytest.approx(8.0, abs=0.3)


def test_F4_a_tare_that_a_contact_interrupts_is_given_up():
    bed = Bed(1).free()
    before = bed.watch.slip["left"]["tare_id"]
    assert bed.ask("tare", finger="left", seconds=0.5)["ok"]
    bed.close()
    assert bed.watch.slip["left"]["tare_id"] == before
    assert bed.watch.slip["left"]["normal_n"] == pytest.approx(8.0, abs=0.3)
    assert bed.watch.faults == []
