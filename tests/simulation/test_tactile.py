"""Faults of the pads, group T: faulty taxels, rows and arrays, and incomplete images."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulation.bed import Bed
from simulation.edits import Frozen, pad
from simulation.faults import Drop, Edit, Split

ROW, COLUMN = 3, 8
"""A taxel in the middle of the contact."""


def wobble(bed, seconds):
    """The grip is changed a little, up and down: only under a load that moves does a taxel that rests show."""
    for n in range(round(seconds / 0.25)):
        bed.ask("lease.acquire", ttl_ms=200)
        bed.ask("grip.set", force_n=9.5 if n % 2 else 7.0)
        bed.run(0.25)


@pytest.mark.parametrize(
    ("count", "columns"),
    [(0, [COLUMN]), (700, [COLUMN]), (9000, [COLUMN]), (32_767, [COLUMN]), (0, [*range(16)])],
    ids=["dead", "stuck", "hot", "saturated", "a lost row"],
)
def test_T1_faulty_taxels_are_masked_and_reported_within_a_second_of_moving_load(held, count, columns):
    def change(row, counts, _):
        return np.where((row == ROW) & np.isin(np.arange(len(counts)), columns), count, counts)

    held.strike(Edit(pad(change), lies=False), "left.pad")
    wobble(held, 1.25)
    assert held.health("left.pad")["health"] >= 1
    assert held.health("left.pad")["masked"] == [ROW * 16 + column for column in columns]
    assert held.level() == "stable"
    assert "slipping" not in {level for t_ns, _, level in held.watch.changes if t_ns > held.now_ns - 10**9}


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
