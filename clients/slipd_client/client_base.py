"""Every operation of the daemon as a method, written once for the blocking and the asyncio client.

A method is named like its operation, with ``_`` for ``.``; its arguments are the fields of ``docs/protocol.md``, and it
returns the class of the reply in `slipd_client.messages.typed`. Forces are normal forces on *one* pad.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Coroutine, Iterable, Iterator, Sequence
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from slipd_client.errors import CallError, ClientError, LeaseInUse, RequestRefused
from slipd_client.lease_keeper import ONE_CLIENT_EACH, LeaseKeeper
from slipd_client.link import Steps
from slipd_client.messages.replies import (
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
from slipd_client.messages.request_fields import TARE_S
from slipd_client.request_protocol import Ask, RequestProtocol

if TYPE_CHECKING:
    from slipd_client.aio import AsyncGripClient
    from slipd_client.grip import GripClient

P = ParamSpec("P")
T = TypeVar("T")


class operation(Generic[P, T]):  # noqa: N801 - a decorator
    """Decorates a method that returns steps: a call carries them out, blocking or to be awaited, as its client does."""

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


class GripClientBase(RequestProtocol):
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
        endpoint: Where the requests go.
        clock: The daemon's clock, estimated from its replies; unknown before the first.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint, another user could listen there, or ``timeout_s`` is not a
            positive time.
    """

    @contextlib.contextmanager
    def _claimed(self, lease: LeaseKeeper) -> Iterator[None]:
        """Reserve the one lease of this client, from before it is requested until the daemon has it back.

        Raises:
            LeaseInUse: It is taken.
        """
        if not self._lease_slot.acquire(blocking=False):
            owner = self._lease.owner if self._lease else "another thread or task"
            raise LeaseInUse(
                f"a client holds one lease at a time, and {owner} holds that of this client; {ONE_CLIENT_EACH}"
            )
        self._lease = lease
        try:
            yield
        finally:
            self._lease = None
            self._lease_slot.release()

    async def _acquire(self, lease: LeaseKeeper, ttl_ms: int) -> None:
        await self._ask(Ask("lease.acquire", {"ttl_ms": ttl_ms}, unchecked=True))
        lease.sent_ns = self._lease_asked_ns

    async def _renew_once(self, lease: LeaseKeeper) -> None:
        try:
            await self._ask(Ask("lease.renew", {}, max(0.0, lease.left_s), unchecked=True))
            lease.sent_ns = self._lease_asked_ns
        except ClientError as error:
            if not (isinstance(error, RequestRefused) and error.code == "busy"):  # a busy daemon may be asked again
                lease.lose(str(error))

    async def _give_back(self, lease: LeaseKeeper) -> None:
        if not lease.lost:
            with contextlib.suppress(ClientError):
                await self._ask(Ask("lease.release", {}, unchecked=True))

    @operation
    def request(self, op: str, /, **fields: Any) -> Steps[Any]:
        """Send any operation, also one that this client does not know; fields that are None are left out."""
        return self._request(op, **fields)

    @operation
    def hello(self) -> Steps[HelloReply]:
        """Return the daemon's run, its clock, the version of the API, and the names of its fingers."""
        return self._greet()

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
            return self._tare(finger, stream, None, unloaded=unloaded)
        return self._tare(finger, seconds, stream, unloaded=unloaded)

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
