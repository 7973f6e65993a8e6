"""A friction measurement of several pulls, and the command that guides a person through it."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
from client_peers import Daemon, refuse
from pulls import Hand, typed

from slipd_client import friction_guide
from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_pull import PullSample
from slipd_client.friction_session import (
    LONGEST_STEP_S,
    MOST_PULLS,
    MOST_REJECTED,
    NO_SLIP,
    OBSTACLE_S,
    ElapsedTime,
    FrictionSession,
    agreeing,
    config_lines,
    disagreement,
    spread,
)
from slipd_client.messages.topics import Slip

STALE: dict[str, Any] = {"level": "unknown", "reasons": ["stale"]}

Call = Callable[..., tuple[int, str, str]]


class Guided(FrictionSession):
    """A session that keeps its lines, and takes the time of each verdict."""

    def __init__(self, *fingers: str, samples: int = 1) -> None:
        self.said: list[str] = []
        super().__init__(fingers or ["left"], samples, 60.0, self.said.append)

    def play(self, bodies: Iterable[dict[str, Any]]) -> None:
        for body in bodies:
            self.advance(typed(body), body["t_ns"] * 1e-9)


def test_stalls_and_old_messages_of_other_streams_are_no_long_obstacle() -> None:
    hand, guided = Hand(), Guided()
    for _ in range(4):
        guided.play([*hand.rest(), hand.body(0.05) | STALE])
        hand.t_s += 3.0 * OBSTACLE_S
        guided.advance(None, hand.t_s - 100.0)
        guided.play([hand.body(0.05) | STALE])
    guided.play(hand.once())
    assert (guided.done, guided.said.count("Pull slowly along the pads until it slips, 1 of 1 (left 10.0 N).")) == (
        True,
        1,
    )


def scattered(hand: Hand) -> Iterator[dict[str, Any]]:
    for k in range(2 * MOST_PULLS):
        hand.mu_s, hand.mu_d = 0.2 * 1.3**k, 0.14 * 1.3**k
        yield from hand.once()


def jerks(hand: Hand) -> Iterator[dict[str, Any]]:
    while True:
        yield from (*hand.rest(), *hand.pull(seconds=0.05), *hand.rest())


def disturbed(hand: Hand) -> Iterator[dict[str, Any]]:
    """Somebody holds on whenever the readings were missing, and lets go when asked."""
    hand.hz = 60.0
    while True:
        yield from (*hand.rest(1.0), hand.body(0.05) | STALE, *hand.rest(0.2, 0.3))


def one_slips(left: Hand) -> Iterator[dict[str, Any]]:
    right = Hand("right")
    while True:
        for body in left.once():
            yield from (body, right.body(min(body["required_friction"], 0.3)) | {"t_ns": body["t_ns"]})


@pytest.mark.parametrize(
    ("guided", "trouble", "why", "not_counted"),
    [
        (Guided(samples=2), lambda hand: (body | STALE for body in hand.rest(OBSTACLE_S + 1.0)), "not trusted", 0),
        (Guided(samples=2), scattered, "the samples of finger left do not agree", None),
        (Guided(), jerks, r"8 pulls in a row gave nothing. The last, left: .* pull more slowly", MOST_REJECTED),
        (Guided(), disturbed, r"no pull counted for 180 s.* disturbed again and again.*\(stale\)", 0),
        (Guided("left", "right"), one_slips, "4 pulls slipped on finger left, and too few on finger right", 0),
    ],
)
def test_what_never_ends_by_itself_ends_with_its_reason_and_goes_on_afterwards(
    guided: Guided, trouble: Callable[[Hand], Iterable[dict[str, Any]]], why: str, not_counted: int | None
) -> None:
    hand = Hand()
    if "not trusted" in why:
        guided.play(hand.once())
    with pytest.raises(FrictionNotMeasured, match=why):
        guided.play(trouble(hand))
    assert not_counted in (None, sum("not counted" in line for line in guided.said))
    said = len(guided.said)
    guided.resume()
    hand.mu_s, hand.mu_d, hand.hz = 0.6, 0.45, Hand.hz
    if "right" not in why:
        guided.play([*hand.once(), *hand.once()])
        assert (guided.done, guided.said[said].partition(",")[0]) == (True, "Pull slowly along the pads until it slips")
    assert [sample.mu_s for sample in guided.results["left"]][:1] == pytest.approx([0.6], rel=0.02)


def samples(*values: float) -> list[PullSample]:
    return [PullSample(value, 0.8 * value, 10.0) for value in values]


def test_samples_within_a_quarter_agree_and_the_largest_group_counts() -> None:
    assert agreeing([]) == []
    group = agreeing(found := samples(0.5, 0.8, 0.52, 0.54))
    assert [each.mu_s for each in group] == [0.5, 0.52, 0.54]
    assert [disagreement(each, group) for each in found] == ["", "0.800 is 54% from the others, 0.520", "", ""]
    assert [each.mu_s for each in agreeing(samples(0.3, 0.31, 0.5, 0.6))] == [0.3, 0.31], "of two, the closer one"


def test_the_lines_for_the_config_are_toml_with_a_low_estimate() -> None:
    assert spread(samples(0.5)) == pytest.approx(0.093, abs=0.001), "that of one pull is the usual one"
    assert 0.03 < spread(samples(0.5, 0.5, 0.5)) < spread(samples(0.48, 0.5, 0.52)) < spread(samples(0.45, 0.5, 0.55))
    found = tomllib.loads("\n".join(config_lines("left", samples(0.5, 0.52, 0.54))))
    assert found["finger"]["left"] == {"mu": pytest.approx(0.52 * 0.941, abs=1e-3), "mu_spread": 0.059}
    assert "of 1 pull," in config_lines("left", samples(0.5))[1]


def test_elapsed_time_counts_no_stall_and_no_message_that_is_late() -> None:
    clock = ElapsedTime()
    assert [clock.update(now_s) for now_s in (7.0, 7.25, 7.125, 7.375)] == [0.0, 0.25, 0.25, 0.375]
    assert clock.update(100.0) == 0.375 + LONGEST_STEP_S


STATUS: dict[str, Any] = {
    "fingers": {"left": {"level": "stable"}, "right": {"level": "stable"}},
    "streams": {"left.wrench": {"health": 0}, "right.wrench": {"health": 0}},
}


@pytest.fixture
def measure(daemon: Daemon, monkeypatch: pytest.MonkeyPatch, stepped: Callable[[Any], Any], call: Call) -> Call:
    """Lets slipctl measure while it hears verdicts, each when its time has come."""
    daemon.handlers["status"] = lambda _: STATUS
    clock = stepped(friction_guide)

    def run(bodies: Iterator[dict[str, Any]], *arguments: str) -> tuple[int, str, str]:
        def receive(timeout_s: float) -> Slip | None:
            clock.sleep(1.0 / Hand.hz)
            body = next(bodies, None)
            return body and typed(body)

        heard = nullcontext(SimpleNamespace(receive=receive, check_silence=lambda: pytest.fail("nothing more comes")))
        monkeypatch.setattr(friction_guide, "Subscriber", lambda *_, **__: heard)
        return call("--requests", daemon.endpoint, "friction", "measure", *arguments)

    return run


def pulled(*coefficients: float) -> Iterator[dict[str, Any]]:
    """Hold and pull the left finger once for each coefficient."""
    hand = Hand()
    for hand.mu_s in coefficients:
        hand.mu_d = 0.8 * hand.mu_s
        yield from hand.once()


def test_three_pulls_give_lines_for_the_config(measure: Call, daemon: Daemon) -> None:
    code, out, _ = measure(pulled(0.50, 0.52, 0.54, 0.54), "left")
    guide, _, config = out.partition("left: static friction 0.51")
    lines = guide.splitlines()
    assert (code, lines[0]) == (0, "Pull slowly along the pads until it slips, 1 of 3 (left 10.0 N).")
    assert lines.count("Let go of it.") >= 2
    shown = re.findall(r"slips at (\S+), .* while it slides, 10\.0 N", guide)
    assert [float(mu) for mu in shown] == pytest.approx([0.50, 0.52, 0.54], rel=0.01)
    rest, _, text = config.partition("\n")
    assert "dynamic friction 0.41" in rest
    found = tomllib.loads(text)["finger"]["left"]
    assert found == {"mu": pytest.approx(0.489, rel=0.01), "mu_spread": pytest.approx(0.059, rel=0.1)}
    assert set(daemon.ops) == {"hello", "status"}, "it asks for nothing that moves or sets anything"


def test_as_json_the_result_is_one_document_and_the_guide_is_on_standard_error(
    measure: Call,
) -> None:
    code, out, errors = measure(pulled(0.5), "left", "--samples", "1", "--json")
    found = json.loads(out)["left"]
    assert found == {
        "mu": pytest.approx(found["mu_s"] * (1.0 - found["mu_spread"])),
        "mu_spread": found["mu_spread"],
        "mu_s": pytest.approx(0.5, rel=0.01),
        "mu_d": found["mu_d"],
        "normal_n": 10.0,
    }
    assert (code, errors.startswith("Pull slowly")) == (0, True)


@pytest.mark.parametrize(
    ("fields", "asked", "why"),
    [
        (
            {"level": "no_contact", "normal_n": 0.0, "required_friction": None},
            "Grip a sample of the object, for example with: slipctl grip close 10\n",
            "finger left: nothing touches the pad",
        ),
        ({}, "Pull slowly along the pads until it slips, 1 of 3 (left 10.0 N).\n", NO_SLIP),
    ],
)
def test_where_nothing_happens_it_says_what_to_do_and_gives_up_in_the_end(
    measure: Call, fields: dict[str, Any], asked: str, why: str
) -> None:
    assert measure(Hand(more=fields).rest(600.0), "left", "--patience", "0.5") == (
        1,
        asked,
        f"slipctl: nothing more was measured for 0.5 s: {why}\n",
    )


def test_a_sensor_with_a_fault_and_a_wrong_name_are_told_before_anything_else(
    daemon: Daemon, measure: Callable[..., tuple[int, str, str]]
) -> None:
    daemon.handlers["status"] = lambda _: {
        **STATUS,
        "streams": {"left.wrench": {"health": 2, "message": "overloaded"}, "right.wrench": {"health": 0}},
    }
    assert measure(iter([]), "left") == (1, "", "slipctl: left.wrench is ERROR: overloaded\n")
    assert daemon.ops.count("status") > 1, "a sensor may just begin"
    answers = iter([refuse("deadline_passed", "it came too late")(None)] * 2)
    daemon.handlers["status"] = lambda _: next(answers, STATUS)
    assert measure(iter([]), "middle") == (1, "", "slipctl: finger must be one of left, right, got 'middle'\n")
