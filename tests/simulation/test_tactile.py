"""Faults of the pads, group T: faulty taxels, rows and arrays, and incomplete images."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulation.bed import Bed
from simulation.edits import Frozen, pad, rows_of, sealed
from simulation.faults import Drop, Edit, Split

UNDER_LOAD = (3, 8)
"""A taxel in the middle of the contact: row, column."""


def wobble(bed, seconds):
    """The grip is changed a little, up and down: only under a load that moves does a taxel that rests show."""
    for n in range(round(seconds / 0.25)):
        bed.ask("lease.acquire", ttl_ms=200)
        bed.ask("grip.set", force_n=9.5 if n % 2 else 7.0)
        bed.run(0.25)


@pytest.mark.parametrize("count", [0, 700, 9000, 32_767], ids=["dead", "stuck", "hot", "saturated"])
def test_T1_a_faulty_taxel_is_masked_and_reported_within_a_second_of_moving_load(held, count):
    def change(row, counts, _):
        faulty = (row == UNDER_LOAD[0]) & (np.arange(len(counts)) == UNDER_LOAD[1])
        return np.where(faulty, count, counts)

    held.strike(Edit(pad(change), lies=False), "left.pad")
    wobble(held, 1.25)
    assert held.health("left.pad")["health"] >= 1
    assert held.health("left.pad")["masked"] == [UNDER_LOAD[0] * 16 + UNDER_LOAD[1]]
    assert held.level() == "stable"
    assert "slipping" not in {level for t_ns, _, level in held.watch.changes if t_ns > held.now_ns - 10**9}


def test_T1_a_lost_row_is_masked_and_reported(held):
    lost = pad(lambda row, counts, _: counts * 0 if row == UNDER_LOAD[0] else counts)
    held.strike(Edit(lost, lies=False), "left.pad")
    wobble(held, 1.25)
    assert held.health("left.pad")["health"] >= 1
    assert set(range(UNDER_LOAD[0] * 16, UNDER_LOAD[0] * 16 + 16)) <= set(held.health("left.pad")["masked"])


def test_T2_an_image_that_misses_a_part_is_dropped_whole(held):
    cut = Edit(lambda data, _: data[: held.rng.randrange(1, max(2, len(data)))] if data else data, lies=False)
    held.struck("left.pad", cut, 0.1, reasons=["rotation_unobserved"])


def test_T2_two_images_mixed_are_no_image(held):
    before = {}

    def mixed(data, _):
        rows = [sealed(row) for row in rows_of(data)]
        old = [before.get(row[3], row) for row in rows]
        before.update({row[3]: row for row in rows})
        return b"".join(new if n % 2 else last for n, (new, last) in enumerate(zip(rows, old, strict=True)))

    held.struck("left.pad", Edit(mixed, lies=False), 0.1)


def test_T3_a_frozen_array_is_reported_while_the_force_moves(held):
    held.strike(Edit(pad(Frozen().row)), "left.pad")
    wobble(held, 0.25)
    assert held.level() == "unknown"
    assert "stuck" in held.reasons()
    assert held.health("left.pad")["health"] >= 1
    held.recover()
    held.watch.faults.clear()  # the image was believed until it was found out


@pytest.mark.parametrize("charge", [False, True])
def test_T4_hum_and_a_drifting_baseline_are_no_slip(charge):
    def hum(row, counts, now_ns):
        return counts + round(12.0 * math.sin(2.0 * math.pi * 50.0 * now_ns * 1e-9) + 3e-9 * (now_ns % 10**9))

    bed = Bed(1, charge=charge)
    bed.strike(Edit(pad(hum), lies=False), "left.pad")
    bed.hold()
    bed.watch.changes.clear()
    bed.run(1.0)
    assert not {level for _, _, level in bed.watch.changes} & {"slipping", "warning"}
    assert bed.watch.faults == []


def test_T2_a_charge_pad_that_missed_too_much_is_unknown_until_it_is_free_again():
    bed = Bed(1, charge=True).hold()
    bed.strike(Drop(bed.rng), "left.pad")
    bed.run(0.5)
    bed.strike(Split(bed.rng), "left.pad")
    bed.run(0.3)
    assert (bed.level(), bed.reasons()) == ("unknown", ["rotation_unobserved"])
    assert bed.watch.faults == []
