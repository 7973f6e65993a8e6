"""Random faults, one after another: a share of ``python -m campaign``."""

from __future__ import annotations

from campaign.episodes import play
from campaign.size import size_of
from simulation.bed import held_bed
from simulation.faults import Flood

SEED = 20261122
"""The same every time; `python -m campaign` draws others."""
FAULTS = 4


def test_the_verdict_is_sound_under_every_fault_and_comes_back_behind_it():
    episode = play(SEED, FAULTS)
    assert episode.faults == [], f"{episode.story}; again: python -m campaign --seed {SEED} --episodes 1"


def test_an_episode_is_the_same_to_the_byte_when_its_seed_is_played_again():
    assert play(7, 1) == play(7, 1)


def test_a_flood_costs_no_memory():
    bed = held_bed(1)
    bed.run(0.2)
    before = size_of(bed.engine)
    bed.strike(Flood(bed.rng), "left.wrench", "left.pad")
    bed.run(0.6)
    assert size_of(bed.engine) < before + 64_000
