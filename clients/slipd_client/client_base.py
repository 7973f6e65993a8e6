"""Every operation of the daemon as a method, written once for the blocking and the asyncio client.

A method is named like its operation, with ``_`` for ``.``; its arguments are the fields of ``docs/protocol.md``, and it
returns the class of the reply in `slipd_client.messages.typed`. Forces are normal forces on *one* pad.
"""

from __future__ import annotations

import abc
import contextlib
import functools
import threading
import time
from collections.abc import Callable, Coroutine, Iterable, Sequence
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

import zmq

from slipd_client.clock import ServerClock
from slipd_client.errors import CallError, ClientError, LeaseInUse, RequestRefused, check_seconds
from slipd_client.lease_keeper import ONE_CLIENT_EACH, LeaseKeeper
from slipd_client.link import Link, Steps
from slipd_client.messages.schema.replies import (
    FaultReply,
    FrictionReply,
    GravityReply,
    GripReply,
    HelloReply,
    HoldReply,
    MotionReply,
    ObjectReply,
    RecordingReply,
    Reply,
    StatusReply,
    TareReply,
    TareResult,
)
from slipd_client.messages.schema.request_fields import TARE_S
from slipd_client.paths import requests_endpoint
from slipd_client.request_protocol import TIMEOUT_S, Ask, Envelope, RequestProtocol, Result

if TYPE_CHECKING:
    from slipd_client.aio import AsyncGripClient
    from slipd_client.grip import GripClient
    from slipd_client.keys import Keys

P = ParamSpec("P")
T = TypeVar("T")


class operation(Generic[P, T]):  # noqa: N801 - a decorator
    """Makes a method that returns steps one that carries them out: it blocks, or is awaited, as its client does."""

    def __init__(self, steps: Callable[Concatenate[Any, P], Steps[T]]) -> None:
        @functools.wraps(steps)
        def carry_out(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> Any:
            return client._run(steps(client, *args, **kwargs))  # noqa: SLF001 - a method of the client

        self._method = carry_out

    @overload
    def __get__(self, client: None, owner: type[Any]) -> Callable[..., Any]: ...
    @overload
    def __get__(self, client: GripClient, owner: type[Any]) -> Callable[P, T]: ...
    @overload
    def __get__(self, client: AsyncGripClient, owner: type[Any]) -> Callable[P, Coroutine[Any, Any, T]]: ...

    def __get__(self, client: Any, owner: type[Any]) -> Callable[..., Any]:
        """Return the method, bound to its client."""
        return self._method if client is None else MethodType(self._method, client)


class GripClientBase(abc.ABC):
    """Sends requests and returns their replies.

    Every method raises RequestRefused when the daemon refuses, NoAnswer when it does not answer, LeaseLost instead of
    moving the gripper without its lease, LeaseInUse where another thread or task holds the lease of this client, and
    MessageError or CallError for arguments that no message can carry. A request is never sent a second time, nor kept
    for a daemon that is not there yet. The first request is preceded by ``hello``. A daemon accepts 50 requests a
    second from one client, including the renewals of its lease (15 a second).

    **The lease belongs to the thread or task that acquired it** (and to tasks created within its block). While it is
    held, other threads and tasks that share the client may read, send gravity and record, and may stop: ``grip_hold``
    and ``gripper_stop``. What else needs the lease, or is refused while another client holds it, raises LeaseInUse.

    Args:
        endpoint: Where the daemon accepts requests; its default endpoint when None.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        timeout_s: How long to wait for a reply.

    Attributes:
        timeout_s: The same; may be changed.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint, another user could listen there, or ``timeout_s`` is not a
            positive time.
    """

    _lock: Callable[[], Any]
    """Makes the lock whose holder sends the next request."""

    def __init__(self, endpoint: str | None = None, *, keys: Keys | None = None, timeout_s: float = TIMEOUT_S) -> None:
        check_seconds("timeout_s", timeout_s, TIMEOUT_S)
        self.timeout_s = timeout_s
        # IMMEDIATE: without it ZeroMQ keeps a request for a daemon that starts later, and delivers it then
        where = requests_endpoint() if endpoint is None else endpoint
        self._link = Link(zmq.DEALER, where, keys, {zmq.IMMEDIATE: 1})
        self._protocol = RequestProtocol(where, time.monotonic_ns, self._check, self._exchange, self._sleep)
        self._turn = self._lock()
        self._lease: LeaseKeeper | None = None
        self._lease_slot = threading.Lock()

    @property
    def endpoint(self) -> str:
        """Where the requests go."""
        return self._link.endpoint

    @property
    def clock(self) -> ServerClock:
        """The daemon's clock, estimated from its replies; unknown before the first."""
        return self._protocol.clock

    def _request(self, op: str, /, **fields: Any) -> Steps[Any]:
        """Send one request; fields that are None are left out."""
        return self._request_exactly(op, {name: each for name, each in fields.items() if each is not None})

    async def _request_exactly(self, op: str, fields: dict[str, Any]) -> Any:
        """Send one request with exactly these fields."""
        lease = self._lease
        try:
            return await self._protocol.request(op, fields)
        except RequestRefused as refusal:
            if lease is not None and refusal.code in ("no_lease", "wrong_boot"):
                lease.lose(str(refusal))
            raise

    def _check(self, op: str) -> None:
        """Raise where the calling thread or task may not send ``op`` now, because of the lease of this client."""
        lease = self._lease
        if lease is not None:
            lease.check_op(op)

    def _claim(self, lease: LeaseKeeper) -> None:
        """Reserve the one lease of this client before it is requested; LeaseInUse where it is taken."""
        if not self._lease_slot.acquire(blocking=False):
            owner = self._lease.owner if self._lease else "another thread or task"
            raise LeaseInUse(
                f"a client holds one lease at a time, and {owner} holds that of this client; {ONE_CLIENT_EACH}"
            )
        self._lease = lease

    def _unclaim(self) -> None:
        """Free that lease, after the daemon has it back."""
        self._lease = None
        self._lease_slot.release()

    async def _acquire(self, lease: LeaseKeeper, ttl_ms: int) -> None:
        await self._protocol.lease("lease.acquire", {"ttl_ms": ttl_ms})
        lease.note_renewal(self._protocol.lease_asked_ns)

    async def _renew_once(self, lease: LeaseKeeper) -> None:
        try:
            await self._protocol.lease("lease.renew", {}, max(0.0, lease.left_s))
            lease.note_renewal(self._protocol.lease_asked_ns)
        except ClientError as error:
            lease.note_failure(error)

    async def _give_back(self, lease: LeaseKeeper) -> None:
        if not lease.lost:
            with contextlib.suppress(ClientError):
                await self._protocol.lease("lease.release", {})

    async def _exchange(self, ask: Ask) -> Result:
        """Send a request when its turn has come, and return the result of its reply."""
        timeout_s = self.timeout_s if ask.timeout_s is None else ask.timeout_s
        until = await self._take_turn(timeout_s)
        try:
            envelope = await self._send(ask, until)
            while (frames := await self._frames(until)) is not None:
                if (result := self._protocol.result(envelope, frames)) is not None:
                    return result
            raise self._protocol.no_reply(timeout_s)
        finally:
            self._turn.release()

    async def _send(self, ask: Ask, until: float) -> Envelope:
        while True:
            envelope = self._protocol.pack(ask)
            if self._link.send(envelope.data):
                return envelope
            if not await self._writable(until):
                raise self._protocol.no_listener()

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

    @operation
    def request(self, op: str, /, **fields: Any) -> Steps[Any]:
        """Send any operation, also one that this client does not know; fields that are None are left out."""
        return self._request(op, **fields)

    @operation
    def hello(self) -> Steps[HelloReply]:
        """Return the daemon's run, its clock, the version of the API, and the names of its fingers."""
        return self._protocol.hello()

    @operation
    def status(self) -> Steps[StatusReply]:
        """Return the state of the daemon, its fingers and its streams: the body of the ``status`` topic."""
        return self._request("status")

    @operation
    def grip_set(self, force_n: float) -> Steps[GripReply]:
        """Grip with ``force_n``."""
        return self._request("grip.set", force_n=force_n)

    @operation
    def grip_adjust(self, delta_n: float) -> Steps[GripReply]:
        """Increase the grip force by ``delta_n``; a negative value loosens the grip."""
        return self._request("grip.adjust", delta_n=delta_n)

    @operation
    def grip_hold(self) -> Steps[HoldReply]:
        """Keep the force in force, and stop fingers that move. Any thread or task may call it."""
        return self._request("grip.hold")

    @operation
    def gripper_activate(self, *, drop: bool = False) -> Steps[Reply]:
        """Make the gripper ready; some open and close fully for it. ``drop``: even if an object may be held."""
        return self._request("gripper.activate", drop=drop or None)

    @operation
    def gripper_close(
        self, force_n: float, width_m: float | None = None, speed_mps: float | None = None
    ) -> Steps[GripReply]:
        """Close onto an object until the force is reached, or the width between the pads where one is given."""
        return self._request("gripper.close", force_n=force_n, width_m=width_m, speed_mps=speed_mps)

    @operation
    def gripper_open(
        self, *, drop: bool = False, width_m: float | None = None, speed_mps: float | None = None
    ) -> Steps[GripReply]:
        """Open, fully or to a width between the pads. ``drop``: even if an object is held, or may be."""
        return self._request("gripper.open", drop=drop or None, width_m=width_m, speed_mps=speed_mps)

    @operation
    def gripper_stop(self) -> Steps[Reply]:
        """Stop the fingers where they are. Any thread or task may call it."""
        return self._request("gripper.stop")

    @operation
    def fault_ack(self) -> Steps[FaultReply]:
        """Acknowledge the latched fault; until then nothing moves."""
        return self._request("fault.ack")

    @operation
    def tare(
        self, finger: str, stream: str | float | None = None, seconds: float = TARE_S, *, unloaded: bool = False
    ) -> Steps[TareResult]:
        """Take the mean of the next ``seconds`` as zero, and wait until the tare is taken.

        Args:
            finger: Name of the finger.
            stream: "wrench", "pad", or "all"; None: the stream that measures the force. A number is ``seconds``, as in
                calls of older programs.
            seconds: Averaging time, s.
            unloaded: Confirms that nothing touches the finger, although its normal force is clearly negative (reason
                "pulled").

        Raises:
            TareGivenUp: The daemon began the tare and gave it up; ``reason`` says why.
            CallError: ``seconds`` is not a positive time.
        """
        if isinstance(seconds, str):
            raise CallError(f"call tare(finger, stream, seconds): got stream {stream!r} and seconds {seconds!r}")
        if isinstance(stream, (int, float)):
            return self._protocol.tare(finger, stream, self.timeout_s, unloaded=unloaded)
        return self._protocol.tare(finger, seconds, self.timeout_s, stream, unloaded=unloaded)

    @operation
    def tare_get(self, finger: str, stream: str | None = None) -> Steps[TareReply]:
        """Return the tare in use of the stream "wrench" or "pad"; None: the one that measures the force."""
        return self._request("tare.get", finger=finger, stream=stream)

    @operation
    def tare_undo(self, finger: str, stream: str | None = None) -> Steps[TareReply]:
        """Return to the tare before the last one, of a stream as in `tare_get`."""
        return self._request("tare.undo", finger=finger, stream=stream)

    @operation
    def gravity_set(self, finger: str, gravity_mps2: Sequence[float]) -> Steps[GravityReply]:
        """Report gravity minus the finger's acceleration, m/s², in the frame of its pad; at 10 Hz or more."""
        vector = list(gravity_mps2) if isinstance(gravity_mps2, Iterable) else gravity_mps2
        return self._request("gravity.set", finger=finger, gravity_mps2=vector)

    @operation
    def friction_set(self, finger: str, mu_s: float, mu_d: float | None = None) -> Steps[FrictionReply]:
        """Set the static and the dynamic coefficient of friction between a finger's pad and the object.

        A value that makes verdicts more lenient, such as a larger ``mu_s``, needs the lease, unless the daemon's config
        says otherwise.
        """
        return self._request("friction.set", finger=finger, mu_s=mu_s, mu_d=mu_d)

    @operation
    def object_set(self, name: str | None) -> Steps[ObjectReply]:
        """Name the object that is gripped or about to be, so that its friction is remembered; None: none is named.

        Another name needs the lease, unless the daemon's config says otherwise.
        """
        return self._request_exactly("object.set", {"name": name})

    @operation
    def motion_check(
        self,
        points: Sequence[Sequence[float]] | None = None,
        acceleration_mps2: Sequence[float] | None = None,
    ) -> Steps[MotionReply]:
        """Report whether the present grip holds a motion; it moves nothing, and needs no lease.

        Args:
            points: Up to 2,000 rows of time, s; gravity minus acceleration, m/s²; angular velocity, rad/s; angular
                acceleration, rad/s²: of the gripper, in its frame.
            acceleration_mps2: Instead of them one acceleration from the present orientation, m/s², in the same frame.
        """
        rows = None if points is None else [[float(number) for number in row] for row in points]
        vector = None if acceleration_mps2 is None else list(acceleration_mps2)
        return self._request("motion.check", points=rows, acceleration_mps2=vector)

    @operation
    def record_start(self) -> Steps[RecordingReply]:
        """Start a recording; the daemon chooses its name and path."""
        return self._request("record.start")

    @operation
    def record_stop(self) -> Steps[RecordingReply]:
        """End the recording."""
        return self._request("record.stop")
