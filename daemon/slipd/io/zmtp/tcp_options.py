"""Options of TCP connections: small messages go out at once, and a lost machine is noticed within seconds."""

from __future__ import annotations

import socket

KEEPALIVE_S = 1
"""Silence after which the kernel probes the other machine, and period of the probes, s."""

KEEPALIVE_PROBES = 2
"""Consecutive unanswered probes that end the connection: a cut cable is noticed within 3 s."""

UNACKNOWLEDGED_MS = 3000
"""Written bytes that stay unacknowledged this long end the connection too, ms; the kernel default is 15 minutes."""


def set_tcp_options(connection: socket.socket) -> None:
    """Set the options of a TCP connection.

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
