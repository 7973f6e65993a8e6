"""Keys of ``[bus]`` and ``[requests]``: who may connect, and what clients may request."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from slipd.config.value_bounds import StrictModel

File = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]+$")]
"""An absolute path."""


class Bus(StrictModel):
    """``[bus]``: the endpoints, and who may connect to them.

    Attributes:
        publish: ZeroMQ endpoint of the messages; None: a socket in the private runtime directory. An endpoint over TCP
            needs ``secret_key`` and ``readers``. Wrong: clients find no daemon.
        requests: ZeroMQ endpoint of the requests, likewise; over TCP it needs ``secret_key`` and ``requesters``. Wrong:
            likewise.
        secret_key: File with the secret key of the daemon (``slipctl keys new`` creates one). Wrong: the daemon does
            not start.
        readers: Directory with the public keys (``*.key``) that may subscribe; None: no key is needed. Wrong: clients
            are not admitted.
        requesters: Directory with the public keys that may send requests, likewise. A client that may do both has its
            key in both directories. Wrong: likewise.
        allow_local_tcp: Serve TCP ports of this machine without keys; every user of the machine can then move the
            gripper. Wrong: true on a machine with other users: each of them can move the gripper.
        requests_hz: Requests per second that one client may send. Wrong: too low, and requests are `busy`; too high,
            and one client can slow down the others.
    """

    publish: str | None = None
    requests: str | None = None
    secret_key: File | None = None
    readers: File | None = None
    requesters: File | None = None
    allow_local_tcp: bool = False
    requests_hz: float = Field(default=50.0, ge=1.0, le=10_000.0)


class Requests(StrictModel):
    """``[requests]``: what clients may request.

    Attributes:
        friction_without_lease: Any client may raise μ of a finger, or name another object, which makes verdicts more
            lenient. With ``[reflex]`` it may also lower μ, which makes the reflex grip harder. False: only the client
            that holds the lease may. Wrong: true, and any client can silence warnings, or crush the object.
        gravity_without_lease: With ``[reflex]``, any client may report gravity, for the program of an arm that never
            holds the lease. False: only the client that holds the lease may. Without ``[reflex]`` no client needs the
            lease for it. Wrong: true, and any client can make the reflex grip harder.
    """

    friction_without_lease: bool = False
    gravity_without_lease: bool = False
