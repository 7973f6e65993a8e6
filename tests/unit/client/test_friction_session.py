"""A friction measurement on a busy machine: gaps and stale moments end nothing, and it can go on after an end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from pulls import Hand, typed

from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_session import MOST_PULLS, MOST_REJECTED, OBSTACLE_S, FrictionSession

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


def test_pulls_that_never_count_end_it_with_the_reason_of_the_last() -> None:
    said: list[str] = []
    hand, guided = Hand(), session(said)

    def jerks() -> Iterator[dict[str, Any]]:
        while True:
            yield from (*hand.rest(), *hand.pull(seconds=0.05), *hand.rest())

    with pytest.raises(
        FrictionNotMeasured, match=r"8 pulls in a row gave nothing. The last, left: .* pull more slowly"
    ):
        play(guided, jerks())
    assert sum("not counted" in line for line in said) == MOST_REJECTED
    guided.resume()
    play(guided, hand.once())
    assert guided.done


def test_disturbances_that_come_again_and_again_end_it_after_a_stated_time() -> None:
    said: list[str] = []
    hand, guided = Hand(), session(said)

    def disturbed() -> Iterator[dict[str, Any]]:
        """Somebody holds on whenever the readings were missing, and lets go when asked."""
        while True:
            yield from (*hand.rest(1.0), hand.body(0.05) | STALE, *hand.rest(0.2, 0.3))

    with pytest.raises(FrictionNotMeasured, match=r"no pull counted for 180 s.* disturbed again and again.*\(stale\)"):
        play(guided, disturbed())
    assert not any("not counted" in line for line in said)
    guided.resume()
    play(guided, hand.once())
    assert guided.done


def test_a_finger_that_never_slips_beside_one_that_does_is_named() -> None:
    said: list[str] = []
    guided = FrictionSession(["left", "right"], 1, 60.0, said.append)
    left, right = Hand(), Hand("right", mu_s=0.6)

    def pulls() -> Iterator[dict[str, Any]]:
        while True:
            for body in left.once():
                held = right.body(min(body["required_friction"], 0.3)) | {"t_ns": body["t_ns"]}
                yield from (body, held)

    with pytest.raises(FrictionNotMeasured, match="4 pulls slipped on finger left, and too few on finger right"):
        play(guided, pulls())
    guided.resume()
    assert len(guided.results["left"]) == 1
