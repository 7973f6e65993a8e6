"""What the guide and its host say to each other. The guide knows no terminal, page, socket or clock.

The steps of the guide are generators: they yield what a person shall see, what the daemon is asked for, and what
changes in the config, and get back what happened. A host is whatever answers: a terminal, a page, a test.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from slipd_client.messages.topics import Message

T = TypeVar("T")

SKIP = "skip"
"""The choice that leaves a step out."""

AGAIN = "again"
"""The choice that tries again what did not succeed."""

GO_ON = "go on"
"""The choice that goes on with what there is."""


class Skipped(Exception):  # noqa: N818 - it names what happened
    """The person left the present step out."""


@dataclass(frozen=True, slots=True)
class Say:
    """A line for the person: a finding, a residual, a reason. The host answers with None."""

    text: str


@dataclass(frozen=True, slots=True)
class Prompt:
    """What the person shall do now. The host answers with None; what is done arrives as later events.

    Attributes:
        step: What is asked for, e.g. "push_x" or "tips_down".
        text: The same for people.
        finger: Name of the finger; "" for all.
        choices: Words of which the person may choose one, the usual one first. Where the readings show that it is
            done, nothing needs to be chosen, and the only word is SKIP.
        free: What may be typed in place of a word; "" if nothing.
    """

    step: str
    text: str
    finger: str = ""
    choices: tuple[str, ...] = (SKIP,)
    free: str = ""


@dataclass(frozen=True, slots=True)
class Ask:
    """A request for the daemon. The host answers with a Reply or a Refusal, and drops the messages before it.

    Attributes:
        method: Name of the method of a ``GripClient``.
        fields: Its arguments, by name.
        lease: It needs the lease, which the host acquires for this request alone.
    """

    method: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    lease: bool = False


@dataclass(frozen=True, slots=True)
class Gravity:
    """Which way is down, from now on. The host answers with None, and tells the daemon ten times a second.

    Attributes:
        by_finger: Gravity in the frame of the pad of each finger, m/s²; empty: it is not sent any more.
    """

    by_finger: Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Change:
    """Values for the config. The host answers with a Reply: the text with them, None if it was only shown.

    Attributes:
        values: New value of each key, as TOML, by its path.
    """

    values: Mapping[tuple[str, ...], str]


@dataclass(frozen=True, slots=True)
class Choice:
    """The person chose a word of the last prompt, or typed something else."""

    word: str


@dataclass(frozen=True, slots=True)
class Reply:
    """A request or a change was carried out.

    Attributes:
        result: What the method of the client returned; of a change, the new text of the config or None.
    """

    result: Any


@dataclass(frozen=True, slots=True)
class Refusal:
    """The daemon refused a request, or did not answer.

    Attributes:
        reason: Why, for people.
    """

    reason: str


Output = Say | Prompt | Ask | Gravity | Change | None
"""None: the next event, please."""

Event = Message | Choice | Reply | Refusal | None
"""None: no message came for a while (`slipd.tools.commission.readings.SILENCE_S`), or nothing is to be answered."""

Steps = Generator[Output, Event, T]


def choose(prompt: Prompt) -> Steps[str]:
    """Ask the person to choose; return the word, or the text where the prompt allows one.

    Raises:
        Skipped: The person chose SKIP.
    """
    yield prompt
    while True:
        event = yield None
        if not isinstance(event, Choice):
            continue
        if event.word == SKIP:
            raise Skipped
        if event.word in prompt.choices or (prompt.free and event.word):
            return event.word
        yield Say(f"  please choose: {', '.join(prompt.choices)}")


def follow(steps: Steps[T], respond: Callable[[Output], Event]) -> T:
    """Run steps to their end with a host that blocks; return their result."""
    try:
        output = next(steps)
        while True:
            output = steps.send(respond(output))
    except StopIteration as done:
        result: T = done.value
        return result
