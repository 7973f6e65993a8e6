"""Binds the daemon's sockets where only its user, or only this machine, reaches them.

ZeroMQ lets in whoever the umask allows, steals an ipc path that another program serves, deletes a file that lies there,
and keeps a connection that never says a word for half a minute.
"""

from __future__ import annotations

import ipaddress
import os
import socket
import stat
from collections.abc import Mapping

import zmq

from slipd.errors import LinkError

MAX_IPC_PATH_BYTES = 107
"""Longest path of a Unix socket (``sun_path`` less its closing zero)."""

HEARTBEAT_MS = 1000
"""How often a silent peer is asked for a sign of life."""

HEARTBEAT_TIMEOUT_MS = 3000
"""A peer that gives none for this long is gone, and what is kept for it is freed."""

HANDSHAKE_MS = 2000
"""How long a connection may take to speak ZeroMQ before it is dropped, with the descriptor it holds."""

LINGER_MS = 200
"""How long the last messages before a stop may take to leave; a stalled peer delays the exit by no more."""


def open_server(
    context: zmq.Context[zmq.Socket[bytes]], kind: int, endpoint: str, options: Mapping[int, int]
) -> tuple[zmq.Socket[bytes], str]:
    """Open a socket and bind it.

    Args:
        context: Owner of the socket.
        kind: Socket type, e.g. ``zmq.ROUTER``.
        endpoint: ``ipc:///directory/name``, or ``tcp://127.0.0.1:port`` (``*`` as port: any free one).
        options: Socket options beside those every server has.

    Returns:
        The socket, and the endpoint as clients reach it.

    Raises:
        LinkError: The endpoint is none, is in use, or cannot be bound.
    """
    _check(endpoint)
    server = context.socket(kind)
    server.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    server.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    server.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
    server.setsockopt(zmq.LINGER, LINGER_MS)
    for option, value in options.items():
        server.setsockopt(option, value)
    umask = os.umask(0o077)  # the mode of an ipc socket is 0777 less this
    try:
        server.bind(endpoint)
    except zmq.ZMQError as error:
        server.close()
        raise LinkError(f"{endpoint}: cannot be bound: {error}; name another endpoint, or free this one") from error
    finally:
        os.umask(umask)
    return server, server.getsockopt_string(zmq.LAST_ENDPOINT)


def _check(endpoint: str) -> None:
    if endpoint.startswith("ipc://"):
        _check_ipc(endpoint, os.fsencode(endpoint.removeprefix("ipc://")))
    elif endpoint.startswith("tcp://"):
        _check_tcp(endpoint, endpoint.removeprefix("tcp://").rpartition(":")[0])
    else:
        raise LinkError(f"{endpoint}: no endpoint; one is ipc:///run/slipd/publish or tcp://127.0.0.1:5555")


def _check_ipc(endpoint: str, path: bytes) -> None:
    if not path.startswith(b"/"):
        raise LinkError(f"{endpoint}: an ipc endpoint is an absolute path, e.g. ipc:///run/slipd/publish")
    if len(path) > MAX_IPC_PATH_BYTES:
        raise LinkError(f"{endpoint}: the path has {len(path)} bytes; a socket's path has {MAX_IPC_PATH_BYTES} at most")
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


def _check_tcp(endpoint: str, host: str) -> None:
    try:
        local = host == "localhost" or ipaddress.IPv4Address(host).is_loopback
    except ValueError:
        local = False
    if not local:
        raise LinkError(
            f"{endpoint}: other machines would reach the gripper without encryption and without a list of allowed"
            " keys, which slipd does not have yet; use tcp://127.0.0.1:port, or ipc:///path with an SSH tunnel"
        )
