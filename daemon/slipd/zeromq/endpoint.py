"""Binds the daemon's sockets where only its user reaches them, or only who has a key.

ZeroMQ lets in whoever the umask allows, steals an ipc path that another program serves, deletes a file that lies there,
keeps a connection that never says a word for half a minute, and takes any key where nobody judges it. Its heartbeats
abort the process (an assertion in ``stream_engine_base_t::out_event``) when a peer goes while more than RCVHWM of what
it sent is unread, and a socket without that limit takes in a flood for as long as it lasts: so none has them, and the
kernel's keepalive serves instead.
"""

from __future__ import annotations

import contextlib
import ipaddress
import os
import socket
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import zmq

from slipd.errors import LinkError
from slipd.zeromq.gate import Gate, most_connections, unwatch, watch

MAX_IPC_PATH_BYTES = 107
"""Longest path of a Unix socket (``sun_path`` less its closing zero)."""

KEEPALIVE_S, KEEPALIVE_PROBES = 1, 2
"""After so much silence the kernel asks the other machine for a sign of life, so often, as long each."""

UNANSWERED_MS = 3000
"""A machine that confirms nothing for this long is gone, and what is kept for it is freed."""

HANDSHAKE_MS = 2000
"""How long a connection may take to speak ZeroMQ before it is dropped, with the descriptor it holds."""

LINGER_MS = 200
"""How long the last messages before a stop may take to leave; a stalled peer delays the exit by no more."""


@dataclass(frozen=True, slots=True)
class Access:
    """How clients are let in.

    Attributes:
        domain: Name under which the authenticator is asked about a key.
        secret: The daemon's secret key; None: no keys are asked for, which is for ipc endpoints.
        local_tcp: A TCP port of this machine may be served without keys; all of its users reach it.
    """

    domain: bytes = b""
    secret: bytes | None = field(default=None, repr=False)
    local_tcp: bool = False


USER_ALONE = Access()
"""An ipc endpoint without keys: the file system lets in who may come."""


@contextlib.contextmanager
def serving(
    context: zmq.Context[zmq.Socket[bytes]], kind: int, endpoint: str, options: Mapping[int, int], access: Access
) -> Iterator[tuple[zmq.Socket[bytes], str]]:
    """As ``open_server``; closes the socket, and keeps connections over TCP from becoming too many until then."""
    server, reached = open_server(context, kind, endpoint, options, access)
    with contextlib.ExitStack() as stack:
        stack.callback(server.close)
        if is_tcp(endpoint):
            stack.enter_context(Gate(server, most_connections()))
        yield server, reached


def open_server(
    context: zmq.Context[zmq.Socket[bytes]],
    kind: int,
    endpoint: str,
    options: Mapping[int, int],
    access: Access = USER_ALONE,
) -> tuple[zmq.Socket[bytes], str]:
    """Open a socket and bind it.

    Args:
        context: Owner of the socket.
        kind: Socket type, e.g. ``zmq.ROUTER``.
        endpoint: ``ipc:///directory/name``, or ``tcp://address:port`` (``*`` as port: any free one).
        options: Socket options beside those every server has.
        access: How clients are let in.

    Returns:
        The socket, and the endpoint as clients reach it.

    Raises:
        LinkError: The endpoint is none, is in use, cannot be bound, or would let in anybody.
    """
    _check(endpoint, access)
    server = context.socket(kind)
    server.setsockopt(zmq.TCP_KEEPALIVE, 1)
    server.setsockopt(zmq.TCP_KEEPALIVE_IDLE, KEEPALIVE_S)
    server.setsockopt(zmq.TCP_KEEPALIVE_INTVL, KEEPALIVE_S)
    server.setsockopt(zmq.TCP_KEEPALIVE_CNT, KEEPALIVE_PROBES)
    server.setsockopt(zmq.TCP_MAXRT, UNANSWERED_MS)
    server.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
    server.setsockopt(zmq.LINGER, LINGER_MS)
    for option, value in options.items():
        server.setsockopt(option, value)
    if access.secret is not None:
        server.setsockopt(zmq.CURVE_SERVER, 1)
        server.setsockopt(zmq.CURVE_SECRETKEY, access.secret)
        server.setsockopt(zmq.ZAP_DOMAIN, access.domain)
        server.setsockopt(zmq.ZAP_ENFORCE_DOMAIN, 1)  # without it a missing authenticator admits everybody
    if is_tcp(endpoint):
        watch(server)
    umask = os.umask(0o077)  # the mode of an ipc socket is 0777 less this
    try:
        server.bind(endpoint)
    except zmq.ZMQError as error:
        if is_tcp(endpoint):
            unwatch(server)
        server.close()
        raise LinkError(f"{endpoint}: cannot be bound: {error}; name another endpoint, or free this one") from error
    finally:
        os.umask(umask)
    return server, server.getsockopt_string(zmq.LAST_ENDPOINT)


def check_free(endpoint: str, access: Access = USER_ALONE) -> None:
    """Refuse an endpoint that cannot be served now, without serving it.

    Raises:
        LinkError: As for `open_server`.
    """
    _check(endpoint, access)
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    if not is_tcp(endpoint) or port == "*":
        return
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as ZeroMQ does: who listens keeps the port
        try:
            trial.bind(("" if host == "*" else host, int(port)))
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise LinkError(f"{endpoint}: cannot be bound: {reason}; name another endpoint, or free this one") from None


def is_tcp(endpoint: str) -> bool:
    """Whether this is an endpoint over TCP."""
    return endpoint.startswith("tcp://")


def check_directory(endpoint: str, directory: Path) -> None:
    """Refuse one in which others could put a socket of their own in the place of this one.

    Raises:
        LinkError: It belongs to a user who is neither root nor oneself, or others may change it (but for a sticky one).
    """
    try:
        found = directory.stat()
    except OSError:
        return  # binding tells
    if found.st_uid not in (0, os.geteuid()):
        raise LinkError(f"{endpoint}: its directory belongs to user {found.st_uid}; name one of your own")
    if found.st_mode & 0o022 and not found.st_mode & stat.S_ISVTX:
        mode = stat.S_IMODE(found.st_mode)
        raise LinkError(f"{endpoint}: others may change its directory (mode {mode:04o}); run chmod go-w on it")


def _check(endpoint: str, access: Access) -> None:
    if endpoint.startswith("ipc://"):
        _check_ipc(endpoint, os.fsencode(endpoint.removeprefix("ipc://")))
    elif is_tcp(endpoint):
        _check_tcp(endpoint, endpoint.removeprefix("tcp://").rpartition(":")[0], access)
    else:
        raise LinkError(f"{endpoint}: no endpoint; one is ipc:///run/slipd/publish or tcp://192.168.1.7:5555")


def _check_ipc(endpoint: str, path: bytes) -> None:
    if not path.startswith(b"/"):
        raise LinkError(f"{endpoint}: an ipc endpoint is an absolute path, e.g. ipc:///run/slipd/publish")
    if len(path) > MAX_IPC_PATH_BYTES:
        raise LinkError(f"{endpoint}: the path has {len(path)} bytes; a socket's path has {MAX_IPC_PATH_BYTES} at most")
    check_directory(endpoint, Path(os.fsdecode(path)).parent)
    if os.path.lexists(path) and not stat.S_ISSOCK(os.lstat(path).st_mode):
        raise LinkError(f"{endpoint}: this file is no socket, and binding would delete it; name another path")
    if _is_served(path):
        raise LinkError(f"{endpoint}: another program serves here; stop it, or name another endpoint")


def _is_served(path: bytes) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        visitor.setblocking(False)
        try:
            visitor.connect(path)
        except BlockingIOError:  # its queue of visitors is full
            return True
        except OSError:
            return False
        return True


def _check_tcp(endpoint: str, host: str, access: Access) -> None:
    try:
        local = host == "localhost" or (host != "*" and ipaddress.IPv4Address(host).is_loopback)
    except ValueError:
        raise LinkError(f"{endpoint}: {host!r} is no IPv4 address of this machine; * stands for all of them") from None
    if access.secret is not None or (local and access.local_tcp):
        return
    who = "every user of this machine" if local else "other machines"
    raise LinkError(
        f"{endpoint}: {who} would reach the gripper without encryption and without a list of allowed keys; set"
        " bus.secret_key, bus.readers and bus.requesters, or use ipc:///path"
        + (", or set bus.allow_local_tcp = true" if local else ", with an SSH tunnel from elsewhere")
    )
