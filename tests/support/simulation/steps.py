"""Steps of a course of a bed, beside those of `run_courses`: faults of its lines, and what is told under them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import pytest
from run_courses import Step, ask, follow, health, level
from simulation.bed import Bed, held_bed
from simulation.line import Fault

from slipd_client.messages import Health

STREAMS = WRENCH, PAD = "left.wrench", "left.pad"
STALE, BLIND = level("unknown", "stale"), level("unknown", "rotation_unobserved")
STABLE, OTHER_STABLE = level("stable"), level("stable", finger="right")
RAISE = ask("grip.set", ("not_ready", "force_n"), force_n=9.0)
"""No grip is raised on what is not known."""

Course = tuple[Callable[[], Bed], Sequence[Step]]
HELD: Callable[[], Bed] = held_bed
hold: Step = Bed.hold


def play(course: Course) -> None:
    """Play a course; at its end, nothing that was watched is at fault."""
    make, steps = course
    bed = make()
    follow(bed, steps)
    assert bed.watch.faults == []


def strike(fault: Fault | Callable[[Random], Fault] | None, *streams: str) -> Step:
    """A fault befalls lines from now on, all lines if none is named; None: they are sound again."""
    return lambda bed: bed.strike(fault(bed.rng) if callable(fault) else fault, *streams)


def run(seconds: float) -> Step:
    """Let time pass."""
    return lambda bed: bed.run(seconds)


def recovers(within_s: float = 1.0) -> Step:
    """Check that both fingers are stable in time."""
    return lambda bed: bed.recover(within_s)


MENDED = strike(None), recovers()


def struck(stream: str, fault: Fault | Callable[[Random], Fault], seconds: float, *steps: Step) -> list[Step]:
    """A fault befalls a line of the left finger for a while; the right one stays stable, and later both are."""
    return [strike(fault, stream), run(seconds), *steps, OTHER_STABLE, *MENDED]


def unwell(*words: str, stream: str = WRENCH) -> Step:
    """Check that a stream is in doubt, and why."""
    return health(stream, *words, severity=Health.WARN)


def silent(*words: str, stream: str = WRENCH) -> Step:
    """Check that a stream is silent."""
    return health(stream, *words, severity=Health.STALE)


def forget(bed: Bed) -> None:
    """From now on other changes count."""
    bed.watch.changes.clear()


def changed(*expected: tuple[str, str]) -> Step:
    """Check finger and level of every change, in any order."""

    def step(bed: Bed) -> None:
        assert sorted(change[1:] for change in bed.watch.changes) == list(expected)

    return step


def told(finger: str, word: str, *, ever: bool = True) -> Step:
    """Check whether a level of a finger was told."""

    def step(bed: Bed) -> None:
        assert ((finger, word) in [change[1:] for change in bed.watch.changes]) is ever

    return step


def excuse(bed: Bed) -> None:
    """What was told until now was not true, and nobody could know that."""
    bed.watch.faults.clear()


def feels(normal_n: Any) -> Step:
    """Check the normal force that is told of the left finger."""

    def step(bed: Bed) -> None:
        assert bed.watch.slip["left"]["normal_n"] == pytest.approx(normal_n, abs=0.3)

    return step


def replays(bed: Bed) -> None:
    """Check that the same events tell the same."""
    assert bed.replays()
