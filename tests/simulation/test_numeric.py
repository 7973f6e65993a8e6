"""Faults of numbers, group N: NaN, infinities, denormals, and integers at their ends."""

from __future__ import annotations

import math

import pytest
from simulation.bed import assert_sound
from simulation.edits import pad, wrench
from simulation.faults import Edit

STRANGE = (math.nan, math.inf, -math.inf)
TINY = 1e-42


def one_number(place, value, rng, share=1.0):
    def change(six, _):
        return [value if n == place and rng.random() < share else number for n, number in enumerate(six)]

    return Edit(wrench(change), lies=False)


@pytest.mark.parametrize("seed", [1])
def test_N1_an_invalid_number_changes_no_later_result(held, seed):
    for place in range(6):
        for value in STRANGE:
            held.line("left.wrench").fault = one_number(place, value, held.rng)
            held.run(0.03)
            assert held.level() == "unknown"
            assert "invalid" in held.reasons()
            held.line("left.wrench").fault = one_number(place, value, held.rng, share=0.1)
            held.run(0.02)
            held.line("left.wrench").fault = None
            assert held.recovery_s("stable") <= 0.1
            assert held.watch.slip["left"]["normal_n"] == pytest.approx(8.0, abs=0.3)
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_N1_N4_denormals_are_numbers(held, seed):
    held.line("left.wrench").fault = Edit(wrench(lambda six, _: [TINY] * 6))
    held.run(0.05)
    held.line("left.wrench").fault = None
    assert held.recovery_s("stable") <= 1.0


@pytest.mark.parametrize("seed", [1])
def test_N3_a_huge_force_is_not_stable_and_does_no_lasting_harm(held, seed):
    held.line("left.wrench").fault = Edit(wrench(lambda six, _: [3e38] * 6))
    held.run(0.05)
    assert held.level() != "stable"
    held.line("left.wrench").fault = None
    assert held.recovery_s("stable") <= 1.0


@pytest.mark.parametrize("seed", [1])
def test_N2_A3_a_set_point_that_is_no_force_is_refused(held, seed):
    held.ask("lease.acquire", ttl_ms=200)
    before_n = held.rig.scene.normal_n
    for force_n in (*STRANGE, -1.0, 1e300, 0.0, True, "7", None):
        assert not held.ask("grip.set", force_n=force_n)["ok"]
    held.run(0.1)
    assert held.rig.scene.normal_n == pytest.approx(before_n, abs=0.05)
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_N3_counts_at_their_ends_do_not_wrap(held, seed):
    for count in (-32_768, 32_767):
        held.line("left.pad").fault = Edit(pad(lambda row, counts, _, count=count: counts * 0 + count))
        held.run(0.1)
        used = held.watch.slip["left"]["utilisation"]
        assert used is None or used >= 0.0
        held.line("left.pad").fault = None
        assert held.recovery_s("stable") <= 1.0
