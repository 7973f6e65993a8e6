"""Asks the daemon to act, so that nothing is ever done late, twice, or by a daemon that started later."""

from __future__ import annotations

import contextlib
import itertools
import math
import time
import uuid
from collections.abc import Iterator
from types import TracebackType
from typing import Any

import zmq

from slipd_client.errors import ClientError, NoAnswer, RequestRefused
from slipd_client.link import Link
from slipd_client.messages import MESSAGE_LIMITS, PROTOCOL_VERSION, MessageError, decode, encode
from slipd_client.paths import requests_endpoint

TIMEOUT_S = 1.0
"""Twice the longest deadline a daemon accepts: after that no reply can still mean that it will be done."""

DEADLINE_NS = 250_000_000
"""How far ahead a deadline lies: half of what a daemon accepts, so that the clocks may differ by as much."""

CLOCK_CHECK_NS = 600 * 1_000_000_000
"""How long an estimate of the daemon's clock is used; at 50 ppm two machines part by 30 ms in this time."""

LEASE_MS = 200
"""How long a lease lasts without renewal: so long does the daemon believe that a dead program steers."""

TARE_S = 0.5
"""Long enough for the noise of a force sensor, short enough for a finger to stay untouched."""

TARE_LOOK_S = 0.05
"""How often to ask whether a tare is taken."""


class Requester:
    """Sends requests and waits for their replies; blocking, for one thread, best used in a ``with``.

    Every method raises RequestRefused when the daemon says no, NoAnswer when it says nothing. A request is
    never sent a second time on its own, nor kept for a daemon that is not there yet.

    Args:
        endpoint: Where the daemon takes requests; its default endpoint when None.
        timeout_s: How long to wait for a reply.

    Raises:
        ValueError: The endpoint is none.
    """

    def __init__(self, endpoint: str | None = None, *, timeout_s: float = TIMEOUT_S) -> None:
        self.timeout_s = timeout_s
        self._boot: str | None = None
        self._offset_ns = 0
        self._clock_read_ns = 0
        self._sent_ns = 0
        self._prefix = uuid.uuid4().hex[:16]
        self._numbers = itertools.count(1)
        where = requests_endpoint() if endpoint is None else endpoint
        # IMMEDIATE: without it ZeroMQ keeps a request for a daemon that starts later, and delivers it then
        self._link = Link(zmq.DEALER, where, {zmq.IMMEDIATE: 1})

    @property
    def endpoint(self) -> str:
        """Where the requests go."""
        return self._link.endpoint

    def hello(self) -> dict[str, Any]:
        """Learn which run of the daemon this is and what its clock shows; the first request does this itself.

        The first request after a restart of the daemon is refused ("wrong_boot"), so that a program learns of
        the restart; the next one greets the new daemon.
        """
        result = self._exchange("hello", {})
        received_ns = time.monotonic_ns()
        boot, t_ns = result.get("boot"), result.get("t_ns")
        if type(boot) is not str or type(t_ns) is not int:
            raise NoAnswer(f"{self.endpoint} answers hello without boot and t_ns: is this slipd?")
        self._boot = boot
        self._offset_ns = t_ns - (self._sent_ns + received_ns) // 2
        self._clock_read_ns = received_ns
        return result

    def request(self, op: str, /, **fields: Any) -> dict[str, Any]:
        """Send one request and return its result.

        Raises:
            RequestRefused: The daemon did not do it.
            NoAnswer: No reply came in time.
            MessageError: The fields make no acceptable message (NaN, a text too long); nothing was sent.
        """
        boot = self._boot
        if boot is None or time.monotonic_ns() - self._clock_read_ns > CLOCK_CHECK_NS:
            self.hello()
        if boot is not None:
            self._boot = boot  # reading the clock anew must not turn a request to a restarted daemon
        try:
            return self._exchange(op, fields)
        except RequestRefused as refusal:
            if refusal.code in ("wrong_boot", "deadline_passed", "deadline_too_far"):
                self._boot = None  # what hello taught is out of date
            raise

    def status(self) -> dict[str, Any]:
        """What the daemon, its fingers and its streams are doing: the map of the ``status`` topic."""
        return self.request("status")

    @contextlib.contextmanager
    def lease(self, ttl_ms: int = LEASE_MS) -> Iterator[dict[str, Any]]:
        """Hold the right to move the gripper while the block runs; ``renew`` it well within each ``ttl_ms``.

        Giving it back never moves anything. A lease that cannot be given back ends by itself.
        """
        result = self.request("lease.acquire", ttl_ms=ttl_ms)
        try:
            yield result
        finally:
            with contextlib.suppress(ClientError):
                self.request("lease.release")

    def renew(self) -> dict[str, Any]:
        """Hold the lease for its full time from now."""
        return self.request("lease.renew")

    def grip_set(self, force_n: float) -> dict[str, Any]:
        """Grip with ``force_n``, the normal force on one pad, N."""
        return self.request("grip.set", force_n=force_n)

    def activate(self) -> dict[str, Any]:
        """Make the gripper ready; some open and close fully while they do this."""
        return self.request("gripper.activate")

    def close(self, force_n: float, width_m: float | None = None, speed_mps: float | None = None) -> dict[str, Any]:
        """Close the gripper onto an object; the connection is closed by ``disconnect``.

        Args:
            force_n: Normal force on one pad at which to stop, N.
            width_m: Width between the pads at which to stop, m; None closes until there is contact.
            speed_mps: Speed, m/s; None leaves it to the daemon.
        """
        return self.request("gripper.close", force_n=force_n, **_given(width_m=width_m, speed_mps=speed_mps))

    def open(self, drop: bool = False, width_m: float | None = None, speed_mps: float | None = None) -> dict[str, Any]:
        """Open the gripper.

        Args:
            drop: Open although an object is held, or may be.
            width_m: Width between the pads, m; None opens fully.
            speed_mps: Speed, m/s; None leaves it to the daemon.
        """
        return self.request("gripper.open", **_given(drop=drop or None, width_m=width_m, speed_mps=speed_mps))

    def stop(self) -> dict[str, Any]:
        """Stop the gripper where it is."""
        return self.request("gripper.stop")

    def tare(self, finger: str, seconds: float = TARE_S) -> dict[str, Any]:
        """Take the mean wrench of the next ``seconds`` as zero, and wait until it is taken.

        Returns:
            As ``tare_get``, and ``verified``: whether the daemon knew that nothing touched the finger.

        Raises:
            RequestRefused: Beside the daemon's own refusals: the tare was given up meanwhile.
            ValueError: ``seconds`` is no positive time.
        """
        if not 0 < seconds < math.inf:
            raise ValueError(f"seconds is {seconds}; a tare takes the mean over a positive time, e.g. {TARE_S}")
        begun = self.request("tare", finger=finger, seconds=seconds)
        until = time.monotonic() + seconds + self.timeout_s
        while (taken := self.tare_get(finger)).get("busy"):
            if time.monotonic() > until:
                raise NoAnswer(f"the tare of {finger} is not taken after {seconds} s: too few readings come in")
            time.sleep(TARE_LOOK_S)
        if taken.get("tare_id") == begun.get("tare_id"):
            reason = f"the tare of {finger} was given up: something pressed meanwhile, or its stream ended"
            raise RequestRefused("in_contact", reason, "finger")
        return taken | {"verified": begun.get("verified")}

    def tare_get(self, finger: str) -> dict[str, Any]:
        """The tare in use."""
        return self.request("tare.get", finger=finger)

    def tare_undo(self, finger: str) -> dict[str, Any]:
        """Return to the tare before the last one."""
        return self.request("tare.undo", finger=finger)

    def disconnect(self) -> None:
        """Close the connection; a second call does nothing."""
        self._link.close()

    def __enter__(self) -> Requester:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.disconnect()

    def _exchange(self, op: str, fields: dict[str, Any]) -> dict[str, Any]:
        until = time.monotonic() + self.timeout_s
        if not self._link.wait(zmq.POLLOUT, until):
            raise NoAnswer(f"nobody takes requests at {self.endpoint}; nothing was sent. Is slipd running?")
        number = f"{self._prefix}-{next(self._numbers)}"
        body: dict[str, Any] = {"v": PROTOCOL_VERSION, "id": number, "op": op}
        self._sent_ns = time.monotonic_ns()
        if op != "hello":
            body |= {"boot": self._boot, "deadline_ns": self._sent_ns + self._offset_ns + DEADLINE_NS}
        data = encode(body | fields)
        decode(data)
        try:
            self._link.socket.send(data, zmq.NOBLOCK)
        except zmq.Again:
            raise NoAnswer(f"{self.endpoint} went away; nothing was sent") from None
        return self._result(number, until)

    def _result(self, number: str, until: float) -> dict[str, Any]:
        """Wait for the reply to one request; replies to earlier ones, which came too late, are dropped."""
        why = ""
        while self._link.wait(zmq.POLLIN, until):
            try:
                reply = decode(b"".join(self._link.socket.recv_multipart(zmq.NOBLOCK)), MESSAGE_LIMITS)
            except MessageError as error:
                why = f"; a reply could not be read: {error}"
                continue
            if reply.get("id") == number:
                return _unwrap(reply)
        raise NoAnswer(
            f"no answer from {self.endpoint} within {self.timeout_s} s; it may or may not have been done{why}"
        )


def _given(**fields: Any) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}


def _unwrap(reply: dict[str, Any]) -> dict[str, Any]:
    result, error = reply.get("result"), reply.get("error")
    if reply.get("ok") is True and type(result) is dict:
        return result
    if type(error) is not dict:
        error = {"code": "malformed", "message": "the reply has neither a result nor an error"}
    raise RequestRefused(
        str(error.get("code")), str(error.get("message") or "no reason given"), str(error.get("field") or "")
    )
