"""Random faults, one after another: a share of ``python -m simulation``."""

from __future__ import annotations

from simulation.campaign import play

SEED = 20261122
"""The same every time; `python -m simulation` draws others."""
FAULTS = 4


def test_the_verdict_is_sound_under_every_fault_and_comes_back_behind_it():
    episode = play(SEED, FAULTS)
    assert episode.faults == [], f"{episode.story}; again: python -m simulation --seed {SEED} --episodes 1"


def test_an_episode_is_the_same_to_the_byte_when_its_seed_is_played_again():
    assert play(7, 1) == play(7, 1)
