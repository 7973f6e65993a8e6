"""Bind the sockets of the daemon so that only its user, or only clients with a key, can connect."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import os
import select
import socket
import stat
from dataclasses import dataclass, field
from pathlib import Path

from slipd.errors import LinkError

MAX_IPC_PATH_BYTES = 107
"""Longest path of a Unix socket (``sun_path`` without its final zero)."""

BACKLOG = 64
"""Connections that the kernel queues until they are accepted."""

KEEPALIVE_S = 1
"""Silence after which the kernel probes the other machine, and period of the probes, s."""

KEEPALIVE_PROBES = 2
"""Consecutive unanswered probes that end the connection: a cut cable is noticed within 3 s."""

UNACKNOWLEDGED_MS = 3000
"""Written bytes that stay unacknowledged this long end the connection too, ms; the kernel default is 15 minutes."""

_ANY_PORT = "*"


@dataclass(frozen=True, slots=True)
class Access:
    """Who may connect.

    Attributes:
        local_tcp: Serve a TCP port of this machine without keys; all users of the machine can connect.
        secret: Secret key of the daemon, 32 bytes; None: no key is needed, for ipc endpoints.
        keys: The keys that may connect, 40 letters of Z85 each.
    """

    local_tcp: bool = False
    secret: bytes | None = field(default=None, repr=False)
    keys: frozenset[bytes] = frozenset()


USER_ALONE = Access()
"""An ipc endpoint without keys: file permissions decide who may connect."""


def bind(endpoint: str, access: Access = USER_ALONE) -> tuple[socket.socket, str]:
    """Open a non-blocking, listening socket.

    Args:
        endpoint: ``ipc:///directory/name``, ``unix:///directory/name`` for a raw stream, or ``tcp://address:port``
            (``*`` as port: any free one).
        access: Who may connect.

    Returns:
        The socket, and the endpoint as clients reach it.

    Raises:
        LinkError: The endpoint is invalid, in use, cannot be bound, or would admit anybody.
    """
    _check(endpoint, access)
    server = socket.socket(socket.AF_INET if is_tcp(endpoint) else socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        if is_tcp(endpoint):
            server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            server.bind(_host_and_port(endpoint))
            address, number = server.getsockname()
            endpoint = f"tcp://{address}:{number}"
        else:
            path = _path_of(endpoint)
            path.unlink(missing_ok=True)  # `_check` found no server there
            server.bind(str(path))
            path.chmod(0o700)  # nobody can connect before this: it does not listen yet
        server.listen(BACKLOG)
    except (OSError, ValueError, OverflowError) as error:
        server.close()
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise LinkError(f"{endpoint}: cannot be bound: {reason}; name another endpoint, or free this one") from error
    server.setblocking(False)
    return server, endpoint


def release(server: socket.socket, endpoint: str) -> None:
    """Close a listening socket and remove its file."""
    server.close()
    if not is_tcp(endpoint):
        _path_of(endpoint).unlink(missing_ok=True)


def check_free(endpoint: str, access: Access = USER_ALONE) -> None:
    """Check that an endpoint can be served now, by serving it for a moment.

    Raises:
        LinkError: As for `bind`.
    """
    release(*bind(endpoint, access))


def is_tcp(endpoint: str) -> bool:
    """Return whether this is an endpoint over TCP."""
    return endpoint.startswith("tcp://")


def set_tcp_options(connection: socket.socket) -> None:
    """Let a TCP connection send small messages at once, and end within seconds of losing the other machine.

    Raises:
        OSError: The connection has ended.
    """
    for option, value in (
        (socket.TCP_NODELAY, 1),
        (socket.TCP_KEEPIDLE, KEEPALIVE_S),
        (socket.TCP_KEEPINTVL, KEEPALIVE_S),
        (socket.TCP_KEEPCNT, KEEPALIVE_PROBES),
        (socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS),
    ):
        connection.setsockopt(socket.IPPROTO_TCP, option, value)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)


def is_ready(fileno: int, event: int) -> bool:
    """Return whether a descriptor can be read (``select.POLLIN``) or written (``select.POLLOUT``) now."""
    poll = select.poll()
    poll.register(fileno, event)
    return any(found & event for _, found in poll.poll(0))


async def greets(endpoint: str, patience_s: float) -> bool:
    """Return whether an endpoint answers a new connection, with its greeting or by ending it."""
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET if is_tcp(endpoint) else socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        visitor.setblocking(False)
        try:
            async with asyncio.timeout(patience_s):
                await loop.sock_connect(
                    visitor, _host_and_port(endpoint) if is_tcp(endpoint) else str(_path_of(endpoint))
                )
                await loop.sock_recv(visitor, 1)
        except ConnectionError:  # it was ended, which also takes a turn of the loop
            return True
        except (TimeoutError, OSError):  # OSError: the queue of connections is full
            return False
        return True


def _host_and_port(endpoint: str) -> tuple[str, int]:
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    return "" if host == "*" else host, 0 if port == _ANY_PORT else int(port)


def _path_of(endpoint: str) -> Path:
    return Path(endpoint.partition("://")[2])


def _check(endpoint: str, access: Access) -> None:
    if endpoint.startswith(("ipc://", "unix://")):
        _check_path(endpoint, _path_of(endpoint))
    elif is_tcp(endpoint):
        _check_tcp(endpoint, endpoint.removeprefix("tcp://").rpartition(":")[0], access)
    else:
        raise LinkError(
            f"{endpoint}: not an endpoint; valid ones are ipc:///run/slipd/publish and tcp://192.168.1.7:5555"
        )


def _check_path(endpoint: str, path: Path) -> None:
    if not path.is_absolute():
        scheme = endpoint.partition("://")[0]
        raise LinkError(f"{endpoint}: its path must be absolute, such as {scheme}:///run/slipd/name")
    if (size := len(os.fsencode(path))) > MAX_IPC_PATH_BYTES:
        raise LinkError(f"{endpoint}: the path of a socket must have at most {MAX_IPC_PATH_BYTES} bytes, got {size}")
    _check_directory(endpoint, path.parent)
    if os.path.lexists(path) and not stat.S_ISSOCK(path.lstat().st_mode):
        raise LinkError(f"{endpoint}: this file is not a socket, and binding would delete it; name another path")
    if _is_served(path):
        raise LinkError(
            f"{endpoint}: another program serves this endpoint; stop it, or name another"
        ) from FileExistsError()


def _check_directory(endpoint: str, directory: Path) -> None:
    """Refuse a directory in which other users could replace the socket, unless it is sticky."""
    try:
        found = directory.stat()
    except FileNotFoundError:
        raise LinkError(f"{endpoint}: there is no directory {directory}; create it, or name another") from None
    except OSError:
        return  # binding reports it
    if found.st_uid not in (0, os.geteuid()):
        raise LinkError(
            f"{endpoint}: its directory must belong to this user or root, got user {found.st_uid}; name another"
        )
    if found.st_mode & 0o022 and not found.st_mode & stat.S_ISVTX:
        mode = stat.S_IMODE(found.st_mode)
        raise LinkError(f"{endpoint}: other users may change its directory (mode {mode:04o}); run chmod go-w on it")


def _is_served(path: Path) -> bool:
    """Return whether a server listens; it may have no room for another connection just now."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        visitor.setblocking(False)
        return visitor.connect_ex(str(path)) in (0, errno.EAGAIN)


def _check_tcp(endpoint: str, host: str, access: Access) -> None:
    try:
        local = host == "localhost" or (host != "*" and ipaddress.IPv4Address(host).is_loopback)
    except ValueError:
        raise LinkError(
            f"{endpoint}: the host must be an IPv4 address of this machine, or * for all of them, got {host!r}"
        ) from None
    if access.secret is not None or (local and access.local_tcp):
        return
    who = "every user of this machine" if local else "other machines"
    raise LinkError(
        f"{endpoint}: {who} could reach the gripper without encryption and without a list of allowed keys; set"
        " bus.secret_key, bus.readers and bus.requesters, or use ipc:///path"
        + (", or set bus.allow_local_tcp = true" if local else ", with an SSH tunnel for remote clients")
    )
