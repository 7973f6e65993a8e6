"""Friction and first grasp where something goes wrong: the guide says why, waits, and asks again."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
from pulls import Hand, typed

from slipd.errors import SlipdError
from slipd.tools.commission import friction_step, gripper_steps
from slipd.tools.commission.dialogue import (
    Ask,
    Choice,
    Event,
    Output,
    Prompt,
    Refusal,
    Reply,
    Say,
    Skipped,
    Steps,
    follow,
)
from slipd.tools.commission.friction_step import measure_friction
from slipd.tools.commission.gripper_steps import MOST_TRIES, first_grasp, release
from slipd.tools.commission.readings import LEAST_READINGS, ReadingListener
from slipd_client.messages.codec import typed_message
from slipd_client.messages.topics import Message

STALE: dict[str, Any] = {"level": "unknown", "reasons": ["stale"]}
FREE: dict[str, Any] = {"level": "no_contact", "normal_n": 0.0, "required_friction": None}


class Rig:
    """Answers the guide: requests by a table, questions by a script, and messages of a hand.

    Attributes:
        printed: Lines for the person.
        asked: Requests.
        active: Whether the gripper is; None: it never becomes active.
        fault: Latched fault of the gripper.
        leaves_at: Words at which the person leaves the step out, after a mistyped word.
    """

    def __init__(self, bodies: Iterable[dict[str, Any]], *words: str, refusals: Iterable[str] = ()) -> None:
        self._bodies, self._words, self._refusals = iter(bodies), iter(words), iter(refusals)
        self._choices: list[Choice] = []
        self.printed: list[str] = []
        self.asked: list[str] = []
        self.active: bool | None = True
        self.fault, self.leaves_at = "", "nothing"

    def respond(self, output: Output) -> Event:
        if isinstance(output, (Say, Prompt)):
            self.printed.append(output.text)
            if isinstance(output, Prompt) and len(output.choices) > 1:
                self._choices = [Choice(next(self._words))]
            if self.leaves_at in output.text:
                self._choices, self.leaves_at = [Choice("skip"), Choice("perhaps")], "nothing"
        elif isinstance(output, Ask):
            return self._answer(output)
        elif self._choices:
            return self._choices.pop()
        else:
            return typed(next(self._bodies))
        return None

    def _answer(self, ask: Ask) -> Reply | Refusal:
        if ask.method == "hello":
            return Refusal("no answer")
        if ask.method == "status":
            return Reply(SimpleNamespace(gripper=SimpleNamespace(active=self.active, latched_fault=self.fault)))
        self.asked.append(ask.method)
        reason = next(self._refusals, "")
        self.active = self.active if self.active is None else self.active or not reason
        return Refusal(reason) if reason else Reply({})


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(friction_step, "SAMPLES", 1)
    monkeypatch.setattr(gripper_steps, "HOLD_S", 1.0)
    monkeypatch.setattr(gripper_steps, "SETTLE_S", 1.0)


def endless(hand: Hand, **more: Any) -> Iterator[dict[str, Any]]:
    while True:
        yield hand.body(0.05) | more


def course(*parts: Callable[[Hand], Iterable[dict[str, Any]]]) -> Iterator[dict[str, Any]]:
    hand = Hand()
    for part in parts:
        yield from part(hand)
    yield from endless(hand)


def test_what_one_finger_showed_stays_where_the_other_is_left_out() -> None:
    def left_alone(hand: Hand) -> Iterator[dict[str, Any]]:
        right = Hand("right")
        for body in hand.once():
            yield from (body, right.body(0.05))
        while True:
            yield right.body(0.05) | STALE | {"t_ns": hand.body(0.05)["t_ns"]}

    rig = Rig(course(left_alone), "gripped already", "skip")
    assert list(follow(measure_friction(["left", "right"], None, 60.0), rig.respond)) == ["left"]


@dataclass
class Course:
    """A step in which something goes wrong.

    Attributes:
        step: The step.
        bodies: Verdicts.
        words: What the person chooses.
        said: Parts of lines that are printed, in their order.
        asked: Motions that are asked for.
        ends: Whether it has a result; None: it is left out.
        refusals: Why motions are refused.
        rig: How the rig differs.
    """

    step: Steps[Any]
    bodies: Iterable[dict[str, Any]]
    words: list[str]
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    ends: bool | None = None
    refusals: list[str] = field(default_factory=list)
    rig: dict[str, Any] = field(default_factory=dict)


LEFT: tuple[list[str], float, float] = (["left"], 5.0, 60.0)
CLOSE, OPEN = "gripper_close", "gripper_open"
GIVEN_UP = f"  given up: {friction_step.MOST_TRIES} times in a row nothing was measured"
COURSES = {
    "a sample that was lost is gripped again": Course(
        measure_friction(["left"], 5.0, 2.0),
        course(lambda hand: (body | FREE for body in hand.rest(3.0)), Hand.once, Hand.once),
        ["close", "close", "open"],
        ["nothing touches the pad"],
        [CLOSE, CLOSE, OPEN],
        ends=True,
    ),
    "a command that was lost names the command that acknowledges it": Course(
        first_grasp(*LEFT),
        course(),
        ["close", "skip"],
        ["command_lost is latched", "slipctl grip ack"],
        [CLOSE],
        rig={"fault": "command_lost"},
    ),
    "a gripper that does not become active ends the step": Course(
        first_grasp(*LEFT),
        course(),
        ["activate"],
        ["  not active after 15 s; slipctl status says why"],
        ["gripper_activate"],
        ends=False,
        rig={"active": None},
    ),
    "a release that is refused is asked for again or the grip is kept": Course(
        release(),
        course(),
        ["open", "keep"],
        ["  not opened: in contact", "  the gripper keeps its grip"],
        [OPEN],
        ends=False,
        refusals=["in contact"],
    ),
    "a grasp without a verdict says why": Course(
        first_grasp(["left"], 5.0, 3.0),
        endless(Hand(), **STALE),
        ["close", "open"],
        ["left is unknown: stale"],
        [CLOSE, OPEN],
        ends=False,
    ),
    "a grasp of nothing says why": Course(
        first_grasp(["left"], 5.0, 3.0),
        endless(Hand(), **FREE),
        ["close", "open"],
        ["left is no_contact"],
        [CLOSE, OPEN],
        ends=False,
    ),
    "a grasp can be left out while it is shown and is opened": Course(
        first_grasp(*LEFT), course(), ["close", "open"], asked=[CLOSE, OPEN], rig={"leaves_at": "stable"}
    ),
    "a sample that is gripped already is not closed on and the step can be left out": Course(
        measure_friction(*LEFT), course(), ["gripped already"], rig={"leaves_at": "Pull"}
    ),
    "friction gives up after some tries without a sample": Course(
        measure_friction(*LEFT),
        endless(Hand(), **STALE),
        ["close", *["again"] * (friction_step.MOST_TRIES - 1), "open"],
        [GIVEN_UP],
        [CLOSE, OPEN],
    ),
    "a motion that is refused again and again is given up": Course(
        first_grasp(*LEFT),
        course(),
        ["close", *["again"] * 100],
        [f"  given up after {MOST_TRIES} tries"],
        [CLOSE] * MOST_TRIES,
        refusals=["lease_held"] * 100,
    ),
}


@pytest.mark.parametrize("name", COURSES)
def test_where_something_goes_wrong(name: str) -> None:
    given = COURSES[name]
    rig = Rig(given.bodies, *given.words, refusals=given.refusals)
    vars(rig).update(given.rig)
    with pytest.raises(Skipped) if given.ends is None else nullcontext():
        assert bool(follow(given.step, rig.respond)) == given.ends
    assert rig.asked == given.asked
    said = "\n".join(rig.printed)
    assert re.search(".*".join(map(re.escape, given.said)), said, re.DOTALL), said


def test_a_grasp_shows_both_fingers_and_ends_where_the_daemon_falls_silent() -> None:
    both = (body for body in course() for body in (body, body | {"finger": "right"}))
    rig = Rig(both, "close", "open")
    assert follow(first_grasp(["left", "right"], 5.0, 60.0), rig.respond)
    assert any("left stable 10.0 N; right stable 10.0 N" in line for line in rig.printed)
    for step in (first_grasp(["left"], 5.0, 60.0), measure_friction(["left"], 5.0, 60.0)):
        rig = Rig(Hand().rest(1.0), "close")
        with pytest.raises(SlipdError, match="Is slipd running"):
            follow(step, lambda output, rig=rig: silent(rig, output))


def silent(rig: Rig, output: Output) -> Event:
    """Answer as the rig until its messages end."""
    try:
        return rig.respond(output)
    except StopIteration:
        return None


def wrench(t_s: float, finger: str = "left", force_n: float = 0.0) -> Message:
    body = {"v": 1, "seq": 1, "boot": "b", "t_ns": round(t_s * 1e9), "finger": finger, "config_id": "rig"}
    return typed_message(f"wrench.{finger}", body | {"force_n": [0.0, 0.0, force_n], "torque_nm": [0.0, 0.0, 0.0]})


def test_readings_that_are_older_than_the_begin_of_a_mean_do_not_count() -> None:
    """Streams lag by different times, and a busy machine delivers readings from before an answer."""
    listener = ReadingListener(["left", "right"], "rig")
    before = [wrench(10.0), wrench(11.0, "right")]
    late = [wrench(10.0 + 0.01 * k, force_n=9.0) for k in range(50)]
    fresh = [wrench(11.0 + 0.01 * k, finger) for k in range(60) for finger in ("left", "right")]
    events: list[Event] = [*before, *late, *fresh]
    assert not follow(listener.wait(lambda newest: False, 0.4), lambda _: events.pop(0))
    events = [*late, *fresh[40:], *(wrench(12.0 + 0.01 * k, f) for k in range(60) for f in ("left", "right"))]
    assert float(follow(listener.collect(0.3), lambda _: events.pop(0))["left"].wrench[2]) == 0.0
    events = [Reply(SimpleNamespace(t_ns=round(20.0e9))), *fresh]
    follow(listener.leave_out_earlier(), lambda _: events.pop(0))
    assert not follow(listener.wait(lambda newest: True, 0.4), lambda _: events.pop(0))


def test_a_finger_without_readings_is_named_and_waited_for() -> None:
    printed: list[str] = []
    fingers, choices, numbers = ["left"], list[Choice](), itertools.count()

    def respond(output: Output) -> Event:
        if isinstance(output, Prompt):
            printed.append(output.text)
            fingers.append("right")
            choices.append(Choice("again"))
            return None
        number = next(numbers)
        return choices.pop() if choices else wrench(15.0 + 0.02 * number, fingers[number % len(fingers)])

    found = follow(ReadingListener(["left", "right"], "rig").collect(0.1), respond)
    assert printed == [
        "Finger right had no force readings for 10.1 s. slipctl status says why. Go on when they are back."
    ]
    assert len(found["right"].wrenches) >= LEAST_READINGS
