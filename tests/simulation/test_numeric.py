"""Faults of numbers, group N: NaN, infinities, denormals, and integers at their ends."""

from __future__ import annotations

import math

import pytest
from simulation.edits import pad, wrench
from simulation.faults import Edit

STRANGE = (math.nan, math.inf, -math.inf)


def one_number(place, value, rng, share=1.0):
    def change(six, _):
        return [value if n == place and rng.random() < share else number for n, number in enumerate(six)]

    return Edit(wrench(change), lies=False)


@pytest.mark.parametrize("place", range(6))
def test_N1_an_invalid_number_changes_no_later_result(held, place):
    for value in STRANGE:
        held.strike(one_number(place, value, held.rng), "left.wrench")
        held.run(0.03)
        assert held.level() == "unknown"
        assert "invalid" in held.reasons()
        held.strike(one_number(place, value, held.rng, share=0.1), "left.wrench")
        held.run(0.02)
        held.recover(within_s=0.1)
        assert held.watch.slip["left"]["normal_n"] == pytest.approx(8.0, abs=0.3)


@pytest.mark.parametrize("number", [1e-42, 3e38], ids=["denormal", "huge"])
def test_N1_N3_N4_a_number_at_the_end_of_its_range_is_not_stable_and_does_no_lasting_harm(held, number):
    held.strike(Edit(wrench(lambda six, _: [number] * 6)), "left.wrench")
    held.run(0.05)
    assert held.level() != "stable"
    held.recover()
    held.watch.faults.clear()  # one reading is like another


def test_N2_A3_a_set_point_that_is_no_force_is_refused(held):
    held.ask("lease.acquire", ttl_ms=200)
    before_n = held.rig.scene.normal_n
    for force_n in (*STRANGE, -1.0, 1e300, 0.0, True, "7", None):
        assert not held.ask("grip.set", force_n=force_n)["ok"]
    held.run(0.1)
    assert held.rig.scene.normal_n == pytest.approx(before_n, abs=0.05)


@pytest.mark.parametrize("count", [-32_768, 32_767])
def test_N3_counts_at_their_ends_do_not_wrap(held, count):
    held.strike(Edit(pad(lambda row, counts, _: counts * 0 + count)), "left.pad")
    held.run(0.1)
    used = held.watch.slip["left"]["utilisation"]
    assert used is None or used >= 0.0
    held.recover()
    held.watch.faults.clear()  # the image was believed
