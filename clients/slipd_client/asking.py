"""Requests and their replies, without a socket: what both grip clients do, and in which order.

What takes several requests is a generator that yields each step and is handed its result. A shell, blocking or
asyncio, carries the steps out; so every rule stands once.
"""

from __future__ import annotations

import itertools
import math
import uuid
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, Union

from slipd_client.clock import ServerClock
from slipd_client.errors import NoAnswer, RequestRefused, is_it_there
from slipd_client.messages import MESSAGE_LIMITS, PROTOCOL_VERSION, MessageError, decode, encode

TIMEOUT_S = 1.0
"""Twice the longest deadline a daemon accepts: after that no reply can still mean that it will be done."""

DEADLINE_NS = 250_000_000
"""How far ahead a deadline lies: half of what a daemon accepts, so that the clocks may differ by as much."""

GOOD_ERROR_NS = 25_000_000
"""A tenth of the deadline: as well as the daemon's clock should be known."""

GREETINGS = 4
"""How often to ask for the clock on a slow line; the quickest answer tells most."""

TARE_S = 0.5
"""Long enough for the noise of a force sensor, short enough for a finger to stay untouched."""

TARE_LOOK_S = 0.05
"""How often to ask whether a tare is taken."""

Result = dict[str, Any]
"""The ``result`` of a reply."""


@dataclass(frozen=True)
class Ask:
    """A step: send this request, and hand back its result."""

    op: str
    fields: dict[str, Any]
    timeout_s: float | None = None


@dataclass(frozen=True)
class Pause:
    """A step: let some time pass."""

    seconds: float


Steps = Generator[Union[Ask, Pause], Result, Result]


class Asking:
    """One client's requests to one daemon.

    Args:
        endpoint: Where they go, for what people read.
        now_ns: CLOCK_MONOTONIC.

    Attributes:
        clock: The daemon's clock.
        boot: The daemon's run; None while it must be asked for.
    """

    def __init__(self, endpoint: str, now_ns: Callable[[], int]) -> None:
        self.endpoint = endpoint
        self.clock = ServerClock()
        self.boot: str | None = None
        self._now_ns = now_ns
        self._unreadable = ""
        self._prefix = uuid.uuid4().hex[:16]
        self._numbers = itertools.count(1)

    def hello(self) -> Steps:
        """Learn the daemon's run and clock; asked anew while the line was too slow to tell the clock well."""
        for _ in range(GREETINGS):
            result = yield Ask("hello", {})
            boot = result.get("boot")
            if type(boot) is not str or type(result.get("t_ns")) is not int:
                raise NoAnswer(f"{self.endpoint} answers hello without boot and t_ns: is this slipd?")
            self.boot = boot
            if self._error_ns() <= GOOD_ERROR_NS:
                break
        return result

    def request(self, op: str, fields: dict[str, Any], timeout_s: float | None = None) -> Steps:
        """One request, behind a greeting where one is due.

        Reading the clock anew never turns a request to a restarted daemon: it is refused, so that the program learns
        of the restart, and the next one greets the new daemon.
        """
        boot = self.boot
        if boot is None or self._error_ns() > DEADLINE_NS // 2:
            yield from self.hello()
        if boot is not None:
            self.boot = boot
        try:
            return (yield Ask(op, fields, timeout_s))
        except RequestRefused as refusal:
            if refusal.code in ("wrong_boot", "deadline_passed", "deadline_too_far"):
                self.boot = None  # what hello taught is out of date
                self.clock.forget()
            raise

    def tare(
        self, finger: str, seconds: float, timeout_s: float, stream: str | None = None, *, unloaded: bool = False
    ) -> Steps:
        """Start a tare of one stream, or of "all", and wait until it is done."""
        if not 0 < seconds < math.inf:
            raise ValueError(f"seconds is {seconds}; a tare takes the mean over a positive time, e.g. {TARE_S}")
        named = {} if stream is None else {"stream": stream}
        assurance = {"unloaded": True} if unloaded else {}
        begun = yield from self.request("tare", {"finger": finger, "seconds": seconds} | named | assurance)
        until_ns = self._now_ns() + int((seconds + timeout_s) * 1e9)
        verified = {"verified": begun.get("verified")}
        ids = begun.get("tare_ids")
        if stream != "all" or not isinstance(ids, dict):
            return (yield from self._tare_taken({"finger": finger} | named, begun.get("tare_id"), until_ns)) | verified
        streams = {}
        for kind, before in ids.items():
            streams[kind] = yield from self._tare_taken({"finger": finger, "stream": kind}, before, until_ns)
        return {"finger": finger, "streams": streams} | verified

    def _tare_taken(self, fields: dict[str, Any], before: Any, until_ns: int) -> Steps:
        """Wait until the tare after ``before`` is done."""
        what = " ".join(fields.values())
        while (taken := (yield from self.request("tare.get", fields))).get("busy"):
            if self._now_ns() > until_ns:
                raise NoAnswer(f"the tare of {what} is not taken in time: too few readings come in")
            yield Pause(TARE_LOOK_S)
        if taken.get("tare_id") == before:
            why = taken.get("given_up") or "something pressed meanwhile, or its stream ended"
            raise RequestRefused("in_contact", f"the tare of {what} was given up: {why}", "finger")
        return taken

    def pack(self, ask: Ask) -> Envelope:
        """A request as it leaves now.

        Raises:
            MessageError: The fields make no acceptable message (NaN, a text too long).
        """
        number = f"{self._prefix}-{next(self._numbers)}"
        now_ns = self._now_ns()
        body: dict[str, Any] = {"v": PROTOCOL_VERSION, "id": number, "op": ask.op}
        if ask.op != "hello":
            body |= {"boot": self.boot, "deadline_ns": self.clock.earliest_ns(now_ns) + DEADLINE_NS}
        data = encode(body | ask.fields)
        decode(data)
        return Envelope(number, now_ns, data)

    def result(self, envelope: Envelope, frames: list[bytes]) -> Result | None:
        """The result in the reply to one request; None for the reply to an earlier one, or one that is unreadable.

        Raises:
            RequestRefused: It holds a refusal.
        """
        try:
            reply = decode(b"".join(frames), MESSAGE_LIMITS)
        except MessageError as error:
            self._unreadable = f"; a reply could not be read: {error}"
            return None
        if reply.get("id") != envelope.number:
            return None
        self._unreadable = ""
        t_ns = reply.get("t_ns")
        result, fault = reply.get("result"), reply.get("error")
        if type(t_ns) is not int and type(result) is dict:
            t_ns = result.get("t_ns")
        if type(t_ns) is int:
            self.clock.hear(envelope.sent_ns, self._now_ns(), t_ns)
        if reply.get("ok") is True and type(result) is dict:
            return result
        if type(fault) is not dict:
            fault = {"code": "malformed", "message": "the reply has neither a result nor an error"}
        raise RequestRefused(
            str(fault.get("code")), str(fault.get("message") or "no reason given"), str(fault.get("field") or "")
        )

    def unheard(self) -> NoAnswer:
        """What to raise when nobody is there to send to."""
        return NoAnswer(f"nobody takes requests at {self.endpoint}; nothing was sent. {is_it_there(self.endpoint)}")

    def unanswered(self, timeout_s: float) -> NoAnswer:
        """What to raise when no reply came."""
        text = f"no answer from {self.endpoint} within {timeout_s:g} s; it may or may not have been done"
        return NoAnswer(text + self._unreadable)

    def _error_ns(self) -> float:
        error_ns = self.clock.error_ns(self._now_ns())
        return math.inf if error_ns is None else error_ns


@dataclass(frozen=True)
class Envelope:
    """A packed request: its id, when it left (CLOCK_MONOTONIC), and its bytes."""

    number: str
    sent_ns: int
    data: bytes
