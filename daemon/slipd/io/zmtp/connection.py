"""The server's side of one ZMTP connection, without a socket: bytes in, events and bytes out (RFC 23, 26 and 37).

The caller passes what it received to `Connection.receive_data`, takes events until none is left, and sends
`Connection.unsent`. Only the bytes of one read, one frame, the first frames of one message and a bounded
queue of messages are kept. Why this is not libzmq: docs/decisions.md, 10.
"""

from __future__ import annotations

import enum
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from slipd.io.zmtp.mechanisms import MAX_HANDSHAKE_BYTES, SEAL_BYTES, KeyRefusedError, Null
from slipd.io.zmtp.wire import (
    COMMAND,
    GREETING_BYTES,
    MORE,
    ProtocolError,
    check_greeting,
    decode_command,
    encode_command,
    encode_greeting,
    next_frame,
)

MOST_FRAMES = 10_000
"""Most frames of one message; a peer that sends more is disconnected."""

WRITE_BYTES = 64 * 1024
"""Most bytes of the queue that are encoded before the caller has sent them."""

_MAX_PING_CONTEXT = 16
_PING_HEAD = 2  # time to live
_MAX_IDENTITY_BYTES = 255

Message = tuple[bytes, ...]


@dataclass(frozen=True, slots=True)
class PeerRules:
    """Limits for each peer of an endpoint.

    Attributes:
        kind: Socket type of the endpoint, as ZeroMQ names it.
        serves: Socket types that may connect.
        max_bytes: Longest frame, bytes.
        max_frames: Frames kept of one message; of a longer one, ``max_frames + 1`` are passed on, which shows its
            length.
        most_queued: Messages queued for a peer that does not read.
        drops_oldest: A full queue drops its oldest message, not the new one.
        messages_per_wake: Messages passed on before other tasks of the loop run.
    """

    kind: bytes
    serves: frozenset[bytes]
    max_bytes: int
    max_frames: int = 1
    most_queued: int = 0
    drops_oldest: bool = False
    messages_per_wake: int = 16


class State(enum.Enum):
    """What the connection waits for; the values complete "the peer must send …"."""

    GREETING = "a greeting"
    READY = "READY first"
    HELLO = "HELLO first"
    INITIATE = "INITIATE after HELLO"
    OPEN = "messages and commands"
    CLOSED = "nothing more"


class Event(enum.Enum):
    """What `Connection.next_event` found, where it is no message."""

    NEED_DATA = "no complete frame"
    PART = "a step of the handshake, or a part of a message"
    READY = "the handshake is complete"
    COMMAND = "a command that needs nothing of the caller, such as a PING, which is answered"


class Connection:
    """One connection from the greeting to its end.

    Args:
        mechanism: Security mechanism of the handshake, without keys or with them.
        rules: Limits.

    Attributes:
        state: See `State`.
        kind: Socket type of the peer, once open.
        route: Name that the peer chose, once open; b"" if it chose none.
        unsent: Bytes to send next, about WRITE_BYTES at most.
    """

    def __init__(self, mechanism: Null, rules: PeerRules) -> None:
        self.state = State.GREETING
        self.kind = self.route = b""
        self._mechanism, self._rules = mechanism, rules
        self._seal = mechanism.seal
        self._received = bytearray()
        self._most_bytes = MAX_HANDSHAKE_BYTES
        self._frames: list[bytes] = []
        self._count = 0
        self.unsent = encode_greeting(mechanism.name, as_server=mechanism.name == b"CURVE")
        # unencoded, so that all slow subscribers share one copy of each message
        self._queue: deque[Message] = deque(maxlen=rules.most_queued if rules.drops_oldest else None)
        self._most_queued = sys.maxsize if rules.drops_oldest else rules.most_queued

    @property
    def key(self) -> bytes:
        """Key that the peer proved; b"" without keys."""
        return self._mechanism.key

    @property
    def waiting(self) -> int:
        """Number of messages to send, including a partially sent one."""
        return len(self._queue) + bool(self.unsent)

    def receive_data(self, data: bytes) -> None:
        """Append received bytes."""
        self._received += data

    def next_event(self) -> Event | list[bytes]:
        """Handle the next frame, and return the message that it completes or what else it was.

        Raises:
            ProtocolError: The peer violated the protocol or a limit; the connection is closed. What is left to send may
                contain the reason.
        """
        try:
            if self.state is State.GREETING:
                return self._greet()
            frame = next_frame(self._received, self._most_bytes)
            if frame is None:
                return Event.NEED_DATA
            if self.state is not State.OPEN:
                return self._handle(*frame)
            return self._handle(*self._mechanism.open(*frame))
        except ProtocolError as error:
            self.state = State.CLOSED
            if isinstance(error, KeyRefusedError):
                self.unsent += error.reply
            raise

    def send(self, message: Message) -> bool:
        """Encode a message, or queue it behind what is unsent; return False if the queue is full and drops none."""
        if not self.unsent:
            self.unsent = self._seal(message)
        elif len(self._queue) < self._most_queued:
            self._queue.append(message)
        else:
            return False
        return True

    def sent(self, count: int) -> bool:
        """Note how many of the unsent bytes were sent, and take more from the queue; return whether some are left."""
        self.unsent = self.unsent[count:]
        while self._queue and len(self.unsent) < WRITE_BYTES:
            self.unsent += self._seal(self._queue.popleft())
        return bool(self.unsent)

    def _greet(self) -> Event:
        if len(self._received) < GREETING_BYTES:
            return Event.NEED_DATA
        check_greeting(bytes(self._received[:GREETING_BYTES]), self._mechanism.name)
        del self._received[:GREETING_BYTES]
        self.state = State.HELLO if self._mechanism.name == b"CURVE" else State.READY
        return Event.PART

    def _handle(self, flags: int, body: bytes) -> Event | list[bytes]:
        """Handle a frame by the table of states."""
        kind: bytes | int = flags & MORE
        if flags & COMMAND:
            kind, body = decode_command(body)
        row = self._TABLE.get((self.state, kind))
        if row is None:
            if self.state is State.OPEN:  # a command of a later version
                return Event.COMMAND
            got = kind.decode(errors="replace") if isinstance(kind, bytes) else "a message"
            raise ProtocolError(f"the peer must send {self.state.value}, got {got:.20}")
        handle, self.state = row
        return handle(self, body)

    def _step(self, data: bytes) -> Event:
        self.unsent += self._mechanism.handshake(data)
        return Event.PART

    def _last_step(self, data: bytes) -> Event:
        self._step(data)
        properties = self._mechanism.properties
        self.kind, self.route = properties.get(b"socket-type", b""), properties.get(b"identity", b"")
        if self.kind not in self._rules.serves:
            raise ProtocolError(f"a {self.kind.decode(errors='replace')!r:.20} socket cannot connect here")
        if len(self.route) > _MAX_IDENTITY_BYTES or self.route[:1] == b"\0":
            raise ProtocolError("the identity of the peer is too long or begins with a zero byte")
        self._most_bytes = self._rules.max_bytes + (SEAL_BYTES if self.key else 0)
        return Event.READY

    def _part(self, frame: bytes) -> Event:
        self._count += 1
        if self._count > MOST_FRAMES:
            raise ProtocolError(f"a message has more than {MOST_FRAMES} frames")
        if len(self._frames) <= self._rules.max_frames:
            self._frames.append(frame)
        return Event.PART

    def _message(self, frame: bytes) -> list[bytes]:
        self._part(frame)
        frames, self._frames, self._count = self._frames, [], 0
        return frames

    def _ping(self, data: bytes) -> Event:
        """Answer a PING, unless something waits: answers must not pile up for a peer that does not read."""
        if not self.waiting:
            pong = encode_command(b"PONG", data[_PING_HEAD : _PING_HEAD + _MAX_PING_CONTEXT])
            self.unsent += self._seal((pong,), COMMAND)
        return Event.COMMAND

    def _fail(self, _: bytes) -> Event:
        raise ProtocolError("the peer reports an error")

    _TABLE: ClassVar[
        dict[tuple[State, bytes | int], tuple[Callable[[Connection, bytes], Event | list[bytes]], State]]
    ] = {
        (State.READY, b"READY"): (_last_step, State.OPEN),
        (State.HELLO, b"HELLO"): (_step, State.INITIATE),
        (State.INITIATE, b"INITIATE"): (_last_step, State.OPEN),
        (State.OPEN, MORE): (_part, State.OPEN),
        (State.OPEN, 0): (_message, State.OPEN),
        (State.OPEN, b"PING"): (_ping, State.OPEN),
        (State.OPEN, b"SUBSCRIBE"): (lambda _, prefix: [b"\x01" + prefix], State.OPEN),
        (State.OPEN, b"CANCEL"): (lambda _, prefix: [b"\x00" + prefix], State.OPEN),
        (State.OPEN, b"ERROR"): (_fail, State.CLOSED),
    }
    """State, and name of a command or flag of another frame → what handles it, and the next state.

    The greeting comes before. Nothing else is allowed before the connection is open; then other commands are ignored.
    SUBSCRIBE and CANCEL are passed on as the messages that they were before ZMTP 3.1.
    """
