"""A WebSocket server as a connection: the content of its messages is handed on as a stream of bytes.

The protocol is that of the websockets library without its own reading and writing, which know no bounds: it reads and
parses 256 KiB at a time, hands messages over without a pause while any are queued, and queues pongs for a peer that
does not read them.
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
from slipd.transport.address import connected
from slipd.transport.byte_delivery import READ_BYTES, ByteDelivery
from slipd.transport.link import OnBytes
from slipd.transport.nonblocking_writer import NonblockingWriter

MAX_MESSAGE_BYTES = 1 << 15
"""Largest message taken: twice one image of the largest pads as JSON text."""

PIECE_BYTES = 1 << 12
"""Bytes of a message handed on before the rest of the loop has its turn."""

MANY_FRAMES, READ_BYTES_OF_MANY = 32, 128
"""Behind a read that held more frames, so few bytes are read at once: a frame may have two, and each takes its time."""

MAX_HANDSHAKE_BYTES = 1 << 16
"""Longest answer to the request for a connection, were it no WebSocket server's."""

OPEN_TIMEOUT_S = 3.0
"""A sensor server stands beside the robot: one that takes longer to answer is wedged."""

PING_INTERVAL_S = 1.0
"""How often a silent server is asked for a sign of life."""

PING_TIMEOUT_S = 2.0
"""How long it may take to answer: with the interval, a cut cable is noticed within 4 s."""

_DATA = frozenset((Opcode.TEXT, Opcode.BINARY, Opcode.CONT))


async def open_websocket(spec: LinkSpec, on_bytes: OnBytes) -> WebsocketConnection:
    """Connect to a server, past any proxy that the environment names: sensors are not on the web.

    Raises:
        LinkError: It cannot be reached; says why and what would be right.
    """
    try:
        uri = parse_uri(spec.address)
    except (InvalidURI, ValueError) as error:
        raise LinkError(f"{spec.address}: no address of a WebSocket server; one is ws://host:5000") from error
    host = f"[{uri.host}]" if ":" in uri.host else uri.host
    try:
        opened = await connected(f"ws://{host}:{uri.port}", socket.SOCK_STREAM)
    except LinkError as error:
        raise LinkError(f"{error}; start the sensor's server there") from error
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            protocol = await _shake_hands(opened, uri)
    except TimeoutError as error:
        opened.close()
        raise LinkError(
            f"{spec.address}: no WebSocket handshake within {OPEN_TIMEOUT_S:g} s; start the sensor's server anew"
        ) from error
    except (OSError, ValueError) as error:
        opened.close()
        raise LinkError(f"{spec.address}: is no WebSocket server ({error}); correct host and port") from error
    except BaseException:  # given up meanwhile
        opened.close()
        raise
    return WebsocketConnection(spec.address, opened, protocol, on_bytes)


async def _shake_hands(opened: socket.socket, uri: WebSocketURI) -> ClientProtocol:
    """Ask for a WebSocket connection.

    Raises:
        OSError: The connection ended.
        ValueError: The answer is no WebSocket server's, with what is wrong.
    """
    loop = asyncio.get_running_loop()
    protocol = ClientProtocol(uri, max_size=MAX_MESSAGE_BYTES)
    protocol.send_request(protocol.connect())
    await loop.sock_sendall(opened, b"".join(protocol.data_to_send()))
    heard = 0
    while protocol.state is State.CONNECTING and protocol.handshake_exc is None:
        data = await loop.sock_recv(opened, READ_BYTES)
        heard += len(data)
        if heard > MAX_HANDSHAKE_BYTES:
            raise ValueError(f"an answer of more than {MAX_HANDSHAKE_BYTES} bytes")
        if data:
            protocol.receive_data(data)
        else:
            protocol.receive_eof()
        await asyncio.sleep(0)  # a server that sends without a pause would never let others go on
    if protocol.handshake_exc is not None:
        raise ValueError(str(protocol.handshake_exc)) from protocol.handshake_exc
    return protocol


class WebsocketConnection:
    """An open connection; see `slipd.transport.link.Connection` for what each method promises.

    A pong that the server does not read is dropped.
    """

    overruns = 0

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
        self._heard_s = self._loop.time()
        self._next_look = self._loop.call_later(PING_INTERVAL_S, self._look)
        self._next_piece = self._loop.call_soon(self._take)  # what came with the handshake

    async def until_lost(self) -> str:
        """Return why the connection ended, or raise what the consumer of its bytes raised."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Refuse: the sensors that sit behind a WebSocket server take no commands."""
        del data
        return False

    async def close(self) -> None:
        """Say farewell, if the server reads, and close at once."""
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
            self._lose("it closed the connection")
            return
        self._heard_s = self._loop.time()
        try:
            self._protocol.receive_data(data)
            self._take()
        except Exception as error:  # whatever a server makes the library do ends this connection alone
            self._lose(f"{type(error).__name__}: {error}")

    def _take(self) -> None:
        """Take what the bytes read last completed."""
        frames = [event for event in self._protocol.events_received() if isinstance(event, Frame)]
        self._read_bytes = READ_BYTES_OF_MANY if len(frames) > MANY_FRAMES else READ_BYTES
        self._rest = b"".join(frame.data for frame in frames if frame.opcode in _DATA)
        if answers := self._protocol.data_to_send():
            self._writer.write(b"".join(answers))
        self._hand_on()

    def _hand_on(self) -> None:
        """Hand on a piece, and read on only when nothing is left of it."""
        piece, self._rest = self._rest[:PIECE_BYTES], self._rest[PIECE_BYTES:]
        if self._delivery.ended or (piece and not self._delivery.deliver(piece)):
            self._end()
        elif self._rest:
            self._pause()
            self._next_piece = self._loop.call_soon(self._hand_on)
        elif self._protocol.close_rcvd is not None:
            self._lose(f"the server says: {self._protocol.close_rcvd}")
        elif self._protocol.parser_exc is not None:
            self._lose(f"it breaks the protocol: {self._protocol.parser_exc}")
        elif not self._reading:
            self._loop.add_reader(self._socket, self._read)
            self._reading = True

    def _pause(self) -> None:
        if self._reading:
            self._loop.remove_reader(self._socket)
            self._reading = False

    def _look(self) -> None:
        """Ask a silent server for a sign of life, and give it up when it gives none."""
        silent_s = self._loop.time() - self._heard_s
        if silent_s > PING_INTERVAL_S + PING_TIMEOUT_S:
            self._lose(f"no sign of life for {silent_s:.1f} s")
            return
        if silent_s >= PING_INTERVAL_S:
            self._protocol.send_ping(b"")
            self._writer.write(b"".join(self._protocol.data_to_send()))
        if self._delivery.ended:  # the ping found that the connection is gone
            return
        self._next_look = self._loop.call_later(PING_INTERVAL_S, self._look)

    def _fail(self, error: OSError) -> None:
        self._lose(str(error))

    def _lose(self, reason: str) -> None:
        self._end()
        self._delivery.lose(f"{self.identity}: connection ended ({reason}); it is opened again when the server is back")

    def _end(self) -> None:
        self._pause()
        self._next_look.cancel()
        self._next_piece.cancel()
        self._writer.stop()
