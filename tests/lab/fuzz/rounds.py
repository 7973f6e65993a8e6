"""The rounds of a fuzzing run, and how many of each."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

from fuzz import mutations, noise, splits, talks
from fuzz.corpus import record
from fuzz.outcome import Outcome

from slipd.devices import DEVICES

MEASURES = ("splits", "mutations", "noise", "talks")
STRICT = {"mutations": 10_000_000, "noise": 10_000_000_000}
LEAST = {"mutations": 150_000, "noise": 16_000_000}
"""For each device, however slow it is."""

SECONDS = 60.0
"""Of a run that is not strict, on all cores together: ``--seconds`` says otherwise."""

STRICT_TALKS, TALKS = 300, 10
"""Conversations with each device that is spoken to."""

SHARE = 0.05
"""Of the splits in a run that is not strict."""


@dataclass(frozen=True)
class Job:
    """One round: what is done, to which device, with which seed."""

    measure: str
    device: str
    seed: int
    share: float

    def run(self) -> tuple[Job, Outcome]:
        """Does it."""
        if self.measure == "splits":
            return self, splits.fuzz(record(self.device), self.seed, self.share)
        if self.measure == "talks":
            return self, talks.fuzz(self.device, self.seed)
        measure = mutations if self.measure == "mutations" else noise
        return self, measure.fuzz(record(self.device), self.seed)


Results = dict[tuple[str, str], Outcome]


@dataclass(frozen=True)
class Wish:
    """What is asked for.

    Attributes:
        devices: Which devices.
        seed: Of the first round; the next ones count on.
        strict: The numbers of `STRICT`, and every split.
        seconds: Of a run that is not strict, on all cores together.
        rounds: So many of each kind instead, and no clock; None: as above.
    """

    devices: list[str]
    seed: int
    strict: bool = False
    seconds: float = SECONDS
    rounds: int | None = None


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def stages(wish: Wish, results: Results) -> Iterator[Iterable[Job]]:
    """One round of everything, and behind it as many more as time or the strict numbers ask for."""
    rounds = 1 if wish.rounds is None else wish.rounds
    share = 1.0 if wish.strict or wish.rounds is not None else SHARE
    yield [
        Job(measure, device, wish.seed + n, share)
        for measure in MEASURES
        for device in wish.devices
        for n in range(1 if measure == "splits" else rounds)
        if measure != "talks" or DEVICES[device].session is not None
    ]
    if wish.rounds is not None:
        return
    spoken_to = [device for device in wish.devices if DEVICES[device].session is not None]
    talk_count = STRICT_TALKS if wish.strict else TALKS
    more = [Job("talks", device, wish.seed + 1 + n, share) for device in spoken_to for n in range(talk_count)]
    for measure in ("mutations", "noise"):
        done = {device: results[measure, device] for device in wish.devices}
        if wish.strict:
            wanted = _strict_rounds(measure, done)
        else:
            each_s = wish.seconds * cores() / (2 * len(wish.devices))
            wanted = {device: int(each_s / outcome.seconds) for device, outcome in done.items()}
        for device, count in wanted.items():
            more += [Job(measure, device, wish.seed + 1 + n, share) for n in range(count)]
    yield more


def _strict_rounds(measure: str, done: dict[str, Outcome]) -> dict[str, int]:
    """Rounds that make up the strict number: so many for each device, and the rest for the same time each."""
    left = STRICT[measure]
    least = {device: ceil(LEAST[measure] / outcome.amount) for device, outcome in done.items()}
    left -= sum(count * done[device].amount for device, count in least.items())
    each_s = max(0.0, left / sum(outcome.amount / outcome.seconds for outcome in done.values()))
    return {device: least[device] + ceil(each_s / outcome.seconds) for device, outcome in done.items()}
