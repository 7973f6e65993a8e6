"""``slipd commission``: run the guide in a terminal, or for the page ``/commission`` of the live view.

The hosts of the guide send its requests, and write what it finds into the config.

The page reads one JSON object a line and writes one word a line. Each object has one key: ``say`` a line for the
person, ``prompt`` what to do now, ``change`` the TOML to be written, which waits for the word "write", and ``live`` the
newest force, N, and torque, N·m, of each finger.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from slipd import config
from slipd.config.config_file import ENCODING
from slipd.errors import SlipdError
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.config_update import changed_text, fragment, replace_config
from slipd.tools.commission.daemon_link import DaemonLink, GravitySender, link_to, reason_of
from slipd.tools.commission.dialogue import (
    SKIP,
    Ask,
    Change,
    Choice,
    Event,
    Gravity,
    Output,
    Prompt,
    Refusal,
    Reply,
    Say,
    follow,
)
from slipd.tools.commission.readings import SILENCE_S
from slipd_client.errors import ClientError, SlipdClientError
from slipd_client.grip import GripClient
from slipd_client.messages.topics import Message, Wrench
from slipd_client.subscriber import Subscriber

TOPICS = ("wrench", "tactile", "slip")
LISTEN_S = 0.1

MOST_EARLY = 1000
"""Most lines that are dropped before a question: input without end must not block the guide."""


class TerminalHost:
    """Answers the guide. Use it in a ``with`` statement.

    Args:
        file: The config.
        text: Its text, as the daemon runs it.
        link: How to reach the daemon.
        write: Write the config; else only print what would change.
    """

    def __init__(self, file: Path, text: str, link: DaemonLink, *, write: bool) -> None:
        self._file, self._text, self._link, self._write = file, text, link, write
        self._gravity = GravitySender(link.requests, link.request_keys)
        self._client = GripClient(link.requests, keys=link.request_keys)
        try:
            self._subscriber = Subscriber(link.publish, TOPICS, keys=link.publish_keys)
        except BaseException:
            self._client.disconnect()
            raise
        self._choices: tuple[str, ...] = (SKIP,)
        self._kept: Path | None = None
        self._typed = b""
        self._ended = False

    def respond(self, output: Output) -> Event:
        """Carry out one output of the guide, and return what happened."""
        if isinstance(output, Say):
            self.say(output.text)
        elif isinstance(output, Prompt):
            self._prompt(output)
        elif isinstance(output, Ask):
            return self._ask(output)
        elif isinstance(output, Gravity):
            self._gravity.start(output.by_finger)
        elif isinstance(output, Change):
            return self._change(output)
        else:
            return self._next()
        return None

    def say(self, text: str) -> None:
        """Show a line."""
        print(text, flush=True)

    def __enter__(self) -> TerminalHost:
        return self

    def __exit__(self, *_: object) -> None:
        self._gravity.stop()
        self._subscriber.close()
        self._client.disconnect()

    def _prompt(self, prompt: Prompt) -> None:
        """Show what to do now, and how the person answers."""
        self._expect(prompt.choices)
        self.say(prompt.text if prompt.choices == (SKIP,) else f"{prompt.text} {_keys_of(prompt)}")

    def _next(self) -> Message | Choice | None:
        """Return the next typed line or message; None if neither comes for SILENCE_S."""
        until_s = time.monotonic() + SILENCE_S
        while time.monotonic() < until_s:
            if (line := self._line()) is not None:
                self._subscriber.newest()  # what arrived before the answer
                return Choice(_word(line, self._choices))
            if self._ended and self._choices[0] != SKIP:
                raise SlipdError("an answer is needed, and the standard input has ended: run it in a terminal")
            if (message := self._subscriber.receive(LISTEN_S)) is not None:
                return message
        return None

    def _expect(self, choices: tuple[str, ...]) -> None:
        """Accept these choices from now on, and drop what was typed before the question."""
        for _ in range(MOST_EARLY):
            if self._line() is None:
                break
        self._typed = b""
        self._choices = choices

    def _line(self) -> str | None:
        """Return a line that was typed, without waiting."""
        while not self._ended and b"\n" not in self._typed and select.select([sys.stdin], [], [], 0.0)[0]:
            data = os.read(sys.stdin.fileno(), 4096)
            self._typed += data
            self._ended = not data
        if b"\n" not in self._typed:
            return None
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace").strip()

    def _ask(self, ask: Ask) -> Reply | Refusal:
        try:
            with self._client.lease() if ask.lease else contextlib.nullcontext():
                return Reply(getattr(self._client, ask.method)(**ask.fields))
        except ClientError as error:
            return Refusal(reason_of(error))
        finally:
            self._subscriber.newest()

    def _change(self, change: Change) -> Reply:
        self.say(f"\n{fragment(change.values)}\n")
        return self._write_change(change)

    def _write_change(self, change: Change) -> Reply:
        file = self._file
        try:
            text = changed_text(self._text, change.values)
            if not self._write:
                self.say(f"{file}: not changed, as asked")
                return Reply(None)
            if file.read_bytes().decode(ENCODING) != self._text:
                raise SlipdError(f"{file}: it was changed meanwhile and is left as it is; put the lines above into it")
            self._kept = replace_config(file, text, keep=self._kept is None)
        except (OSError, ValueError) as error:
            raise SlipdError(f"{file} is left as it was: {error}; put the lines above into it") from error
        self.say(f"{file}: changed; the config before is {self._kept}.")
        self._text = text
        return Reply(text)


def _keys_of(prompt: Prompt) -> str:
    """Return how the person answers: Enter for the first word, the first letter of another, or a text."""
    first, *others = prompt.choices
    letters = "".join(f", {word[0]}: {word}" for word in others)
    typed = f", or type {prompt.free}" if prompt.free else ""
    return f"[Enter: {first}{letters}{typed}]"


def _word(line: str, choices: tuple[str, ...]) -> str:
    """Return the choice that a line abbreviates; any other line is returned unchanged."""
    if not line:
        return choices[0] if choices and choices[0] != SKIP else ""
    return next((word for word in choices if line.lower() in (word, word[0])), line)


BEGIN, WRITE = "begin", "write"

LIVE_S = 0.1
"""Least time between two objects of live readings."""


class PageHost(TerminalHost):
    """Answers the guide, and tells the page; for its arguments see `TerminalHost`."""

    _live: Mapping[str, tuple[Any, Any]] = {}
    _shown_s = 0.0

    def respond(self, output: Output) -> Event:
        """Carry out one output of the guide, and return what happened."""
        event = super().respond(output)
        if isinstance(event, Wrench):
            self._show(event)
        return event

    def wait_for_begin(self) -> bool:
        """Return whether the person begins; until then nothing is asked of the daemon, and nothing changes."""
        text = "The guide takes the zero of the sensors, which must be free, then asks for touches. Nothing moves."
        return self._chosen(Prompt("begin", text, choices=(BEGIN, SKIP))) == BEGIN

    def say(self, text: str) -> None:
        """Show a line."""
        _emit("say", text)

    def _prompt(self, prompt: Prompt) -> None:
        self._expect(prompt.choices)
        _emit("prompt", asdict(prompt))

    def _change(self, change: Change) -> Reply:
        """Write a change once the person agrees."""
        _emit("change", fragment(change.values))
        prompt = Prompt("write", f"Write these lines into {self._file}?", choices=(WRITE, SKIP))
        if self._chosen(prompt) == SKIP:
            self.say("Not written, as you chose.")
            return Reply(None)
        return self._write_change(change)

    def _chosen(self, prompt: Prompt) -> str:
        """Ask, and return the word that the person chooses."""
        self._prompt(prompt)
        while not isinstance(event := self._next(), Choice) or event.word not in prompt.choices:
            pass
        return event.word

    def _show(self, message: Wrench) -> None:
        self._live = {**self._live, message.finger: (message.force_n, message.torque_nm)}
        now_s = time.monotonic()
        if now_s - self._shown_s >= LIVE_S:
            self._shown_s = now_s
            _emit("live", self._live)


def _emit(kind: str, value: Any) -> None:
    print(json.dumps({kind: value}), flush=True)


def commission_command(
    file: Path, fingers: Sequence[str], first: str, patience_s: float, publish: str | None, requests: str | None,
    key: Path | None, server_key: Path | None, *, dry_run: bool, page: bool,
) -> bool:  # fmt: skip
    """Lead a person through the steps, print what they show, and write it.

    Args:
        file: The config that the daemon runs.
        fingers: Names of the fingers; empty: all.
        first: Step to begin with.
        patience_s: How long to wait for each touch, s.
        publish: Where the daemon publishes; None: as the config states.
        requests: Where it accepts requests, likewise.
        key: File with the secret key of this client; None: without keys.
        server_key: File with the public key of the daemon; None: that beside its secret key.
        dry_run: Only print what would change, and move nothing.
        page: Speak with the page ``/commission`` of the live view, not with a person; then nothing moves.

    Returns:
        Whether everything followed.

    Raises:
        ConfigError: The config has faults.
        SlipdError: A finger is unknown, the daemon is silent or runs another config, or nothing was touched.
    """
    rig = config.load(file)
    for name in fingers:
        if name not in rig.finger:
            raise SlipdError(f"--finger must be one of {', '.join(rig.finger)}, got {name!r:.40}")
    link = link_to(rig, publish, requests, key, server_key)
    restart = f"Now restart the daemon: Ctrl-C in its terminal and slipd run {file} again, or systemctl reload slipd."
    guide = Commission(rig, fingers or list(rig.finger), patience_s, restart, moves=not (dry_run or page))
    try:
        with (PageHost if page else TerminalHost)(file, rig.text, link, write=not dry_run) as host:
            if not isinstance(host, PageHost):
                host.say("s and Enter leaves the present step or finger out; Ctrl-C ends the guide.")
            elif not host.wait_for_begin():
                return False
            complete = follow(guide.run(first), host.respond)
            host.say("\nDone." if complete else "\nNot all of it followed; see above.")
    except SlipdClientError as error:
        raise SlipdError(str(error)) from error
    return complete
