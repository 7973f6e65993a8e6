"""``slipctl watch``: shows messages as they arrive, for a person, a log or another program."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import sys
import time
from collections.abc import Mapping
from typing import Any

from slipd_client.errors import Silence
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.live_view import LiveView, change_line
from slipd_client.messages import GRIPPER_TOPIC, STATUS_TOPIC, WARNING_TOPIC
from slipd_client.repairs import repairs
from slipd_client.subscriber import Message, Subscriber
from slipd_client.terminal import UNCUT, TerminalScreen, is_screen, plain, size_of, terminal_of

TOPICS = ("slip", GRIPPER_TOPIC, WARNING_TOPIC, STATUS_TOPIC)
"""What people are shown."""

FIRST_S = 3.0
"""How long to wait for the first message: the daemon publishes ``status`` every second."""

GATHER_S = 1.2
"""The daemon sends the last message of every topic to a new subscriber, of quiet topics after half a second."""

REDRAW_S = 0.15
LINE_S = 1.0


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command until interrupted; with ``--once`` it ends with the last message of each topic.

    Raises:
        Silence: No message came within ``FIRST_S``; with ``--once``, none of the topics.
        CallError: The endpoint is not one of ZeroMQ, or no topic begins like one that is named.
    """
    as_json = chosen.json or bool(chosen.topic)
    shown = (chosen.topic or ("",)) if as_json else TOPICS
    with Subscriber(chosen.publish, shown, keys=keys, silence_s=FIRST_S) as subscriber:
        first = subscriber.receive(FIRST_S) if chosen.once else next(iter(subscriber))
        if first is None:
            subscriber.check_silence()
            raise Silence(f"no message of {', '.join(shown)} for {FIRST_S:g} s; slipctl status lists the fingers")
        if chosen.once:
            _show_once(_gather(subscriber, first), as_json)
        elif as_json:
            _print_json(subscriber, first)
        else:
            _follow(subscriber, first)


def _gather(subscriber: Subscriber, first: Message) -> dict[str, Message]:
    """Return the newest message of every topic that the daemon sends within ``GATHER_S``."""
    newest = {first.topic: first}
    until_s = time.monotonic() + GATHER_S
    while (left_s := until_s - time.monotonic()) > 0.0 and (message := subscriber.receive(left_s)) is not None:
        newest[message.topic] = message
    return newest


def _show_once(newest: dict[str, Message], as_json: bool) -> None:
    if as_json:
        for topic in sorted(newest):
            print(_json_line(newest[topic]))
        return
    view = LiveView()
    for message in newest.values():
        view.update(message.topic, message.raw)
    print_view(view)


def print_view(view: LiveView, columns: int | None = None) -> None:
    """Print a view once, as wide as the terminal where standard output is one, or in ``columns``."""
    for line in view.render(terminal_of(sys.stdout, columns or size_of(sys.stdout).columns, UNCUT)):
        print(line)


def _print_json(subscriber: Subscriber, first: Message) -> None:
    for message in itertools.chain([first], iter(subscriber.receive, None)):
        _print_gaps(message)
        print(_json_line(message), flush=True)


def _json_line(message: Message) -> str:
    return json.dumps({"topic": message.topic, **message.raw}, default=bytes.hex)


def _follow(subscriber: Subscriber, first: Message) -> None:
    with Display() as display:
        display.add(first)
        while True:
            display.refresh(subscriber.age_s or 0.0)
            if display.redraws:
                time.sleep(display.wait_s())
                for message in subscriber.newest():
                    display.add(message)
            elif (one := subscriber.receive(display.wait_s())) is not None:
                _print_gaps(one)
                display.add(one)


class Display:
    """The live view on standard output: redrawn in place on a terminal, else a line per change and one per second.

    Use it in a ``with`` statement: its end gives the terminal back, with the last view below what was there before.

    Attributes:
        redraws: Standard output is a terminal with a movable cursor.
    """

    def __init__(self) -> None:
        self.redraws = is_screen(sys.stdout)
        self._view = LiveView()
        self._period_s = REDRAW_S if self.redraws else LINE_S
        self._due_s = time.monotonic()
        self._screen = TerminalScreen(sys.stdout) if self.redraws else None
        self._silent_s = 0.0

    def __enter__(self) -> Display:
        if self._screen is not None:
            self._screen.__enter__()
        return self

    def __exit__(self, *failure: object) -> None:
        if self._screen is None:
            return
        self._screen.__exit__(*failure)
        with contextlib.suppress(OSError):  # the terminal is gone
            for line in self._lines():
                print(line)
            sys.stdout.flush()

    def add(self, message: Message) -> None:
        """Add a message; without a terminal a change of level is printed at once."""
        if message.topic == WARNING_TOPIC and not self.redraws:
            print(change_line(message.raw), flush=True)
        self._view.update(message.topic, message.raw)

    def wait_s(self) -> float:
        """Return the time until `refresh` has something to do, s."""
        return max(0.0, self._due_s - time.monotonic())

    def refresh(self, silent_s: float) -> None:
        """Redraw or print, if it is time to; ``silent_s`` is the time since the last message."""
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + self._period_s
        self._silent_s = silent_s
        if self._screen is not None:
            self._screen.draw(self._lines(), size_of(sys.stdout))
        elif silent_s > LINE_S:
            print(f"no message for {silent_s:.1f} s", flush=True)
        else:
            print(self._view.summary(), flush=True)

    def _lines(self) -> list[str]:
        return self._view.render(terminal_of(sys.stdout, *size_of(sys.stdout)), self._silent_s)


def _print_gaps(message: Message) -> None:
    if message.restarted:
        print("slipctl: the daemon was restarted", file=sys.stderr)
    if message.missed:
        print(f"slipctl: {message.missed} messages of {plain(message.topic)} were missed", file=sys.stderr)


WIDEST = 100
"""Columns of the longest line of a status for people, on a wide terminal and in a file."""


def show_status(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out ``slipctl status``."""
    with GripClient(chosen.requests, keys=keys) as client:
        print_status(client.status(), as_json=chosen.json)


def print_status(status: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a reply; as JSON, it has the list of repairs beside the fields of the reply."""
    if as_json:
        print(json.dumps({**status, "repairs": [repair.as_map() for repair in repairs(status)]}))
        return
    view = LiveView()
    view.update(STATUS_TOPIC, {**status})
    print_view(view, min(size_of(sys.stdout).columns, WIDEST))
