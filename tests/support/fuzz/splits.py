"""The same bytes in every split: the samples and the health are the same."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import pairwise
from random import Random
from typing import Any

from fuzz.corpus import T_NS, Corpus, key
from fuzz.damage import damage
from fuzz.outcome import Outcome

FRAMES = 200
BYTEWISE = "in pieces of 1"
LONGEST_PIECE = 64
"""Bytes; longer ones cut as the cuts at one byte do."""

DAMAGED = 10
"""Every so many frames one is damaged in the second recording, so that the counters have something to count."""


def fuzz(corpus: Corpus, seed: int, share: float = 1.0, frames: int = FRAMES) -> Outcome:
    """Cuts a device's frames at every byte, a good recording and a damaged one.

    Args:
        corpus: What the device says.
        seed: Of the damage and of the share.
        share: How many of the splits are tried, 0 to 1; byte by byte always is.
        frames: How many of the recorded ones.
    """
    rng, outcome = Random(seed), Outcome()
    for units in (list(corpus.units[:frames]), _some_damaged(corpus, frames, rng)):
        whole = _heard(corpus, units)
        for name, pieces in _splits(units):
            if rng.random() >= share and name != BYTEWISE:
                continue
            if _heard(corpus, pieces) != whole:
                outcome.faults.append(f"cut {name}: other samples or health than whole")
            outcome.amount += 1
    return outcome


def _some_damaged(corpus: Corpus, frames: int, rng: Random) -> list[bytes]:
    units = list(corpus.units[:frames])
    for index in range(DAMAGED, len(units), DAMAGED):
        units[index] = damage(units[index], units[index - 1], rng)
    return units


def _splits(units: list[bytes]) -> Iterator[tuple[str, Iterable[bytes]]]:
    """Every split that is tried: each frame cut at each of its bytes, and the whole in short pieces of each length."""
    longest = max(map(len, units))
    for at in range(1, longest):
        yield f"each frame at byte {at}", _at_byte(units, at)
    stream = b"".join(units)
    for length in range(1, min(longest, LONGEST_PIECE) + 1):
        yield f"in pieces of {length}", [stream[n : n + length] for n in range(0, len(stream), length)]


def _at_byte(units: list[bytes], at: int) -> list[bytes]:
    return [before[at:] + unit[:at] for before, unit in pairwise([b"", *units, b""])]


def _heard(corpus: Corpus, pieces: Iterable[bytes]) -> tuple[list[Any], dict[str, int]]:
    receiver = corpus.receiver()
    samples = [key(sample) for piece in pieces for sample in receiver.receive(piece, T_NS)]
    return samples, asdict(receiver.health)
