"""Requests and their replies: what both grip clients send, and in which order.

The blocking and the asyncio client only wait in their own ways, so every rule is written once.
"""

from __future__ import annotations

import abc
import itertools
import math
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zmq

from slipd_client.clock import ServerClock
from slipd_client.errors import CallError, MessageError, NoAnswer, RequestRefused, TareGivenUp, check_seconds
from slipd_client.keys import Keys
from slipd_client.lease_keeper import LeaseKeeper
from slipd_client.link import Link, Steps
from slipd_client.messages import MESSAGE_LIMITS, PROTOCOL_VERSION, TARE_REASONS, decode, encode, request_limits
from slipd_client.messages.ops import OPS
from slipd_client.messages.replies import HelloReply, Reply, TareBegun, TareReply, TareResult, typed_reply
from slipd_client.messages.request_fields import TARE_S
from slipd_client.paths import hint_for, requests_endpoint

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


class RequestProtocol(abc.ABC):
    """One client's requests to one daemon; arguments and attributes as of `GripClientBase`."""

    _lock: Callable[[], Any]
    """Makes the lock whose holder sends the next request."""

    _now_ns = staticmethod(time.monotonic_ns)

    def __init__(self, endpoint: str | None = None, *, keys: Keys | None = None, timeout_s: float = TIMEOUT_S) -> None:
        check_seconds("timeout_s", timeout_s, TIMEOUT_S)
        self.timeout_s = timeout_s
        self.endpoint = requests_endpoint() if endpoint is None else endpoint
        self.clock = ServerClock()
        # IMMEDIATE: without it ZeroMQ keeps a request for a daemon that starts later, and delivers it then
        self._link = Link(zmq.DEALER, self.endpoint, keys, {zmq.IMMEDIATE: 1})
        self._turn = self._lock()
        self._lease: LeaseKeeper | None = None
        self._lease_slot = threading.Lock()
        self._boot: str | None = None  # the daemon's run, once ``hello`` was answered
        # when the newest request for the client's own lease left; no greeting before it counts
        self._lease_asked_ns = 0
        self._unreadable = ""
        self._prefix = os.urandom(8).hex()
        self._numbers = itertools.count(1)

    @abc.abstractmethod
    async def _take_turn(self, timeout_s: float) -> float:
        """Take the lock `_turn`; return until when the reply is waited for, on ``time.monotonic``."""

    @abc.abstractmethod
    async def _frames(self, until: float | None) -> list[bytes] | None:
        """Wait for a message; None where none came."""

    @abc.abstractmethod
    async def _writable(self, until: float) -> bool:
        """Wait for a peer to send to; return whether there may be one."""

    @abc.abstractmethod
    async def _sleep(self, seconds: float) -> None:
        """Let time pass."""

    def _check(self, op: str) -> None:
        """Raise where the calling thread or task may not send ``op`` now, because of the lease of this client."""
        lease = self._lease
        if lease is not None:
            lease.check_op(op)

    def _request(self, op: str, /, **fields: Any) -> Steps[Any]:
        """Send one request; fields that are None are left out."""
        return self._request_exactly(op, {name: each for name, each in fields.items() if each is not None})

    async def _request_exactly(self, op: str, fields: dict[str, Any]) -> Any:
        """Send one request with exactly these fields."""
        lease = self._lease
        self._check(op)
        try:
            return await self._ask(Ask(op, fields))
        except RequestRefused as refusal:
            if lease is not None and refusal.code in ("no_lease", "wrong_boot"):
                lease.lose(str(refusal))
            raise

    async def _greet(self) -> HelloReply:
        """Ask for the daemon's run and clock, again while the line was too slow to bound the clock well."""
        for _ in range(GREETINGS):
            result = await self._exchange(Ask("hello", {}))
            try:
                reply = typed_reply(HelloReply, result)
            except MessageError as mismatch:
                raise NoAnswer(f"{self.endpoint} answers hello, but {mismatch.message}: is this slipd?") from mismatch
            self._boot = reply.boot
            if self._error_ns() <= GOOD_ERROR_NS:
                break
        return reply

    async def _ask(self, ask: Ask) -> Any:
        """Send one request, after ``hello`` where run or clock are not known; return the reply as the op's class.

        A clock that is read again never redirects a request to a restarted daemon. That request is refused, so that the
        program learns of the restart; the next request greets the new daemon.
        """
        boot = self._boot
        if boot is None or self._error_ns() > DEADLINE_NS // 2:
            await self._greet()
        if boot is not None:
            self._boot = boot
        try:
            result = await self._exchange(ask)
        except RequestRefused as refusal:
            if refusal.code in ("wrong_boot", "deadline_passed", "deadline_too_far"):
                self._boot = None  # what hello returned is out of date
                self.clock.forget()
            raise
        try:
            return typed_reply(OPS[ask.op].reply if ask.op in OPS else Reply, result)
        except MessageError as mismatch:
            raise NoAnswer(f"{self.endpoint} carried out {ask.op}, but in its reply {mismatch.message}") from mismatch

    async def _exchange(self, ask: Ask) -> dict[str, Any]:
        """Send a request when its turn has come, and return the result of its reply."""
        timeout_s = self.timeout_s if ask.timeout_s is None else ask.timeout_s
        until = await self._take_turn(timeout_s)
        try:
            number = f"{self._prefix}-{next(self._numbers)}"
            sent_ns = await self._send(ask, number, until)
            while (frames := await self._frames(until)) is not None:
                if (result := self._result(number, sent_ns, frames)) is not None:
                    return result
        finally:
            self._turn.release()
        raise NoAnswer(
            f"no answer from {self.endpoint} within {timeout_s:.2g} s; the request may or may not have been carried out"
            f"{self._unreadable}"
        )

    async def _send(self, ask: Ask, number: str, until: float) -> int:
        """Send a request under this id; return when it left, CLOCK_MONOTONIC."""
        while True:
            sent_ns = self._now_ns()
            if self._link.send(self._packed(ask, number, sent_ns)):
                return sent_ns
            if not await self._writable(until):
                where = self.endpoint
                raise NoAnswer(f"nobody accepts requests at {where}; nothing was sent. {hint_for(where)}")

    async def _tare(self, finger: str, seconds: float, stream: str | None, *, unloaded: bool) -> TareResult:
        """Start a tare of one stream, or of "all", and wait until it is taken."""
        check_seconds("seconds", seconds, TARE_S)
        begun: TareBegun = await self._request(
            "tare", finger=finger, seconds=seconds, stream=stream, unloaded=unloaded or None
        )
        until_ns = self._now_ns() + int((seconds + self.timeout_s) * 1e9)
        verified = {"verified": begun.verified}
        if stream != "all" or not begun.tare_ids:
            tare = await self._wait_for_tare(finger, stream, begun.tare_id, until_ns)
            return TareResult(tare | verified, finger, begun.verified, {tare.stream or "": tare})
        tares = {
            kind: await self._wait_for_tare(finger, kind, before, until_ns) for kind, before in begun.tare_ids.items()
        }
        return TareResult({"finger": finger, "streams": tares} | verified, finger, begun.verified, tares)

    async def _wait_for_tare(self, finger: str, stream: str | None, before: int | None, until_ns: int) -> TareReply:
        """Wait until the tare after ``before`` is taken."""
        what = f"{finger} {stream or ''}".rstrip()
        while True:
            tare: TareReply = await self._request("tare.get", finger=finger, stream=stream)
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

    def _packed(self, ask: Ask, number: str, now_ns: int) -> bytes:
        """Return the bytes of a request that leaves now.

        Raises:
            MessageError: The fields make no acceptable message (NaN, a string that is too long).
            CallError: A field is of a type that no message can carry, e.g. a NumPy array.
            NoAnswer: The daemon's clock became unknown, so there is no deadline to send.
            LeaseInUse, LeaseLost: The lease changed hands, or was lost, while the request waited for its turn.
        """
        if not ask.unchecked:
            self._check(ask.op)
        body: dict[str, Any] = {"v": PROTOCOL_VERSION, "id": number, "op": ask.op}
        if ask.op != "hello":
            earliest_ns = self.clock.earliest_ns(now_ns)
            if earliest_ns is None:
                raise NoAnswer(f"the clock of {self.endpoint} is no longer known; nothing was sent")
            body |= {"boot": self._boot, "deadline_ns": earliest_ns + DEADLINE_NS}
        data = _encoded(body, ask)
        decode(data, request_limits(data))
        if ask.unchecked:
            self._lease_asked_ns = now_ns
        return data

    def _result(self, number: str, sent_ns: int, frames: list[bytes]) -> dict[str, Any] | None:
        """Return the result in the reply to this request; None for the reply to an earlier one, or an unreadable one.

        Raises:
            RequestRefused: The reply is a refusal.
        """
        try:
            reply = decode(b"".join(frames), MESSAGE_LIMITS)
        except MessageError as error:
            self._unreadable = f"; a reply could not be read: {error}"
            return None
        if reply.get("id") != number:
            return None
        self._unreadable = ""
        t_ns = reply.get("t_ns")
        result, fault = reply.get("result"), reply.get("error")
        if type(t_ns) is not int and type(result) is dict:
            t_ns = result.get("t_ns")
        if type(t_ns) is int:
            self.clock.observe(sent_ns, self._now_ns(), t_ns)
        if reply.get("ok") is True and type(result) is dict:
            return result
        if type(fault) is not dict:
            fault = {"code": "malformed", "message": "the reply has neither a result nor an error"}
        raise RequestRefused(
            str(fault.get("code")), str(fault.get("message") or "no reason given"), str(fault.get("field") or "")
        )

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
