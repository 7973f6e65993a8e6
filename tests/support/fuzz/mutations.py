"""Damaged frames among good ones: no exception, few accepted by chance, and at most one good frame lost."""

from __future__ import annotations

from random import Random

from fuzz.corpus import T_NS, Corpus, Key, key
from fuzz.damage import damage
from fuzz.outcome import Outcome

GOOD_BEHIND = 2
"""Good frames behind each damaged one: it may cost the first of them, never the second."""

MIXING = frozenset(("wsg",))
"""Devices whose readings consist of the newest of several updates."""

CONTEXT = 100
"""Frames for which a number that was believed though damaged may make good ones look old."""


def fuzz(corpus: Corpus, seed: int, damaged: int) -> Outcome:
    """Feed damaged frames among good ones."""
    rng, outcome = Random(seed), Outcome()
    while outcome.amount < damaged:
        _pass(corpus, rng, outcome)
    return outcome


def _pass(corpus: Corpus, rng: Random, outcome: Outcome) -> None:
    """Once through the recording: damaged, good, good, damaged, good, good."""
    units, stride = corpus.units, 1 + GOOD_BEHIND
    first = GOOD_BEHIND + rng.randrange(stride)
    bad = range(first, len(units) - GOOD_BEHIND, stride)
    fed = list(units)
    for index in bad:
        fed[index] = damage(units[index], units[index - 1], rng)
    heard, raised = _hear(corpus, fed)
    if raised:
        outcome.faults.append(raised)
    outcome.amount += len(bad)
    sent = {said for keys in corpus.keys for said in keys}
    outcome.false += sum(said not in sent and not _is_mixed(corpus, said, sent) for said in heard)
    for index in bad:
        missing = [n for n in range(index + 1, index + stride) if not heard.issuperset(corpus.keys[n])]
        if len(missing) > 1 and not raised and not _is_believed(corpus, fed, index, sent):
            outcome.faults.append(
                f"{len(missing)} good frames lost behind {fed[index].hex()} (was {units[index].hex()})"
            )


def _is_mixed(corpus: Corpus, said: Key, sent: set[Key]) -> bool:
    """Whether a reading of the newest updates has only values that were sent: where one was damaged, an older one."""
    return corpus.device in MIXING and all(
        value in column for value, column in zip(said, zip(*sent, strict=True), strict=True)
    )


def _is_believed(corpus: Corpus, fed: list[bytes], index: int, sent: set[Key]) -> bool:
    """Whether a damaged frame just before passed for a reading: its number may make those behind it look old.

    Of a message it is enough that anything came of it: its number is no part of what a reading says.
    """
    receiver = corpus.receiver()
    for n in range(max(0, index - CONTEXT), index + 1 + GOOD_BEHIND):
        samples = receiver.receive(fed[n], T_NS)
        believed = [sample for sample in samples if corpus.messages or key(sample) not in sent]
        if believed and fed[n] != corpus.units[n]:
            return True
    return False


def _hear(corpus: Corpus, fed: list[bytes]) -> tuple[set[Key], str]:
    """What a fresh receiver makes of the pieces, and what it raised."""
    receiver = corpus.receiver()
    heard: set[Key] = set()
    for piece in fed if corpus.messages else (b"".join(fed),):
        try:
            heard.update(key(sample) for sample in receiver.receive(piece, T_NS))
        except Exception as error:
            return heard, f"{type(error).__name__}: {error} on {piece[:80].hex()}"
    return heard, ""
