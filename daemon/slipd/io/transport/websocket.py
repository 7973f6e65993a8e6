"""A WebSocket server as a connection: the content of its messages is delivered as a stream of bytes.

This uses the protocol of the websockets library, but not its input and output, which have no bounds: they parse 256 KiB
at a time, deliver queued messages without a pause, and queue pongs for a peer that does not read them.
"""

from __future__ import annotations

import asyncio
import socket

from websockets.client import ClientProtocol
from websockets.exceptions import InvalidURI
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State
from websockets.uri import WebSocketURI, parse_uri

from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.address import connected
from slipd.io.transport.byte_delivery import READ_BYTES, ByteDelivery, is_readable
from slipd.io.transport.link import OnBytes
from slipd.io.transport.nonblocking_writer import NonblockingWriter

MAX_MESSAGE_BYTES = 1 << 17
"""Largest message accepted: twice one image of the largest hand as JSON text."""

PIECE_BYTES = 1 << 12
"""Bytes of a message delivered before other tasks of the loop run."""

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
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            protocol = await _shake_hands(opened, uri)
    except TimeoutError as error:
        opened.close()
        raise LinkError(
            f"{spec.address}: no WebSocket handshake within {OPEN_TIMEOUT_S:g} s; restart the server of the sensor"
        ) from error
    except (OSError, ValueError) as error:
        opened.close()
        raise LinkError(f"{spec.address}: not a WebSocket server ({error}); correct host and port") from error
    except BaseException:  # cancelled
        opened.close()
        raise
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


class WebsocketConnection:
    """An open connection; see `slipd.io.transport.link.Connection` for the contract of each method.

    A pong that the server does not read is dropped.
    """

    overruns = 0
    latency = ""

    def __init__(self, address: str, opened: socket.socket, protocol: ClientProtocol, on_bytes: OnBytes) -> None:
        self.identity = address
        self._loop = asyncio.get_running_loop()
        self._socket = opened
        self._protocol = protocol
        self._delivery = ByteDelivery(on_bytes)
        self._writer = NonblockingWriter(opened.fileno(), self._fail)
        self._rest = b""
        self._reading = False
        self._read_bytes = READ_BYTES
        self._received_s = self._loop.time()
        self._unanswered = 0
        self._next_check = self._loop.call_later(PING_INTERVAL_S, self._check_alive)
        self._next_piece = self._loop.call_soon(self._handle_frames)  # frames that came with the handshake

    async def until_lost(self) -> str:
        """Wait for the end of the connection and return the reason, or raise the exception of the consumer."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Refuse: sensors with a WebSocket server accept no commands."""
        del data
        return False

    def unread(self) -> bool:
        """Return whether bytes wait that are not read at once; pings are read, but deliver nothing."""
        late = self._loop.time() - self._received_s > UNREAD_S
        return not self._delivery.ended and late and is_readable(self._socket.fileno())

    async def close(self) -> None:
        """Send a close frame if the server reads, and close at once."""
        if not self._delivery.ended and self._protocol.state is State.OPEN:
            self._protocol.send_close(CloseCode.NORMAL_CLOSURE)
            self._writer.write(b"".join(self._protocol.data_to_send()))
        self._end()
        self._socket.close()

    def _read(self) -> None:
        try:
            data = self._socket.recv(self._read_bytes)
        except BlockingIOError:
            return
        except OSError as error:
            self._fail(error)
            return
        if not data:
            self._lose("closed by the server")
            return
        self._received_s = self._loop.time()
        self._unanswered = 0
        try:
            self._protocol.receive_data(data)
            self._handle_frames()
        except Exception as error:  # an error in the library ends only this connection
            self._lose(f"{type(error).__name__}: {error}")

    def _handle_frames(self) -> None:
        """Handle the frames that the last read completed."""
        frames = [event for event in self._protocol.events_received() if isinstance(event, Frame)]
        self._read_bytes = READ_BYTES_OF_MANY if len(frames) > MANY_FRAMES else READ_BYTES
        self._rest = b"".join(frame.data for frame in frames if frame.opcode in _DATA)
        if answers := self._protocol.data_to_send():
            self._writer.write(b"".join(answers))
        self._deliver_piece()

    def _deliver_piece(self) -> None:
        """Deliver the next piece of a message; read again once nothing is left."""
        piece, self._rest = self._rest[:PIECE_BYTES], self._rest[PIECE_BYTES:]
        if self._delivery.ended or (piece and not self._delivery.deliver(piece)):
            self._end()
        elif self._rest:
            self._pause()
            self._next_piece = self._loop.call_soon(self._deliver_piece)
        elif self._protocol.close_rcvd is not None:
            self._lose(f"the server closed it: {self._protocol.close_rcvd}")
        elif self._protocol.parser_exc is not None:
            self._lose(f"the server violates the protocol: {self._protocol.parser_exc}")
        elif not self._reading:
            self._loop.add_reader(self._socket, self._read)
            self._reading = True

    def _pause(self) -> None:
        if self._reading:
            self._loop.remove_reader(self._socket)
            self._reading = False

    def _check_alive(self) -> None:
        """Ping a silent server, and end the connection if it does not answer.

        The pings without an answer count, not the time: a stall of this process must not look like a silent server.
        """
        silent_s = self._loop.time() - self._received_s
        if self._unanswered * PING_INTERVAL_S >= PING_TIMEOUT_S:
            self._lose(f"no answer for {silent_s:.1f} s")
            return
        if silent_s >= PING_INTERVAL_S:
            self._unanswered += 1
            self._protocol.send_ping(b"")
            self._writer.write(b"".join(self._protocol.data_to_send()))
        if self._delivery.ended:  # the ping failed
            return
        self._next_check = self._loop.call_later(PING_INTERVAL_S, self._check_alive)

    def _fail(self, error: OSError) -> None:
        self._lose(str(error))

    def _lose(self, reason: str) -> None:
        self._end()
        self._delivery.lose(f"{self.identity}: connection ended ({reason}); it is opened again when the server is back")

    def _end(self) -> None:
        self._pause()
        self._next_check.cancel()
        self._next_piece.cancel()
        self._writer.stop()
