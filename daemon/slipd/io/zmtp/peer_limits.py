"""Limit the requests of each peer, and the time of the event loop that it gets.

The time counts over all connections of a peer and across reconnects. An account is identified by what a peer cannot
choose: its key, its process (ipc) or its IP address (TCP without keys). All work for the peer is charged to its
account. When an account has used up its share, its connections wait: their data stays in the kernel, so the senders
wait too.
"""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict, deque
from collections.abc import Callable

SHARE = 0.1
"""Long-term share of the loop time for one account; a client with 50 requests per second needs a hundredth."""

BURST_S = 0.004
"""Time that an account may use at once, s: about fifty requests."""

MOST_ACCOUNTS = 1024
"""Accounts remembered; the one disconnected for longest is forgotten first, when its burst is full again."""


class TimeAccount:
    """The loop time of one peer.

    Args:
        name: Identity that the peer cannot choose.
        share: Long-term share of the loop time.
    """

    def __init__(self, name: bytes, share: float = SHARE) -> None:
        self.name = name
        self._share = share
        self._left_s = BURST_S
        self._counted_s = 0.0
        self._slots: set[int] = set()
        self._waiting: deque[Callable[[], None]] = deque()
        self._timer: asyncio.TimerHandle | None = None

    @property
    def connections(self) -> int:
        """Number of its connections."""
        return len(self._slots)

    def enter(self) -> int:
        """Add a connection and return its slot; slots of closed connections are reused."""
        slot = next(number for number in range(len(self._slots) + 1) if number not in self._slots)
        self._slots.add(slot)
        return slot

    def leave(self, slot: int) -> None:
        """Remove a connection."""
        self._slots.discard(slot)

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


_TURN_S = 0.0005
"""Shortest wait, s, so that other tasks of the loop run first."""


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
            gone = next((each for each, found in self._accounts.items() if not found.connections), None)
            if gone is not None:
                del self._accounts[gone]
        return account


MAX_CLIENTS = 1024
"""Clients remembered; the one that was silent for longest is forgotten first, when its bucket is full again."""


class RateLimit:
    """A token bucket for each client.

    Args:
        per_second: Requests per second of one client; it may send as many at once.
    """

    def __init__(self, per_second: float) -> None:
        self._per_s = per_second
        self._most = max(per_second, 1.0)
        self._buckets: OrderedDict[bytes, tuple[float, int]] = OrderedDict()  # tokens, and the time of their count

    def allows(self, client: bytes, t_ns: int) -> bool:
        """Return whether a client may send a request now; if so, count it."""
        tokens, counted_ns = self._buckets.pop(client, (self._most, t_ns))
        tokens = min(self._most, tokens + (t_ns - counted_ns) * 1e-9 * self._per_s)
        allowed = tokens >= 1.0
        self._buckets[client] = (tokens - allowed, t_ns)
        if len(self._buckets) > MAX_CLIENTS:
            self._buckets.popitem(last=False)
        return allowed
