"""Random bytes: no exception, and no more false readings than the device's checksum lets pass by chance."""

from __future__ import annotations

import itertools

import numpy as np
from fuzz.corpus import T_NS, Corpus
from fuzz.outcome import Outcome

BLOCK = 1 << 20
"""Bytes fed at once to a device on a line."""

LONGEST_MESSAGE = 4096
"""Bytes of the longest random message, of devices that send whole messages."""


def fuzz(corpus: Corpus, seed: int, amount: int) -> Outcome:
    """Feed random bytes."""
    outcome = Outcome()
    rng = np.random.default_rng(seed)
    receiver = corpus.receiver()
    while outcome.amount < amount:
        block = rng.bytes(min(BLOCK, amount - outcome.amount))
        outcome.amount += len(block)
        for piece in _pieces(block, rng) if corpus.messages else (block,):
            try:
                outcome.false += len(receiver.receive(piece, T_NS))
            except Exception as error:
                outcome.faults.append(f"{type(error).__name__}: {error} on {len(piece)} bytes {piece[:80].hex()}")
                receiver = corpus.receiver()
    return outcome


def _pieces(block: bytes, rng: np.random.Generator) -> list[bytes]:
    """The block as messages of every length."""
    ends = np.cumsum(rng.integers(0, LONGEST_MESSAGE + 1, size=2 * len(block) // LONGEST_MESSAGE + 64))
    cuts = [0, *ends[ends < len(block)].tolist(), len(block)]
    return [block[begin:end] for begin, end in itertools.pairwise(cuts)]
