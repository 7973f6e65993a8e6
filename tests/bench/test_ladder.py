"""The ladder that is measured tells what the daemon tells: else what it saves would be no saving."""

from __future__ import annotations

import pytest
from bench import replays
from bench.ladder import EXACT, ONE_PASS, TRANSLATION, Ladder, Solved, witnessed

TRIAL = replays.TRIALS / "2022-02-22-08-10-01"
WALKS = ("walk of 30 ms", "load anew each reading")
WALK_S = 1.4


@pytest.fixture(scope="module", params=["trial", *WALKS])
def run(request: pytest.FixtureRequest) -> replays.Run:
    """Short runs whose utilisation crosses every threshold."""
    if request.param == "trial":
        return replays.trial(TRIAL)
    return replays.walk(request.param, replays.WALKS[request.param], WALK_S, seed=3)


def test_levels_with_the_ladder_are_those_without(run: replays.Run) -> None:
    plain, solved = witnessed(run, Solved())
    told, ladder = witnessed(run, Ladder(run.settings))
    assert [level for level, _ in told] == [level for level, _ in plain]
    assert ladder.rungs.total() == len(solved.answers) > 300
    assert {level for level, _ in plain} >= {"no_contact", "stable", "caution", "warning"}


def test_every_rung_settles_some(run: replays.Run) -> None:
    _, ladder = witnessed(run, Ladder(run.settings))
    assert {ONE_PASS, EXACT} <= set(ladder.rungs) <= {TRANSLATION, ONE_PASS, EXACT}


def test_translation_alone_settles_a_load_beyond_the_warning() -> None:
    run = replays.trial(TRIAL)
    _, ladder = witnessed(run, Ladder(run.settings))
    assert ladder.rungs[TRANSLATION] > 100


def test_answers_said_again_give_the_same_verdicts(run: replays.Run) -> None:
    plain, solved = witnessed(run, Solved())
    assert witnessed(run, solved.again())[0] == plain


def test_a_run_gives_the_same_events_again() -> None:
    once, again = (replays.walk("walk", 0.03, 0.5, seed=1) for _ in range(2))
    assert once.events == again.events
