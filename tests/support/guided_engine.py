"""A host of ``slipd commission`` without a terminal: the guide, the real engine on emulated devices, and a person."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from commission_person import ANSWERS, PULLS, TOUCHES, touch_for
from emulated_engine import EmulatedEngine

from slipd import config
from slipd.tools.commission.config_update import changed_text
from slipd.tools.commission.dialogue import (
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
)
from slipd_client.errors import RequestRefused
from slipd_client.messages.replies import TareReply

OPS = {"gripper_close": "gripper.close", "gripper_open": "gripper.open", "gripper_activate": "gripper.activate"}
GRAVITY_S = 0.1
MESSAGES = 50
"""Between two questions whether a tare is taken: the daemon answers 50 requests a second."""


@dataclass
class GuidedEngine:
    """Answers the guide as a person does who follows it.

    Attributes:
        engine: The daemon.
        text: Its config.
        touches: See `commission_person.TOUCHES`.
        answers: See `commission_person.ANSWERS`; a step that is missing is left out.
        then: Words of a line or step, and the answers from there on, in their order.
        refused: Why a tare is refused; "": it is not.
        write: Changes are written, and the daemon runs them at once.
        printed: Every line for the person.
        asked: Every request.
    """

    engine: EmulatedEngine
    text: str
    touches: Mapping[str, str] = field(default_factory=lambda: TOUCHES)
    answers: Mapping[str, tuple[str, str]] = field(default_factory=lambda: ANSWERS)
    then: list[tuple[str, Mapping[str, tuple[str, str]]]] = field(default_factory=list)
    refused: str = ""
    write: bool = True
    printed: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    _choices: list[Choice] = field(default_factory=list)
    _down: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    _told_ns: int = 0

    def respond(self, output: Output) -> Event:
        """Carry out one output of the guide."""
        if isinstance(output, (Say, Prompt)):
            self._show(output)
        elif isinstance(output, Ask):
            return self._ask(output)
        elif isinstance(output, Gravity):
            self._down = output.by_finger
        elif isinstance(output, Change):
            return self._change(output)
        else:
            return self._choices.pop() if self._choices else self._message()
        return None

    def _show(self, shown: Say | Prompt) -> None:
        self.printed.append(shown.text)
        if self.then and self.then[0][0] in f"{shown.text} [{getattr(shown, 'step', '')}]":
            _, self.answers = self.then.pop(0)
        if (touch := touch_for(shown.text, self.touches)) is not None:
            self.engine.touch(touch)
        if isinstance(shown, Prompt) and len(shown.choices) > 1:
            does, word = self.answers.get(shown.step, ("", "skip"))
            if does:
                self.engine.touch(does)
            self._choices.append(Choice(word))
        for words, does in PULLS.items():
            if shown.text.startswith(words):
                self.engine.touch(does)

    def _message(self) -> Event:
        message = self.engine.receive()
        if self._down and message.t_ns - self._told_ns > GRAVITY_S * 1e9:
            self._told_ns = message.t_ns
            for finger, gravity in self._down.items():
                self.engine.ask("gravity.set", finger=finger, gravity_mps2=list(gravity))
        return message

    def _ask(self, ask: Ask) -> Reply | Refusal:
        op = OPS.get(ask.method, ask.method)
        self.asked.append(op)
        if op == "tare" and self.refused:
            return Refusal(self.refused)
        try:
            if ask.lease:
                self.engine.ask("lease.acquire", ttl_ms=200)
            result = self.engine.ask(op, **ask.fields)
            while op == "tare" and (state := self._tare(ask)).busy:
                for _ in range(MESSAGES):
                    self._message()
            if op == "tare" and state.given_up is not None:
                return Refusal(state.given_up)
        except RequestRefused as error:
            return Refusal(str(error))
        finally:
            self.engine.drop_messages()
        return Reply(result)

    def _tare(self, ask: Ask) -> TareReply:
        reply = self.engine.ask("tare.get", finger=ask.fields["finger"], stream=ask.fields["stream"])
        assert isinstance(reply, TareReply)
        return reply

    def _change(self, change: Change) -> Reply:
        text = changed_text(self.text, change.values)
        if not self.write:
            return Reply(None)
        self.text = text
        self.engine.restart(config.parse(text, "new config"))
        self.engine.drop_messages()
        return Reply(text)
