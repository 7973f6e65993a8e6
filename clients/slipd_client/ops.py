"""Every operation of the daemon as a method, written once for the blocking and the asyncio client.

A method is named as its operation, with ``_`` for ``.``; its arguments are the fields of ``docs/protocol.md``. Forces
are normal forces on *one* pad.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import zmq

from slipd_client.asking import TARE_S, TIMEOUT_S, Asking, Steps
from slipd_client.clock import ServerClock
from slipd_client.errors import RequestRefused
from slipd_client.holding import Holding
from slipd_client.link import Link
from slipd_client.paths import requests_endpoint

if TYPE_CHECKING:
    from slipd_client.keys import Keys

R = TypeVar("R")

NEEDS_LEASE = ("grip.", "gripper.", "fault.")
"""Beginnings of the operations that need the lease: none is sent once it is known to be lost."""


class Ops(Generic[R]):
    """Sends requests and waits for their replies; ``R`` is a result, or what is awaited for one.

    Every method raises RequestRefused when the daemon says no, NoAnswer when it says nothing, LeaseLost instead of
    moving the gripper without its lease, and MessageError for arguments that no message can carry. A request is never
    sent a second time on its own, nor kept for a daemon that is not there yet. The first one greets the daemon. A
    daemon takes 50 a second of one client, the renewals of a lease (15 a second) among them.

    Args:
        endpoint: Where the daemon takes requests; its default endpoint when None.
        keys: Who this client is, for a daemon across a network; None on this machine.
        timeout_s: How long to wait for a reply.

    Attributes:
        timeout_s: The same; may be changed.

    Raises:
        ValueError: The endpoint is none.
    """

    def __init__(self, endpoint: str | None = None, *, keys: Keys | None = None, timeout_s: float = TIMEOUT_S) -> None:
        self.timeout_s = timeout_s
        # IMMEDIATE: without it ZeroMQ keeps a request for a daemon that starts later, and delivers it then
        where = requests_endpoint() if endpoint is None else endpoint
        self._link = Link(zmq.DEALER, where, keys, {zmq.IMMEDIATE: 1})
        self._asking = Asking(where, time.monotonic_ns)
        self._holding: Holding | None = None

    def _run(self, steps: Steps) -> R:
        """Carry the steps out."""
        raise NotImplementedError

    @property
    def endpoint(self) -> str:
        """Where the requests go."""
        return self._link.endpoint

    @property
    def clock(self) -> ServerClock:
        """The daemon's clock, as well as its replies so far tell it."""
        return self._asking.clock

    def request(self, op: str, /, **fields: Any) -> R:
        """Any operation, also one that this client does not know yet; fields that are None are left out."""
        return self._run(self._request(op, {name: value for name, value in fields.items() if value is not None}))

    def _request(self, op: str, fields: dict[str, Any]) -> Steps:
        holding = self._holding
        if holding is not None and op.startswith(NEEDS_LEASE):
            holding.check()
        try:
            return (yield from self._asking.request(op, fields))
        except RequestRefused as refusal:
            if holding is not None and refusal.code in ("no_lease", "wrong_boot"):
                holding.lose(str(refusal))
            raise

    def _may_acquire(self) -> int:
        """The time at which to ask for a lease; ValueError where one is held."""
        if self._holding is not None:
            raise ValueError("this client holds a lease already; it takes one at a time")
        return time.monotonic_ns()

    def _renewal(self, holding: Holding) -> Steps:
        return self._asking.request("lease.renew", {}, max(0.0, holding.left_s))

    def hello(self) -> R:
        """The daemon's run, its clock, the version of the API, and the names of its fingers."""
        return self._run(self._asking.hello())

    def status(self) -> R:
        """What the daemon, its fingers and its streams are doing: the map of the ``status`` topic."""
        return self.request("status")

    def grip_set(self, force_n: float) -> R:
        """Grip with ``force_n``."""
        return self.request("grip.set", force_n=force_n)

    def grip_adjust(self, delta_n: float) -> R:
        """Grip with ``delta_n`` more, or less where it is negative, than now."""
        return self.request("grip.adjust", delta_n=delta_n)

    def grip_hold(self) -> R:
        """Stay at the force in force, and close no further."""
        return self.request("grip.hold")

    def gripper_activate(self, *, drop: bool = False) -> R:
        """Make the gripper ready; some open and close fully for it. ``drop``: although an object may be held."""
        return self.request("gripper.activate", drop=drop or None)

    def gripper_close(self, force_n: float, width_m: float | None = None, speed_mps: float | None = None) -> R:
        """Close onto an object until the force is reached, or the width between the pads where one is given."""
        return self.request("gripper.close", force_n=force_n, width_m=width_m, speed_mps=speed_mps)

    def gripper_open(self, *, drop: bool = False, width_m: float | None = None, speed_mps: float | None = None) -> R:
        """Open, fully or to a width between the pads; ``drop``: although an object is held, or may be."""
        return self.request("gripper.open", drop=drop or None, width_m=width_m, speed_mps=speed_mps)

    def gripper_stop(self) -> R:
        """Stop the fingers where they are."""
        return self.request("gripper.stop")

    def fault_ack(self) -> R:
        """Say that the latched fault was seen; until then nothing moves."""
        return self.request("fault.ack")

    def tare(self, finger: str, seconds: float = TARE_S, stream: str | None = None, *, unloaded: bool = False) -> R:
        """Take the mean of the next ``seconds`` as zero, and wait until the tare is done.

        Args:
            finger: Which finger.
            seconds: How long to average, s.
            stream: "wrench", "pad", or "all"; None: what measures the force.
            unloaded: Nothing touches the finger, although its normal force is clearly negative (reason "pulled").

        The result is that of `tare_get`, with ``verified``: whether the daemon knew that nothing touched the finger.
        With "all" it holds ``verified`` and ``streams``, the result of each by its name.

        Raises:
            RequestRefused: Beside the daemon's own refusals: the tare was given up meanwhile.
            ValueError: ``seconds`` is no positive time.
        """
        return self._run(self._asking.tare(finger, seconds, self.timeout_s, stream, unloaded=unloaded))

    def tare_get(self, finger: str, stream: str | None = None) -> R:
        """Return the tare in use of the stream "wrench" or "pad"; None: the one that measures the force."""
        return self.request("tare.get", finger=finger, stream=stream)

    def tare_undo(self, finger: str, stream: str | None = None) -> R:
        """Return to the tare before the last one, of a stream as in `tare_get`."""
        return self.request("tare.undo", finger=finger, stream=stream)

    def gravity_set(self, finger: str, gravity_mps2: Sequence[float]) -> R:
        """Tell gravity less the finger's acceleration, m/s², in the frame of its pad; at 10 Hz or more."""
        return self.request("gravity.set", finger=finger, gravity_mps2=list(gravity_mps2))

    def friction_set(self, finger: str, mu_s: float, mu_d: float | None = None) -> R:
        """Set the static and the dynamic coefficient of friction between a finger's pad and the object.

        What makes verdicts more lenient, such as a larger ``mu_s``, needs the lease, unless the daemon's config says
        otherwise.
        """
        return self.request("friction.set", finger=finger, mu_s=mu_s, mu_d=mu_d)

    def record_start(self) -> R:
        """Begin a recording; the result holds its ``name`` and ``path``, which the daemon chooses."""
        return self.request("record.start")

    def record_stop(self) -> R:
        """End it."""
        return self.request("record.stop")
