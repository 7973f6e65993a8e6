"""Decide when a stream is stale: its readings are missing, not merely unread by a daemon that stood still.

Silence and age count against a stream only for the time in which the daemon read its line. From a gap between the
daemon's ticks until its lines are read empty (see `slipd.engine.lateness`), that time is taken off both.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from slipd.samples import WrenchSample


class Arrival(NamedTuple):
    """How the readings of one read reached the daemon.

    Attributes:
        waited_ns: How long they may have waited to be read; 0 while the daemon runs freely.
        unread_ns: For how long another line that brought nothing counts as unread by then; None: it is empty.
        dated: Their times are those of a clock, not of their receipt.
    """

    waited_ns: int = 0
    unread_ns: int | None = None
    dated: bool = True


PROMPT = Arrival()


class Freshness:
    """Age and silence of one stream.

    Args:
        stale_ns: Longest age of a usable reading, and longest silence.

    Attributes:
        came_ns: When the newest reading reached this host, as far as is known; None before the first.
    """

    def __init__(self, stale_ns: int) -> None:
        self.stale_ns = stale_ns
        self.came_ns: int | None = None
        self._received_ns = 0

    def update(self, received_ns: int, acquired_ns: int, arrival: Arrival = PROMPT) -> None:
        """Update with the newest reading.

        One that waited reached the host long before it was read. A reading that is not late reaches it within
        ``stale_ns`` of its acquisition, so a stream that stopped during a stall is stale once the lines are empty.
        """
        self._received_ns = received_ns
        if arrival.waited_ns and arrival.dated:
            received_ns = min(received_ns, acquired_ns + self.stale_ns)
        self.came_ns = received_ns

    def silent_ns(self, t_ns: int, unread_ns: int | None = None) -> int:
        """Return for how long the daemon read the line and nothing came, ns; 0 before the first reading.

        Args:
            t_ns: Now.
            unread_ns: For how long the line counts as unread; None: it is empty, so what was read last came last.
        """
        if self.came_ns is None:
            return 0
        return t_ns - (self.came_ns if unread_ns is None else self._received_ns + unread_ns)

    def is_stale(self, t_ns: int, unread_ns: int | None = None) -> bool:
        """Return whether readings are missing, see `silent_ns`; before the first they are."""
        return self.came_ns is None or self.silent_ns(t_ns, unread_ns) > self.stale_ns


class HeldRead(NamedTuple):
    """The arguments of `Finger.decide`."""

    samples: Sequence[WrenchSample]
    times_ns: Sequence[int]
    arrival: Arrival


class HeldReads:
    """Force readings that wait for the image of their time.

    After a stall both lines hold readings, and the force may be read first. To judge it on the image from before the
    stall would call safe what nobody saw; to judge it without would call a healthy pad silent.
    """

    def __init__(self) -> None:
        self._reads: deque[HeldRead] = deque()

    def __len__(self) -> int:
        return len(self._reads)

    def hold(self, read: HeldRead) -> None:
        """Add a read to those that wait."""
        self._reads.append(read)

    def clear(self) -> None:
        """Forget the reads: their stream ended."""
        self._reads.clear()

    def release(self, serves_until_ns: int | None) -> Iterator[HeldRead]:
        """Yield the reads that need not wait any more, in order.

        Args:
            serves_until_ns: Latest time of a reading that the newest image serves; None: no image is awaited.
        """
        while self._reads and (serves_until_ns is None or self._reads[0].times_ns[-1] <= serves_until_ns):
            yield self._reads.popleft()
