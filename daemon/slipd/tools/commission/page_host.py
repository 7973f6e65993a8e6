"""Runs the guide for the page ``/commission`` of the live view: one JSON object a line out, one word a line in.

Each object has one key: ``say`` a line for the person, ``prompt`` what to do now, ``change`` the TOML to be written,
which waits for the word "write", and ``live`` the newest force, N, and torque, N·m, of each finger.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from slipd.tools.commission.config_update import fragment
from slipd.tools.commission.dialogue import SKIP, Change, Choice, Event, Output, Prompt, Written
from slipd.tools.commission.terminal_host import TerminalHost
from slipd_client.messages.schema.topics import Wrench

BEGIN, WRITE = "begin", "write"

LIVE_S = 0.1
"""Least time between two objects of live readings."""


class PageHost(TerminalHost):
    """Answers the guide, and tells the page; for its arguments see `TerminalHost`."""

    _live: Mapping[str, tuple[Any, Any]] = {}
    _shown_s = 0.0

    def respond(self, output: Output) -> Event:
        """Carry out one output of the guide, and return what happened."""
        if isinstance(output, Prompt):
            self._prompt(output)
            return None
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

    def _change(self, change: Change) -> Written:
        """Write a change once the person agrees."""
        _emit("change", fragment(change.values))
        prompt = Prompt("write", f"Write these lines into {self._file}?", choices=(WRITE, SKIP))
        if self._chosen(prompt) == SKIP:
            self.say("Not written, as you chose.")
            return Written(None)
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
