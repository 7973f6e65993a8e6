"""``slipctl watch``: shows messages as they arrive, for a person, a log or another program."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from typing import TYPE_CHECKING, TextIO

from slipd_client.errors import Silence, hint_for
from slipd_client.live_view import UNCUT, LiveView, change_line
from slipd_client.messages import GRIPPER_TOPIC, STATUS_TOPIC, WARNING_TOPIC
from slipd_client.subscriber import Message, Subscriber

if TYPE_CHECKING:
    from slipd_client.keys import Keys

TOPICS = ("slip", GRIPPER_TOPIC, WARNING_TOPIC, STATUS_TOPIC)
"""What is drawn; forces and pad images arrive faster than anyone can read."""

FIRST_S = 3.0
"""How long to wait for the first message: the daemon publishes ``status`` every second."""

GATHER_S = 0.8
"""The daemon sends the last message of every topic to a new subscriber, of quiet topics after half a second."""

REDRAW_S = 0.1
LINE_S = 1.0


def watch(endpoint: str | None, *, keys: Keys | None = None, as_json: bool, once: bool) -> None:
    """Show messages on standard output until interrupted, or only the last of each topic with ``once``.

    Raises:
        Silence: No message came within ``FIRST_S``.
        CallError: ``endpoint`` is not a ZeroMQ endpoint.
    """
    with Subscriber(endpoint, ("",) if as_json else TOPICS, keys=keys, silence_s=None) as subscriber:
        first = subscriber.receive(FIRST_S)
        if first is None:
            unreadable = f"; {subscriber.bad} unreadable, the last: {subscriber.bad_reason}" if subscriber.bad else ""
            where = subscriber.endpoint
            raise Silence(f"no message from {where} within {FIRST_S} s{unreadable}. {hint_for(where)}")
        if once:
            _show_once(_gather(subscriber, first), as_json)
        elif as_json:
            _print_json(subscriber, first)
        else:
            _follow(subscriber, first)


def _gather(subscriber: Subscriber, first: Message) -> dict[str, Message]:
    """Return the newest message of every topic."""
    newest = {first.topic: first}
    until = time.monotonic() + GATHER_S
    while (message := subscriber.receive(max(0.0, until - time.monotonic()))) is not None:
        if message.topic not in newest:
            until = time.monotonic() + GATHER_S
        newest[message.topic] = message
        if time.monotonic() > until:
            break
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


def print_view(view: LiveView) -> None:
    """Print a view once, cut to the width of the terminal where standard output is one."""
    for line in view.render(_size(sys.stdout).columns, _colour(sys.stdout)):
        print(line)


def _print_json(subscriber: Subscriber, first: Message) -> None:
    _print_json_line(first)
    for message in subscriber:
        _print_json_line(message)


def _print_json_line(message: Message) -> None:
    _print_gaps(message)
    print(_json_line(message), flush=True)


def _json_line(message: Message) -> str:
    return json.dumps({"topic": message.topic, **message.raw}, default=bytes.hex)


def _follow(subscriber: Subscriber, first: Message) -> None:
    display = Display()
    message: Message | None = first
    while True:
        if message is not None:
            if not display.redraws:
                _print_gaps(message)
            display.add(message)
        display.refresh(subscriber.age_s or 0.0)
        message = subscriber.receive(display.wait_s())


class Display:
    """The live view on standard output: redrawn in place on a terminal, else a line per change and one per second.

    Attributes:
        redraws: Standard output is a terminal with a movable cursor.
    """

    def __init__(self) -> None:
        self.redraws = sys.stdout.isatty() and not _dumb()
        self._view = LiveView()
        self._drawn = 0
        self._period_s = REDRAW_S if self.redraws else LINE_S
        self._due_s = time.monotonic()

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
        if self.redraws:
            size = _size(sys.stdout)
            lines = self._view.render(size.columns, _colour(sys.stdout), silent_s, size.lines - 1)
            back = f"\x1b[{self._drawn}F" if self._drawn else ""
            print(back + "\x1b[J" + "\n".join(lines), flush=True)
            self._drawn = len(lines)
        else:
            print(f"no message for {silent_s:.1f} s" if silent_s > LINE_S else self._view.summary(), flush=True)


def _print_gaps(message: Message) -> None:
    if message.restarted:
        print("slipctl: the daemon was restarted", file=sys.stderr)
    if message.missed:
        print(f"slipctl: {message.missed} messages of {message.topic} were missed", file=sys.stderr)


def _size(stream: TextIO) -> os.terminal_size:
    if not stream.isatty():
        return os.terminal_size((UNCUT, UNCUT))
    size = shutil.get_terminal_size()
    return os.terminal_size((size.columns or 80, size.lines or 24))  # a serial console reports 0


def _colour(stream: TextIO) -> bool:
    return stream.isatty() and not os.environ.get("NO_COLOR") and not _dumb()


def _dumb() -> bool:
    """Return whether the terminal knows no escape sequences, by TERM."""
    return os.environ.get("TERM") == "dumb"
