"""A session and its device on a bad line: no exception, and readings again once the line is good."""

from __future__ import annotations

from random import Random

from fuzz.conversation import Conversation
from fuzz.damage import damage
from fuzz.outcome import Outcome

BAD_SHARE = 0.3
"""Of the pieces, in both directions, that suffer a mishap while the line is bad."""

BAD_NS = 3_000_000_000
PATIENCE_NS = 40_000_000_000
"""From the line's getting well to the readings: a device may have to be silent for 10 s before it is begun anew."""

ENOUGH = 20
"""Readings that show that the session runs."""


def fuzz(device: str, seed: int) -> Outcome:
    """One conversation."""

    def carried(piece: bytes) -> bytes:
        bad = 0 < talk.now_ns < BAD_NS and len(piece) > 1 and rng.random() < BAD_SHARE
        return damage(piece, piece[::-1], rng) if bad else piece

    rng, heard = Random(seed), 0
    talk = Conversation(device, seed, carried)
    while heard < ENOUGH and talk.now_ns < BAD_NS + PATIENCE_NS:
        for _ in talk.step():
            heard += talk.now_ns >= BAD_NS
    outcome = Outcome(amount=1)
    if heard < ENOUGH:
        outcome.faults.append(f"no readings {PATIENCE_NS * 1e-9:.0f} s after a bad line; it says {talk.host.state!r}")
    return outcome
