"""A friction measurement on a busy machine: gaps and stale moments end nothing, and it can go on after an end."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from pulls import Hand, typed

from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_session import MOST_PULLS, OBSTACLE_S, FrictionSession

STALE: dict[str, Any] = {"level": "unknown", "reasons": ["stale"]}
PULL = "Pull slowly along the pads until it slips, 1 of 1 (left 10.0 N)."


def session(said: list[str], samples: int = 1) -> FrictionSession:
    return FrictionSession(["left"], samples, 60.0, said.append)


def play(guided: FrictionSession, bodies: Iterable[dict[str, Any]]) -> None:
    for body in bodies:
        guided.advance(typed(body), body["t_ns"] * 1e-9)


def test_a_stall_between_stale_verdicts_is_no_long_obstacle() -> None:
    said: list[str] = []
    hand, guided = Hand(), session(said)
    for _ in range(4):
        play(guided, [*hand.rest(), hand.body(0.05) | STALE])
        hand.t_s += 3.0 * OBSTACLE_S
        play(guided, [hand.body(0.05) | STALE])
    play(guided, hand.once())
    assert guided.done
    assert said.count(PULL) == 1


def test_old_messages_of_other_streams_do_not_make_an_obstacle_longer() -> None:
    hand, guided = Hand(), session([])
    play(guided, hand.rest())
    guided.advance(None, hand.t_s - 100.0)
    play(guided, [hand.body(0.05) | STALE, hand.body(0.05) | STALE])
    play(guided, hand.once())
    assert guided.done


def test_an_obstacle_that_stays_ends_it_and_it_goes_on_with_what_was_measured() -> None:
    said: list[str] = []
    hand, guided = Hand(), session(said, samples=2)
    play(guided, hand.once())
    with pytest.raises(FrictionNotMeasured, match="not trusted"):
        play(guided, (body | STALE for body in hand.rest(OBSTACLE_S + 1.0)))
    guided.resume()
    play(guided, hand.once())
    assert guided.done
    assert len(guided.results["left"]) == 2


def test_samples_that_never_agreed_are_forgotten_when_it_goes_on() -> None:
    hand, guided = Hand(), session([], samples=2)
    scattered: list[dict[str, Any]] = []
    for k in range(2 * MOST_PULLS):
        hand.mu_s = 0.2 * 1.3**k
        hand.mu_d = 0.7 * hand.mu_s
        scattered += hand.once()
    with pytest.raises(FrictionNotMeasured, match="do not agree"):
        play(guided, scattered)
    guided.resume()
    hand.mu_s, hand.mu_d = 0.6, 0.45
    play(guided, [*hand.once(), *hand.once()])
    assert guided.done
    assert [sample.mu_s for sample in guided.results["left"]] == pytest.approx([0.6, 0.6], rel=0.02)


def test_release_is_asked_for_where_the_last_pull_still_acts() -> None:
    said: list[str] = []
    hand, guided = Hand(), session(said)
    grows = list(hand.pull())
    play(guided, [*Hand(t_s=99.0).rest(), *grows[:100], grows[100] | STALE])
    assert said[-1].startswith("  left: not counted")
    play(guided, grows[101:])
    assert said[-1] == "Let go of it."
    play(guided, hand.once())
    assert said.count(PULL) == 2
    assert guided.done
