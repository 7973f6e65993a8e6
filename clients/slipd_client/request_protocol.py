"""Requests and their replies without a socket: what both grip clients send, and in which order.

The blocking and the asyncio client exchange each request in their own way, so every rule is written once.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from slipd_client.clock import ServerClock
from slipd_client.errors import CallError, MessageError, NoAnswer, RequestRefused, TareGivenUp, check_seconds
from slipd_client.link import Steps
from slipd_client.messages import MESSAGE_LIMITS, PROTOCOL_VERSION, TARE_REASONS, decode, encode, request_limits
from slipd_client.messages.schema.kinds import Mismatch
from slipd_client.messages.schema.ops import OPS
from slipd_client.messages.schema.replies import HelloReply, Reply, TareBegun, TareReply, TareResult, typed_reply
from slipd_client.messages.schema.request_fields import TARE_S
from slipd_client.paths import hint_for

TIMEOUT_S = 1.0
"""Twice the longest deadline that a daemon accepts: no reply after that can mean that the request is still pending."""

DEADLINE_NS = 250_000_000
"""How far ahead a deadline lies: half of what a daemon accepts, so that the clocks may differ by as much."""

GOOD_ERROR_NS = 25_000_000
"""A tenth of the deadline: wanted accuracy of the daemon's clock."""

GREETINGS = 4
"""Number of requests for the clock on a slow line; the quickest answer bounds it best."""

TARE_POLL_S = 0.05
"""Time between two requests for the state of a tare."""

Result = dict[str, Any]
"""The ``result`` of a reply."""


@dataclass(frozen=True)
class Ask:
    """A request.

    Attributes:
        op: Its operation.
        fields: Its fields.
        timeout_s: How long to wait for its reply; None: as long as the client waits for any.
        unchecked: The client sends it for its own lease, which needs no check.
    """

    op: str
    fields: dict[str, Any]
    timeout_s: float | None = None
    unchecked: bool = False


@dataclass(frozen=True)
class Envelope:
    """A packed request: its id, when it left (CLOCK_MONOTONIC), and its bytes."""

    number: str
    sent_ns: int
    data: bytes


class RequestProtocol:
    """One client's requests to one daemon.

    Args:
        endpoint: Where they go, for errors.
        now_ns: CLOCK_MONOTONIC.
        check: Raises where the calling thread or task may not send an op now, see `LeaseKeeper.check_op`.
        exchange: Sends a request, and returns the result of its reply.
        sleep: Lets some seconds pass.

    Attributes:
        clock: The daemon's clock.
        boot: The daemon's run; None until ``hello`` was answered.
        lease_asked_ns: When the newest request for the client's own lease left; no greeting before it counts.
    """

    def __init__(
        self,
        endpoint: str,
        now_ns: Callable[[], int],
        check: Callable[[str], None],
        exchange: Callable[[Ask], Steps[Result]],
        sleep: Callable[[float], Steps[None]],
    ) -> None:
        self.endpoint = endpoint
        self.clock = ServerClock()
        self.boot: str | None = None
        self.lease_asked_ns = 0
        self._now_ns, self._check, self._exchange, self._sleep = now_ns, check, exchange, sleep
        self._unreadable = ""
        self._prefix = os.urandom(8).hex()
        self._numbers = itertools.count(1)

    async def hello(self) -> HelloReply:
        """Ask for the daemon's run and clock, again while the line was too slow to bound the clock well."""
        for _ in range(GREETINGS):
            result = await self._exchange(Ask("hello", {}))
            try:
                reply = typed_reply(HelloReply, result)
            except Mismatch as mismatch:
                raise NoAnswer(
                    f"{self.endpoint} answers hello, but {mismatch.path} {mismatch.rule}: is this slipd?"
                ) from mismatch
            self.boot = reply.boot
            if self._error_ns() <= GOOD_ERROR_NS:
                break
        return reply

    async def request(self, op: str, fields: dict[str, Any]) -> Any:
        """Send one request, after ``hello`` where run or clock are not known; return the reply as the op's class."""
        self._check(op)
        return await self._request(Ask(op, fields))

    async def lease(self, op: str, fields: dict[str, Any], timeout_s: float | None = None) -> Any:
        """Send a request for the client's own lease: to acquire it, renew it or give it back."""
        return await self._request(Ask(op, fields, timeout_s, unchecked=True))

    async def _request(self, ask: Ask) -> Any:
        """Send one request.

        A clock that is read again never redirects a request to a restarted daemon. That request is refused, so that the
        program learns of the restart; the next request greets the new daemon.
        """
        boot = self.boot
        if boot is None or self._error_ns() > DEADLINE_NS // 2:
            await self.hello()
        if boot is not None:
            self.boot = boot
        try:
            result = await self._exchange(ask)
        except RequestRefused as refusal:
            if refusal.code in ("wrong_boot", "deadline_passed", "deadline_too_far"):
                self.boot = None  # what hello returned is out of date
                self.clock.forget()
            raise
        try:
            return typed_reply(OPS[ask.op].reply if ask.op in OPS else Reply, result)
        except Mismatch as mismatch:
            raise NoAnswer(
                f"{self.endpoint} carried out {ask.op}, but in its reply {mismatch.path} {mismatch.rule}"
            ) from mismatch

    async def tare(
        self, finger: str, seconds: float, timeout_s: float, stream: str | None = None, *, unloaded: bool = False
    ) -> TareResult:
        """Start a tare of one stream, or of "all", and wait until it is taken."""
        check_seconds("seconds", seconds, TARE_S)
        named = {} if stream is None else {"stream": stream}
        confirmed = {"unloaded": True} if unloaded else {}
        begun: TareBegun = await self.request("tare", {"finger": finger, "seconds": seconds} | named | confirmed)
        until_ns = self._now_ns() + int((seconds + timeout_s) * 1e9)
        verified = {"verified": begun.verified}
        if stream != "all" or not begun.tare_ids:
            tare = await self._wait_for_tare({"finger": finger} | named, begun.tare_id, until_ns)
            return TareResult(tare | verified, finger, begun.verified, {tare.stream or "": tare})
        tares = {}
        for kind, before in begun.tare_ids.items():
            tares[kind] = await self._wait_for_tare({"finger": finger, "stream": kind}, before, until_ns)
        return TareResult({"finger": finger, "streams": tares} | verified, finger, begun.verified, tares)

    async def _wait_for_tare(self, fields: dict[str, str], before: int | None, until_ns: int) -> TareReply:
        """Wait until the tare after ``before`` is taken."""
        what = " ".join(fields.values())
        while True:
            tare: TareReply = await self.request("tare.get", fields)
            if not tare.busy:
                break
            if self._now_ns() > until_ns:
                raise NoAnswer(f"the tare of {what} was not taken in time: too few readings arrive")
            await self._sleep(TARE_POLL_S)
        if tare.tare_id != before:
            return tare
        if tare.given_up is None:  # neither taken nor given up: only tare.undo leaves that behind
            raise TareGivenUp("undone", f"the tare of {what} was given up: {TARE_REASONS['undone'].replace('`', '')}")
        raise TareGivenUp(tare.given_up_reason or "", f"the tare of {what} was given up: {tare.given_up}")

    def pack(self, ask: Ask) -> Envelope:
        """Return a request as it leaves now.

        Raises:
            MessageError: The fields make no acceptable message (NaN, a string that is too long).
            CallError: A field is of a type that no message can carry, e.g. a NumPy array.
            NoAnswer: The daemon's clock became unknown, so there is no deadline to send.
            LeaseInUse, LeaseLost: The lease changed hands, or was lost, while the request waited for its turn.
        """
        if not ask.unchecked:
            self._check(ask.op)
        number = f"{self._prefix}-{next(self._numbers)}"
        now_ns = self._now_ns()
        body: dict[str, Any] = {"v": PROTOCOL_VERSION, "id": number, "op": ask.op}
        if ask.op != "hello":
            earliest_ns = self.clock.earliest_ns(now_ns)
            if earliest_ns is None:
                raise NoAnswer(f"the clock of {self.endpoint} is no longer known; nothing was sent")
            body |= {"boot": self.boot, "deadline_ns": earliest_ns + DEADLINE_NS}
        data = _encoded(body, ask)
        decode(data, request_limits(data))
        if ask.unchecked:
            self.lease_asked_ns = now_ns
        return Envelope(number, now_ns, data)

    def result(self, envelope: Envelope, frames: list[bytes]) -> Result | None:
        """Return the result in the reply to a request; None for the reply to an earlier one, or an unreadable one.

        Raises:
            RequestRefused: The reply is a refusal.
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
            self.clock.observe(envelope.sent_ns, self._now_ns(), t_ns)
        if reply.get("ok") is True and type(result) is dict:
            return result
        if type(fault) is not dict:
            fault = {"code": "malformed", "message": "the reply has neither a result nor an error"}
        raise RequestRefused(
            str(fault.get("code")), str(fault.get("message") or "no reason given"), str(fault.get("field") or "")
        )

    def no_listener(self) -> NoAnswer:
        """Return the error of a request that nobody was there to receive."""
        return NoAnswer(f"nobody accepts requests at {self.endpoint}; nothing was sent. {hint_for(self.endpoint)}")

    def no_reply(self, timeout_s: float) -> NoAnswer:
        """Return the error of a request that was sent and not answered."""
        text = (
            f"no answer from {self.endpoint} within {timeout_s:g} s; the request may or may not have been carried out"
        )
        return NoAnswer(text + self._unreadable)

    def _error_ns(self) -> float:
        error_ns = self.clock.error_ns(self._now_ns())
        return math.inf if error_ns is None else error_ns


def _encoded(body: dict[str, Any], ask: Ask) -> bytes:
    """Return the bytes of a request; CallError names the field that cannot be packed."""
    try:
        return encode(body | ask.fields)
    except (TypeError, ValueError, OverflowError) as error:
        for name, value in ask.fields.items():
            try:
                encode({name: value})
            except (TypeError, ValueError, OverflowError):
                raise CallError(
                    f"{name} of {ask.op} must be a plain number, boolean, string or list of these, got {value!r:.60} "
                    f"({error}); float() and .tolist() convert NumPy values"
                ) from error
        raise
