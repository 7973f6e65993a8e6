"""The socket of one connection: bytes go to the protocol and its messages to the endpoint, within the peer's time.

`slipd.io.zmtp.connection` is the protocol. All work for the peer is charged to its account.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable

from slipd.io.zmtp.connection import Connection, Event, Message
from slipd.io.zmtp.peer_limits import TimeAccount
from slipd.io.zmtp.wire import ProtocolError

READ_BYTES = 32 * 1024
"""Most bytes read from the kernel at once."""

WAKE_S = 0.001
"""Time after which other tasks of the loop run, s."""


class Peer:
    """A connection from the greeting to its end.

    Args:
        connected: The non-blocking socket, which the peer owns from here on.
        address: Identity that the peer cannot choose: its process (":user:group:process") or its IP address.
        account: Account to charge until the peer proves a key.
        protocol: The protocol of the connection.
        messages_per_wake: Messages passed on before other tasks of the loop run.
        on_ready: Called after the handshake; a `ProtocolError` that it raises ends the connection.
        on_message: Called with each message; likewise.
        on_close: Called once, when the connection ends.

    Attributes:
        address: As above.
        protocol: As above.
        fileno: Descriptor of the connection.
        slot: Number of the connection within its account.
        sent_bytes: Bytes that the kernel accepted for the peer.
        closed: Whether the connection has ended.
        reason: Why this side ended the connection; "" if the peer did.
    """

    def __init__(
        self,
        connected: socket.socket,
        address: bytes,
        account: TimeAccount,
        protocol: Connection,
        messages_per_wake: int,
        on_ready: Callable[[Peer], None],
        on_message: Callable[[Peer, list[bytes]], None],
        on_close: Callable[[Peer], None],
    ) -> None:
        self.address, self.account, self.slot = address, account, account.enter()
        self.closed, self.reason = False, ""
        self.sent_bytes = 0
        self._socket, self.fileno = connected, connected.fileno()
        self.protocol, self._messages_per_wake = protocol, messages_per_wake
        self._on_ready, self._on_message, self._on_close = on_ready, on_message, on_close
        self._loop = asyncio.get_running_loop()
        self._unsent = self._listening = False
        self._done = True  # no complete frame is left of the last read
        self._listen(on=True)
        self.flush()

    def move(self, account: TimeAccount) -> None:
        """Charge another account from now on, because the peer proved its identity."""
        self.account.leave(self.slot)
        self.account, self.slot = account, account.enter()

    def send(self, message: Message) -> bool:
        """Send a message, or queue it until the peer reads; return False if it is dropped."""
        if self.closed or not self.protocol.send(message):
            return False
        if not self._unsent:
            self.flush()
        return True

    def flush(self) -> None:
        """Pass as much to the kernel as it accepts; the loop calls this again when it accepts more."""
        data = self.protocol.unsent
        if self.closed or not data:
            return
        try:
            sent = self._socket.send(data)
        except (BlockingIOError, InterruptedError):
            sent = 0
        except OSError:  # the peer is gone
            self.close()
            return
        self.sent_bytes += sent
        unsent = self.protocol.sent(sent)
        if unsent is not self._unsent:
            self._unsent = unsent
            if unsent:
                self._loop.add_writer(self.fileno, self.flush)
            else:
                self._loop.remove_writer(self.fileno)

    def is_gone(self) -> bool:
        """Return whether the peer has closed its side; if so, close the connection."""
        try:
            if not self.closed and not self._socket.recv(1, socket.MSG_PEEK):
                self.close()
        except (BlockingIOError, InterruptedError):
            return False
        except OSError:
            self.close()
        return self.closed

    def close(self, reason: str = "") -> None:
        """End the connection."""
        if self.closed:
            return
        self.closed, self.reason = True, reason
        self._listen(on=False)
        self._loop.remove_writer(self.fileno)
        self._socket.close()
        self.account.leave(self.slot)
        self._on_close(self)

    def _run(self) -> None:
        """Read and handle frames while the account has time; then other tasks of the loop run."""
        if self.closed:
            return
        begin_s = time.monotonic()
        account = self.account
        if not account.has_time(begin_s):
            self._listen(on=False)
            account.wait(self._run)
            return
        was_done, self._done = self._done, False
        try:
            if was_done:
                self._receive()
            self._done = self._handle_frames(begin_s + WAKE_S)
        except ProtocolError as error:
            self.flush()
            self.close(str(error))
        finally:
            account.charge(time.monotonic() - begin_s)
            if not self.closed:
                self._listen(on=self._done)
                if not self._done:
                    self._loop.call_soon(self._run)

    def _listen(self, *, on: bool) -> None:
        """Let the loop call `_run` when bytes arrive, or not."""
        if on is not self._listening:
            self._listening = on
            if on:
                self._loop.add_reader(self.fileno, self._run)
            else:
                self._loop.remove_reader(self.fileno)

    def _receive(self) -> None:
        try:
            data = self._socket.recv(READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:  # the peer is gone
            data = b""
        if data:
            self.protocol.receive_data(data)
        else:
            self.close()

    def _handle_frames(self, until_s: float) -> bool:
        """Handle complete frames; return False if some may be left."""
        left = self._messages_per_wake
        while not self.closed:
            event = self.protocol.next_event()
            if event is Event.NEED_DATA:
                break
            if event is Event.READY:
                self._on_ready(self)
            if isinstance(event, list):
                self._on_message(self, event)
            elif not self._unsent:
                self.flush()  # answers to the handshake and to pings
            left -= event is not Event.PART
            if left <= 0 or time.monotonic() > until_s:
                return False
        return True
