"""Faults of the pads, group T: faulty taxels, rows and arrays, and incomplete images."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulation.bed import Bed, assert_sound
from simulation.edits import Frozen, pad
from simulation.faults import Drop, Edit, Split

SCAN_ROW_BYTES = 46
UNDER_LOAD = (3, 8)
"""A taxel in the middle of the contact: row, column."""


def one_taxel(value):
    def change(row, counts, now_ns):
        if row == UNDER_LOAD[0]:
            counts = counts.copy()
            counts[UNDER_LOAD[1]] = value(counts[UNDER_LOAD[1]], now_ns)
        return counts

    return Edit(pad(change), lies=False)


def wobble(bed, seconds):
    """The grip is changed a little, up and down: only under a load that moves does a taxel that rests show."""
    for n in range(round(seconds / 0.25)):
        bed.ask("lease.acquire", ttl_ms=200)
        bed.ask("grip.set", force_n=9.5 if n % 2 else 7.0)
        bed.run(0.25)


TAXEL_FAULTS = {
    "dead": lambda counts, now_ns: 0,
    "stuck": lambda counts, now_ns: 700,
    "hot": lambda counts, now_ns: 9000,
    "saturated": lambda counts, now_ns: 32_767,
}


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("kind", sorted(TAXEL_FAULTS))
def test_T1_a_faulty_taxel_is_masked_and_reported_within_a_second_of_moving_load(held, seed, kind):
    held.line("left.pad").fault = one_taxel(TAXEL_FAULTS[kind])
    wobble(held, 1.25)
    assert held.health("left.pad")["health"] >= 1
    assert held.health("left.pad")["masked"] == [UNDER_LOAD[0] * 16 + UNDER_LOAD[1]]
    assert held.level() == "stable"
    assert "slipping" not in {level for t_ns, _, level in held.watch.changes if t_ns > held.now_ns - 10**9}
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_T1_a_lost_row_is_masked_and_reported(held, seed):
    held.line("left.pad").fault = Edit(
        pad(lambda row, counts, _: np.zeros_like(counts) if row == UNDER_LOAD[0] else counts), lies=False
    )
    wobble(held, 1.25)
    assert held.health("left.pad")["health"] >= 1
    assert set(range(UNDER_LOAD[0] * 16, UNDER_LOAD[0] * 16 + 16)) <= set(held.health("left.pad")["masked"])
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_T2_an_image_that_misses_a_part_is_dropped_whole(held, seed):
    held.line("left.pad").fault = Edit(
        lambda data, _: data[: held.rng.randrange(1, max(2, len(data)))] if data else data, lies=False
    )
    held.run(0.1)
    assert held.level() == "unknown"
    assert held.reasons() == ["rotation_unobserved"]
    held.line("left.pad").fault = None
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_T2_two_images_mixed_are_no_image(held, seed):
    rows = {}

    def mixed(data, _):
        frames = [data[at : at + SCAN_ROW_BYTES] for at in range(0, len(data), SCAN_ROW_BYTES)]
        old = [rows.get(frame[3], frame) for frame in frames]
        rows.update({frame[3]: frame for frame in frames})
        return b"".join(new if n % 2 else before for n, (new, before) in enumerate(zip(frames, old, strict=True)))

    held.line("left.pad").fault = Edit(mixed, lies=False)
    held.run(0.1)
    assert held.level() == "unknown"
    held.line("left.pad").fault = None
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_T3_a_frozen_array_is_reported_while_the_force_moves(held, seed):
    held.line("left.pad").fault = Edit(pad(Frozen().row))
    held.watch.faults.clear()
    wobble(held, 0.25)
    assert held.level() == "unknown"
    assert "stuck" in held.reasons()
    assert held.health("left.pad")["health"] >= 1
    held.line("left.pad").fault = None
    assert held.recovery_s("stable") <= 1.0


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("charge", [False, True])
def test_T4_hum_and_a_drifting_baseline_are_no_slip(seed, charge):
    bed = Bed(seed, charge=charge)

    def hum(row, counts, now_ns):
        return counts + round(12.0 * math.sin(2.0 * math.pi * 50.0 * now_ns * 1e-9) + 3e-9 * (now_ns % 10**9))

    bed.line("left.pad").fault = Edit(pad(hum), lies=False)
    bed.hold()
    told = len(bed.watch.changes)
    bed.run(1.0)
    assert not {level for _, _, level in bed.watch.changes[told:]} & {"slipping", "warning"}
    assert_sound(bed)


@pytest.mark.parametrize("seed", [1])
def test_T2_a_charge_pad_that_missed_too_much_is_unknown_until_it_is_free_again(seed):
    bed = Bed(seed, charge=True).hold()
    bed.line("left.pad").fault = Drop(bed.rng)
    bed.run(0.5)
    bed.line("left.pad").fault = Split(bed.rng)
    bed.run(0.3)
    assert bed.level() == "unknown"
    assert bed.reasons() == ["rotation_unobserved"]
    assert_sound(bed)
