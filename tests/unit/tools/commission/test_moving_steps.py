"""Friction and first grasp where something goes wrong: the guide says why, waits, and asks again."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from pulls import Hand, typed

from slipd.errors import SlipdError
from slipd.tools.commission import friction_step, gripper_steps
from slipd.tools.commission.dialogue import Ask, Choice, Event, Output, Prompt, Refusal, Reply, Say, Skipped, follow
from slipd.tools.commission.friction_step import measure_friction
from slipd.tools.commission.gripper_steps import MOST_TRIES, first_grasp, release
from slipd.tools.commission.readings import LEAST_READINGS, ReadingListener
from slipd_client.messages.codec import typed_message
from slipd_client.messages.schema.topics import Message

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


def test_a_sample_that_was_lost_is_gripped_again() -> None:
    rig = Rig(
        course(lambda hand: (body | FREE for body in hand.rest(3.0)), Hand.once, Hand.once), "close", "close", "open"
    )
    assert follow(measure_friction(["left"], 5.0, 2.0), rig.respond)
    assert rig.asked == ["gripper_close", "gripper_close", "gripper_open"]
    assert any("nothing touches the pad" in line for line in rig.printed)


def test_a_command_that_was_lost_names_the_command_that_acknowledges_it() -> None:
    rig = Rig(course(), "close", "skip")
    rig.fault = "command_lost"
    with pytest.raises(Skipped):
        follow(first_grasp(["left"], 5.0, 60.0), rig.respond)
    assert any("command_lost is latched" in line and "slipctl grip ack" in line for line in rig.printed)


def test_a_gripper_that_does_not_become_active_ends_the_step() -> None:
    rig = Rig(course(), "activate")
    rig.active = None
    assert not follow(first_grasp(["left"], 5.0, 60.0), rig.respond)
    assert rig.printed[-1] == "  not active after 15 s; slipctl status says why"


def test_a_release_that_is_refused_is_asked_for_again_or_the_grip_is_kept() -> None:
    rig = Rig(course(), "open", "keep", refusals=["in contact"])
    follow(release(), rig.respond)
    assert rig.printed[1] == "  not opened: in contact"
    assert rig.printed[-1].startswith("  the gripper keeps its grip")


@pytest.mark.parametrize(("more", "why"), [(STALE, "left is unknown: stale"), (FREE, "left is no_contact")])
def test_a_grasp_without_a_verdict_says_why(more: dict[str, Any], why: str) -> None:
    rig = Rig(endless(Hand(), **more), "close", "open")
    assert not follow(first_grasp(["left"], 5.0, 3.0), rig.respond)
    assert any(why in line for line in rig.printed)


def test_a_grasp_can_be_left_out_while_it_is_shown_and_is_opened() -> None:
    rig = Rig(course(), "close", "open")
    rig.leaves_at = "stable"
    with pytest.raises(Skipped):
        follow(first_grasp(["left"], 5.0, 60.0), rig.respond)
    assert rig.asked == ["gripper_close", "gripper_open"]


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


def test_a_sample_that_is_gripped_already_is_not_closed_on_and_the_step_can_be_left_out() -> None:
    rig = Rig(course(), "gripped already")
    rig.leaves_at = "Pull"
    with pytest.raises(Skipped):
        follow(measure_friction(["left"], 5.0, 60.0), rig.respond)
    assert rig.asked == []


def test_friction_gives_up_after_some_tries_without_a_sample() -> None:
    rig = Rig(endless(Hand(), **STALE), "close", *["again"] * (friction_step.MOST_TRIES - 1), "open")
    with pytest.raises(Skipped):
        follow(measure_friction(["left"], 5.0, 60.0), rig.respond)
    assert f"  given up: {friction_step.MOST_TRIES} times in a row nothing was measured" in rig.printed
    assert rig.asked == ["gripper_close", "gripper_open"]


def test_a_motion_that_is_refused_again_and_again_is_given_up() -> None:
    rig = Rig(course(), "close", *["again"] * 100, refusals=["lease_held"] * 100)
    with pytest.raises(Skipped):
        follow(first_grasp(["left"], 5.0, 60.0), rig.respond)
    assert rig.asked == ["gripper_close"] * MOST_TRIES
    assert rig.printed[-1] == f"  given up after {MOST_TRIES} tries"


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
