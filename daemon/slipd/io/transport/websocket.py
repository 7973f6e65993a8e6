"""A WebSocket server as a connection: the content of its messages is delivered as a stream of bytes.

This uses the protocol of the websockets library, but not its input and output, which have no bounds: they parse 256 KiB
at a time, deliver queued messages without a pause, and queue pongs for a peer that does not read them. A message is
delivered in one piece: its decoder parses it in one go, when its last byte arrives.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket

from websockets.client import ClientProtocol
from websockets.exceptions import InvalidURI
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State
from websockets.uri import WebSocketURI, parse_uri

from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link_connection import READ_BYTES, Connection, FileConnection, OnBytes
from slipd.io.transport.sockets import connected

MAX_MESSAGE_BYTES = 1 << 17
"""Largest message accepted: twice one image of the largest hand as JSON text."""

MANY_FRAMES, READ_BYTES_OF_MANY = 32, 128
"""After a read with more frames than the first, only this many bytes are read at once: a frame may have two bytes, and
each frame takes time."""

MAX_HANDSHAKE_BYTES = 1 << 16
"""Longest answer to the handshake, in case the server is not a WebSocket server."""

OPEN_TIMEOUT_S = 3.0
"""Longest handshake, s: a server on the local network that takes longer is stuck."""

PING_INTERVAL_S = 1.0
"""Silence after which the server is pinged, and period of the pings, s."""

PING_TIMEOUT_S = 2.0
"""Longest wait for an answer, s; with the interval, a cut cable is noticed within 4 s."""

UNREAD_S = 0.2
"""A loop that reads takes no longer to come back to a socket with bytes, s."""

_DATA = frozenset((Opcode.TEXT, Opcode.BINARY, Opcode.CONT))


async def open_websocket(spec: LinkSpec, on_bytes: OnBytes) -> WebsocketConnection:
    """Connect to a server directly, without a proxy from the environment.

    Raises:
        LinkError: The server cannot be reached; the text says why, and what to do.
    """
    try:
        uri = parse_uri(spec.address)
    except (InvalidURI, ValueError) as error:
        raise LinkError(
            f"{spec.address}: not the address of a WebSocket server; a valid one is ws://host:5000"
        ) from error
    host = f"[{uri.host}]" if ":" in uri.host else uri.host
    try:
        opened = await connected(f"ws://{host}:{uri.port}", socket.SOCK_STREAM)
    except LinkError as error:
        raise LinkError(f"{error}; start the server of the sensor there") from error
    with contextlib.ExitStack() as on_failure:
        on_failure.enter_context(opened)
        try:
            async with asyncio.timeout(OPEN_TIMEOUT_S):
                protocol = await _shake_hands(opened, uri)
        except TimeoutError as error:
            raise LinkError(
                f"{spec.address}: no WebSocket handshake within {OPEN_TIMEOUT_S:g} s; restart the server of the sensor"
            ) from error
        except (OSError, ValueError) as error:
            raise LinkError(f"{spec.address}: not a WebSocket server ({error}); correct host and port") from error
        on_failure.pop_all()
    return WebsocketConnection(spec.address, opened, protocol, on_bytes)


async def _shake_hands(opened: socket.socket, uri: WebSocketURI) -> ClientProtocol:
    """Perform the WebSocket handshake.

    Raises:
        OSError: The connection ended.
        ValueError: The answer is not that of a WebSocket server.
    """
    loop = asyncio.get_running_loop()
    protocol = ClientProtocol(uri, max_size=MAX_MESSAGE_BYTES)
    protocol.send_request(protocol.connect())
    await loop.sock_sendall(opened, b"".join(protocol.data_to_send()))
    received = 0
    while protocol.state is State.CONNECTING and protocol.handshake_exc is None:
        data = await loop.sock_recv(opened, READ_BYTES)
        received += len(data)
        if received > MAX_HANDSHAKE_BYTES:
            raise ValueError(f"the answer has more than {MAX_HANDSHAKE_BYTES} bytes")
        if data:
            protocol.receive_data(data)
        else:
            protocol.receive_eof()
        await asyncio.sleep(0)  # other tasks must run even if the server sends without a pause
    if protocol.handshake_exc is not None:
        raise ValueError(str(protocol.handshake_exc)) from protocol.handshake_exc
    return protocol


class WebsocketConnection(FileConnection):
    """A server that sends and is sent nothing but what the protocol needs; a pong that it does not read is dropped."""

    _read_bytes = READ_BYTES
    write = Connection.write  # which sends nothing: sensors with a WebSocket server accept no commands

    def __init__(self, address: str, opened: socket.socket, protocol: ClientProtocol, on_bytes: OnBytes) -> None:
        self._protocol = protocol
        super().__init__(address, opened, on_bytes)
        self._received_s = self._loop.time()
        self._unanswered = 0
        self._next_check = self._loop.call_later(PING_INTERVAL_S, self._check_alive)
        self._first_frames = self._loop.call_soon(self._handle_frames)  # those that came with the handshake

    def unread(self) -> bool:
        """Return whether bytes wait that are not read at once; pings are read, but deliver nothing."""
        return self._loop.time() - self._received_s > UNREAD_S and super().unread()

    async def close(self) -> None:
        """Send a close frame if the server reads, and close at once."""
        if not self.ended and self._protocol.state is State.OPEN:
            self._protocol.send_close(CloseCode.NORMAL_CLOSURE)
            self._send_answers()
        self._stop()
        self._release()

    def _read(self) -> None:
        data = self._receive(self._read_bytes)
        if data is None:
            return
        if not data:
            self._fail("closed by the server")
            return
        self._received_s = self._loop.time()
        self._unanswered = 0
        try:
            self._protocol.receive_data(data)
            self._handle_frames()
        except Exception as error:  # an error in the library ends only this connection
            self._fail(f"{type(error).__name__}: {error}")

    def _handle_frames(self) -> None:
        """Handle the frames that the last read completed."""
        frames = [event for event in self._protocol.events_received() if isinstance(event, Frame)]
        self._read_bytes = READ_BYTES_OF_MANY if len(frames) > MANY_FRAMES else READ_BYTES
        self._send_answers()
        if data := b"".join(frame.data for frame in frames if frame.opcode in _DATA):
            self.deliver(data)
        if self._protocol.close_rcvd is not None:
            self._fail(f"the server closed it: {self._protocol.close_rcvd}")
        elif self._protocol.parser_exc is not None:
            self._fail(f"the server violates the protocol: {self._protocol.parser_exc}")

    def _send_answers(self) -> None:
        if answers := self._protocol.data_to_send():
            super().write(b"".join(answers))

    def _check_alive(self) -> None:
        """Ping a silent server, and end the connection if it does not answer.

        The pings without an answer count, not the time: a stall of this process must not look like a silent server.
        """
        silent_s = self._loop.time() - self._received_s
        if self._unanswered * PING_INTERVAL_S >= PING_TIMEOUT_S:
            self._fail(f"no answer for {silent_s:.1f} s")
            return
        if silent_s >= PING_INTERVAL_S:
            self._unanswered += 1
            self._protocol.send_ping(b"")
            self._send_answers()
        if not self.ended:  # the ping may have failed
            self._next_check = self._loop.call_later(PING_INTERVAL_S, self._check_alive)

    def _fail(self, error: object) -> None:
        self.lose(f"{self._address}: connection ended ({error}); it is opened again when the server is back")

    def _stop(self) -> None:
        super()._stop()
        self._next_check.cancel()
        self._first_frames.cancel()
