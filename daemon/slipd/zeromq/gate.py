"""Keeps connections over TCP from using up the daemon's file descriptors.

ZeroMQ accepts every connection as long as the process has a descriptor left, and then the daemon itself can open
nothing. It has no limit of its own, and giving up the port would cut off who is connected. So the kernel is told to
drop every request for a connection (a packet filter on the listening socket, ``SO_ATTACH_FILTER`` of socket(7)) while
there are too many.
"""

from __future__ import annotations

import contextlib
import ctypes
import resource
import socket
import struct

import zmq

from slipd.zeromq.draining import Drain

MAX_CONNECTIONS = 256
"""Connections of one endpoint: several times what a cell has."""

RESERVE = 64
"""Descriptors that connections never get: the ports, files and sockets of the daemon itself, generously."""

BACKLOG = 16
"""Connections that the kernel may have taken when the gate closes; ZeroMQ still gets them."""

REOPEN_BELOW = 0.75
"""Share of the most connections below which the gate opens again."""

_EVENTS = zmq.EVENT_LISTENING | zmq.EVENT_ACCEPTED | zmq.EVENT_DISCONNECTED
_SO_ATTACH_FILTER, _SO_DETACH_FILTER = 26, 27  # Python does not name them; the numbers are those of x86 and ARM
_RETURN = 0x06  # BPF_RET | BPF_K: keep so many bytes of a packet


def raise_descriptor_limit() -> None:
    """Let this process open as many files as its hard limit says; the soft one is for programs that use select()."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:  # where it is the same, a service may be forbidden to ask
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def most_connections() -> int:
    """How many connections one endpoint may have under the limit of descriptors in force.

    A quarter of what the reserve leaves: there are two endpoints, and ZeroMQ accepts some more before the gate closes.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(1, min(MAX_CONNECTIONS, (limit - RESERVE) // 4))


def watch(server: zmq.Socket[bytes]) -> None:
    """Prepare a socket for its gate; to be called before it is bound, so that the gate learns what listens."""
    server.setsockopt(zmq.BACKLOG, BACKLOG)
    server.get_monitor_socket(_EVENTS)


def unwatch(server: zmq.Socket[bytes]) -> None:
    """Undo ``watch``; to be called before the socket is closed."""
    monitor = server.get_monitor_socket()
    server.disable_monitor()
    monitor.close(linger=0)


def drop_all(listener: socket.socket) -> None:
    """Have the kernel drop whatever comes for a socket: requests for a connection, where it listens."""
    program = ctypes.create_string_buffer(struct.pack("=HBBI", _RETURN, 0, 0, 0))
    listener.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("@HP", 1, ctypes.addressof(program)))


def cut_off(descriptor: bytes, endpoint: str) -> None:
    """End one connection to a server, which ZeroMQ offers no way to do.

    Args:
        descriptor: In digits, as ZeroMQ told it. It may be in use for something else by now, and only a connection to
            this very server is ended.
        endpoint: Of the server.
    """
    with contextlib.suppress(ValueError, OSError):
        connection = socket.socket(fileno=int(descriptor))  # no copy: there may be no descriptor left for one
        try:
            own = connection.getsockname()
            if (own if isinstance(own, str) else own[1]) == _place(endpoint):
                connection.shutdown(socket.SHUT_RDWR)
        finally:
            connection.detach()


def _place(endpoint: str) -> str | int:
    """The path of an ipc endpoint, or the port of one over TCP."""
    return endpoint.removeprefix("ipc://") if endpoint.startswith("ipc:") else int(endpoint.rpartition(":")[2])


class Gate:
    """Watches one bound server; serves from ``with`` to its end, on the running loop.

    Args:
        server: A socket that ``watch`` prepared and that is bound to one TCP endpoint.
        most: Connections at which the gate closes.

    Attributes:
        closed: Whether new connections are kept out.
        times_closed: How often it has been closed so far.
    """

    def __init__(self, server: zmq.Socket[bytes], most: int) -> None:
        self.closed = False
        self.times_closed = 0
        self._server, self._most = server, most
        self._endpoint = server.getsockopt_string(zmq.LAST_ENDPOINT)
        self._connections: set[int] = set()
        self._listener: socket.socket | None = None

    def __enter__(self) -> Gate:
        self._drain = Drain(self._server.get_monitor_socket(), self._on_event, max_frames=2)
        self._drain.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._drain.stop()
        unwatch(self._server)
        if self._listener is not None:
            self._listener.detach()

    def _on_event(self, frames: list[bytes]) -> None:
        """Count; the first frame is the event (16 bits) and the descriptor that it is about (32 bits)."""
        event, descriptor = struct.unpack("=Hi", frames[0])
        if event == zmq.EVENT_LISTENING:
            self._listener = socket.socket(fileno=descriptor)  # ZeroMQ keeps and closes it
        elif event == zmq.EVENT_ACCEPTED:
            self._connections.add(descriptor)
            if len(self._connections) > self._most:  # the gate is closing, and ZeroMQ was quicker
                cut_off(b"%d" % descriptor, self._endpoint)
        elif event == zmq.EVENT_DISCONNECTED:
            self._connections.discard(descriptor)
        if not self.closed and len(self._connections) >= self._most:
            self._close()
        elif self.closed and len(self._connections) < self._most * REOPEN_BELOW:
            self._open()

    def _close(self) -> None:
        if self._listener is not None:
            drop_all(self._listener)
            self.closed = True
            self.times_closed += 1

    def _open(self) -> None:
        if self._listener is not None:
            self._listener.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)
            self.closed = False
