"""The socket of one connection, and the time of the event loop that its peer gets.

Bytes go to the protocol (`slipd.io.zmtp.connection`), and its messages to the endpoint. All work for a peer is charged
to its account, over all of its connections and across reconnects. An account is identified by what a peer cannot
choose: its key, its process (ipc) or its IP address (TCP without keys). When an account has used up its share, its
connections wait: their data stays in the kernel, so the senders wait too.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections import OrderedDict, deque
from collections.abc import Callable

from slipd.io.zmtp.connection import Connection, Event, Message
from slipd.io.zmtp.wire import ProtocolError

READ_BYTES = 32 * 1024
"""Most bytes read from the kernel at once."""

WAKE_S = 0.001
"""Time after which other tasks of the loop run, s."""


SHARE = 0.1
"""Long-term share of the loop time for one account; a client with 50 requests per second needs a hundredth."""

BURST_S = 0.004
"""Time that an account may use at once, s: about fifty requests."""

MOST_ACCOUNTS = 1024
"""Accounts remembered; the one disconnected for longest is forgotten first, when its burst is full again."""


_TURN_S = 0.0005
"""Shortest wait, s, so that other tasks of the loop run first."""


class TimeAccount:
    """The loop time of one peer.

    Args:
        name: Identity that the peer cannot choose.
        share: Long-term share of the loop time.

    Attributes:
        name: As above.
        slots: Numbers of its connections.
    """

    def __init__(self, name: bytes, share: float = SHARE) -> None:
        self.name = name
        self._share = share
        self._left_s = BURST_S
        self._counted_s = 0.0
        self.slots: set[int] = set()
        self._waiting: deque[Callable[[], None]] = deque()
        self._timer: asyncio.TimerHandle | None = None

    def enter(self) -> int:
        """Add a connection and return its slot; slots of closed connections are reused."""
        slot = next(number for number in range(len(self.slots) + 1) if number not in self.slots)
        self.slots.add(slot)
        return slot

    def has_time(self, now_s: float) -> bool:
        """Return whether the account has time left now."""
        self._left_s = min(BURST_S, self._left_s + (now_s - self._counted_s) * self._share)
        self._counted_s = now_s
        return self._left_s > 0.0

    def charge(self, took_s: float) -> None:
        """Charge time to the account, s."""
        self._left_s -= took_s

    def wait(self, resume: Callable[[], None]) -> None:
        """Call ``resume`` when the account has time again; waiting callbacks are called in order."""
        self._waiting.append(resume)
        if self._timer is None:
            self._arm()

    def _arm(self) -> None:
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(max(-self._left_s, 0.0) / self._share + _TURN_S, self._turn)

    def _turn(self) -> None:
        self._timer = None
        try:
            while self._waiting and self.has_time(time.monotonic()):
                self._waiting.popleft()()
        finally:
            if self._waiting:
                self._arm()


class TimeAccounts:
    """The accounts of one endpoint, by name."""

    def __init__(self, share: float = SHARE) -> None:
        self._share = share
        self._accounts: OrderedDict[bytes, TimeAccount] = OrderedDict()

    def of(self, name: bytes) -> TimeAccount:
        """Return the account of a peer; a new one starts with a full burst."""
        account = self._accounts.pop(name, None) or TimeAccount(name, self._share)
        self._accounts[name] = account
        if len(self._accounts) > MOST_ACCOUNTS:
            gone = next((each for each, found in self._accounts.items() if not found.slots), None)
            if gone is not None:
                del self._accounts[gone]
        return account


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
        self._unsent = False
        self._done = True  # no complete frame is left of the last read
        self._loop.add_reader(self.fileno, self._run)
        self.flush()

    def move(self, account: TimeAccount) -> None:
        """Charge another account from now on, because the peer proved its identity."""
        self.account.slots.discard(self.slot)
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
        self._loop.remove_reader(self.fileno)
        self._loop.remove_writer(self.fileno)
        self._socket.close()
        self.account.slots.discard(self.slot)
        self._on_close(self)

    def _run(self) -> None:
        """Read and handle frames while the account has time; then other tasks of the loop run."""
        begin_s = time.monotonic()
        account = self.account
        if not account.has_time(begin_s):
            self._loop.remove_reader(self.fileno)
            account.wait(self._go_on)
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
            if not self.closed and not self._done:
                self._loop.remove_reader(self.fileno)
                self._loop.call_soon(self._go_on)

    def _go_on(self) -> None:
        """Listen again, and handle what is left."""
        if not self.closed:
            self._loop.add_reader(self.fileno, self._run)
            self._run()

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
