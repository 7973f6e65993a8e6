"""One connection of a peer, from the greeting to its end: received bytes become messages.

Only the bytes of one read, one frame, and the first frames of one message are kept. All work for the peer is charged to
its account.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable

from slipd.io.zmtp.loop_time_accounts import TimeAccount
from slipd.io.zmtp.mechanisms import MAX_HANDSHAKE_BYTES, SEAL_BYTES, KeyRefusedError, Mechanism
from slipd.io.zmtp.outbox import Message, Outbox
from slipd.io.zmtp.peer_rules import PeerRules
from slipd.io.zmtp.wire import (
    COMMAND,
    GREETING_BYTES,
    MORE,
    FrameReader,
    ProtocolError,
    check_greeting,
    decode_command,
    encode_command,
    encode_greeting,
)

READ_BYTES = 32 * 1024
"""Most bytes read from the kernel at once."""

WAKE_S = 0.001
"""Time after which other tasks of the loop run, s."""

MOST_FRAMES = 10_000
"""Most frames of one message; a peer that sends more is disconnected."""

_MAX_PING_CONTEXT = 16
_PING_HEAD = 2  # time to live
_MAX_IDENTITY_BYTES = 255


class Peer:
    """A connection from the greeting to its end.

    Args:
        connection: The non-blocking socket, which the peer owns from here on.
        address: Identity that the peer cannot choose: its process (":user:group:process") or its IP address.
        account: Account to charge until the peer proves a key.
        mechanism: Security mechanism of the handshake.
        rules: Limits.
        on_ready: Called after the handshake; a `ProtocolError` that it raises ends the connection.
        on_message: Called with each message.
        on_close: Called once, when the connection ends.

    Attributes:
        address: As above.
        route: Name that the peer chose; b"" if it chose none.
        kind: Socket type of the peer, after the handshake.
        fileno: Descriptor of the connection.
        slot: Number of the connection within its account.
        send: Sends a message, or queues it until the peer reads; returns False if it is dropped (`Outbox.send`).
        ready: Whether the handshake is complete.
        closed: Whether the connection has ended.
        reason: Why this side ended the connection; "" if the peer did.
    """

    def __init__(
        self,
        connection: socket.socket,
        address: bytes,
        account: TimeAccount,
        mechanism: Mechanism,
        rules: PeerRules,
        on_ready: Callable[[Peer], None],
        on_message: Callable[[Peer, list[bytes]], None],
        on_close: Callable[[Peer], None],
    ) -> None:
        self.address, self.route, self.kind = address, b"", b""
        self.account, self.slot = account, account.enter()
        self.closed, self.reason = False, ""
        self.ready = False
        self._connection, self.fileno = connection, connection.fileno()
        self._mechanism, self._rules = mechanism, rules
        self._on_ready, self._on_message, self._on_close = on_ready, on_message, on_close
        self._loop = asyncio.get_running_loop()
        self._reader = FrameReader(MAX_HANDSHAKE_BYTES)
        self._greeted = False
        self._frames: list[bytes] = []
        self._count = 0
        self._behind = False  # complete frames wait in the reader
        self._outbox = Outbox(
            connection, mechanism.seal, rules.most_queued, drops_oldest=rules.drops_oldest, on_gone=self.close
        )
        self.send: Callable[[Message], bool] = self._outbox.send
        self._outbox.send_now(encode_greeting(mechanism.name, as_server=mechanism.name == b"CURVE"))
        if not self.closed:
            self._loop.add_reader(self.fileno, self._run)

    @property
    def key(self) -> bytes:
        """Key that the peer proved; b"" without keys."""
        return self._mechanism.key

    @property
    def waiting(self) -> int:
        """Number of messages queued until the peer reads."""
        return self._outbox.waiting

    @property
    def sent_bytes(self) -> int:
        """Bytes that the kernel accepted for the peer."""
        return self._outbox.sent_bytes

    def move(self, account: TimeAccount) -> None:
        """Charge another account from now on, because the peer proved its identity."""
        self.account.leave(self.slot)
        self.account, self.slot = account, account.enter()

    def flush(self) -> None:
        """Pass as much of the queue to the kernel as it accepts."""
        self._outbox.flush()

    def is_gone(self) -> bool:
        """Return whether the peer has closed its side; if so, close the connection."""
        if not self.closed:
            try:
                gone = not self._connection.recv(1, socket.MSG_PEEK)
            except (BlockingIOError, InterruptedError):
                gone = False
            except OSError:
                gone = True
            if gone:
                self.close()
        return self.closed

    def close(self, reason: str = "") -> None:
        """End the connection."""
        if self.closed:
            return
        self.closed, self.reason = True, reason
        self._loop.remove_reader(self.fileno)
        self._outbox.close()
        self._connection.close()
        self.account.leave(self.slot)
        self._on_close(self)

    def _run(self) -> None:
        """Handle received bytes while the account has time; then other tasks of the loop run."""
        if self.closed:
            return
        begin_s = time.monotonic()
        account = self.account
        if not account.has_time(begin_s):
            self._pause()
            return
        done = False
        try:
            if not self._behind:
                self._receive()
            done = self._work(begin_s + WAKE_S)
        except ProtocolError as error:
            if isinstance(error, KeyRefusedError):
                self._outbox.send_now(error.reply)
            self.close(str(error))
        finally:
            account.charge(time.monotonic() - begin_s)
            if not self.closed:
                self._schedule(done)

    def _schedule(self, done: bool) -> None:
        if done and self._behind:
            self._behind = False
            self._loop.add_reader(self.fileno, self._run)
        elif not done:
            if not self._behind:
                self._behind = True
                self._loop.remove_reader(self.fileno)
            self._loop.call_soon(self._run)

    def _pause(self) -> None:
        """Stop reading until the account has time again."""
        if not self._behind:
            self._loop.remove_reader(self.fileno)
        self.account.wait(self._resume)

    def _resume(self) -> None:
        if self.closed:
            return
        if not self._behind:
            self._loop.add_reader(self.fileno, self._run)
        self._run()

    def _receive(self) -> None:
        try:
            data = self._connection.recv(READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:  # the peer is gone
            self.close()
            return
        if data:
            self._reader.feed(data)
        else:
            self.close()

    def _work(self, until_s: float) -> bool:
        """Handle complete frames; return False if some are left for later."""
        if not self._greeted and not self._read_greeting():
            return True
        left = self._rules.messages_per_wake
        while not self.closed:
            frame = self._reader.next()
            if frame is None:
                return True
            if self._handle_frame(*frame):
                left -= 1
                if left <= 0:
                    return False
            if time.monotonic() > until_s:
                return False
        return True

    def _read_greeting(self) -> bool:
        greeting = self._reader.read(GREETING_BYTES)
        if greeting is None:
            return False
        check_greeting(greeting, self._mechanism.name)
        self._greeted = True
        return True

    def _handle_frame(self, flags: int, body: bytes) -> bool:
        """Handle one frame; return whether it completed a message."""
        if not self.ready:
            self._shake_hands(flags, body)
            return False
        flags, body = self._mechanism.open(flags, body)
        if flags & COMMAND:
            return self._handle_command(body)
        self._count += 1
        if self._count > MOST_FRAMES:
            raise ProtocolError(f"a message has more than {MOST_FRAMES} frames")
        if len(self._frames) <= self._rules.max_frames:
            self._frames.append(body)
        if flags & MORE:
            return False
        frames, self._frames, self._count = self._frames, [], 0
        self._on_message(self, frames)
        return True

    def _shake_hands(self, flags: int, body: bytes) -> None:
        if not flags & COMMAND:
            raise ProtocolError("a message came before the end of the handshake")
        self._outbox.send_now(self._mechanism.handshake(body))
        properties = self._mechanism.properties
        if properties is None or self.closed:
            return
        kind = properties.get(b"socket-type", b"")
        if kind not in self._rules.serves:
            raise ProtocolError(f"a {kind.decode(errors='replace')!r:.20} socket cannot connect here")
        self.kind, self.route = kind, properties.get(b"identity", b"")
        if len(self.route) > _MAX_IDENTITY_BYTES or self.route[:1] == b"\0":
            raise ProtocolError("the identity of the peer is too long or begins with a zero byte")
        sealing = SEAL_BYTES if self.key else 0
        self._reader.most_bytes = self._rules.max_bytes + sealing
        self._on_ready(self)
        self.ready = True

    def _handle_command(self, body: bytes) -> bool:
        """Handle a command; return whether it counts as a message."""
        name, data = decode_command(body)
        if name == b"PING":
            if not self.waiting:  # answers must not pile up for a peer that does not read
                pong = encode_command(b"PONG", data[_PING_HEAD : _PING_HEAD + _MAX_PING_CONTEXT])
                self._outbox.send_now(self._mechanism.seal((pong,), COMMAND))
        elif name == b"SUBSCRIBE":
            self._on_message(self, [b"\x01" + data])
        elif name == b"CANCEL":
            self._on_message(self, [b"\x00" + data])
        elif name == b"ERROR":
            raise ProtocolError("the peer reports an error")
        return True
