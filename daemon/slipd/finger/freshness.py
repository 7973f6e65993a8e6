"""Decide when a stream is stale and when the daemon is late: readings that are missing, and those that are unread.

The instants of one reading, and what lies between them::

    acquired        came              received            now (t_ns)
       |-- the line --|---- waited -----|------ silent -----|
       |                                                    |
       |------------------------ age -----------------------|

``acquired``: the sensor measured. ``came``: the reading reached this host. ``received``: the daemon read it, which is
later than ``came`` only after a stall. A stall is a gap between the daemon's ticks; from its begin until the lines are
read empty, bytes may wait and a line that brought nothing is *unread* (see `Lateness`)::

    tick      stall       tick        lines read empty
     |---- late ---------->|                 |
     |---------------- unread --------------->|

Silence and age count against a stream only for the time in which the daemon read its line.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from slipd.events import Event, Tick

LATE_NS = 10_000_000
"""Least gap between ticks that counts as a stall. Ticks come every 5 ms; no stream is stale before twice this gap."""
LEAST_CATCH_UP_NS, MOST_CATCH_UP_NS = 100_000_000, 1_000_000_000
"""After a stall a line without readings counts as unread for as long as the stall, within these bounds. A daemon that
has not caught up by then is overloaded, and a dead sensor must not hide behind that."""
LONGEST_WAIT_NS = 1_000_000_000
"""A reading that waited longer is stale: its verdict would come too late."""
SHOWN_NS = 1_000_000_000
"""The worst stall is reported for this long."""


class Arrival(NamedTuple):
    """How the readings of one read reached the daemon.

    Attributes:
        waited_ns: How long they may have waited to be read; 0 without a stall.
        unread_ns: How long another line that brought nothing counts as unread by then; None: it is empty.
        dated: Their times are those of a device clock, not of their receipt.
        late_ns: The longest stall since the lines were last read empty; 0 without one.
    """

    waited_ns: int = 0
    unread_ns: int | None = None
    dated: bool = True
    late_ns: int = 0


PROMPT = Arrival()
"""The daemon did not stall."""


class Read(NamedTuple):
    """Readings of one stream that came in one read.

    Attributes:
        samples: The readings that fit the config, at least one.
        times_ns: When each was acquired, CLOCK_MONOTONIC.
        arrival: How they reached the daemon.
        stream: Name of the stream.
    """

    samples: Sequence[Any]
    times_ns: Sequence[int]
    arrival: Arrival = PROMPT
    stream: str = ""


class Freshness:
    """Age and silence of one stream, kept where its readings are judged.

    Args:
        stale_ns: Longest age of a usable reading, and longest silence.

    Attributes:
        came_ns: When the newest reading reached this host, as far as is known; None before the first.
        received_ns: When the newest reading was read; 0 before the first.
        acquired_ns: When it was acquired; 0 before the first.
        unread_ns: As in its `Arrival`.
        late: It was already too old when it came, by more than it waited for the daemon.
    """

    def __init__(self, stale_ns: int) -> None:
        self.stale_ns = stale_ns
        self.came_ns: int | None = None
        self.received_ns = self.acquired_ns = 0
        self.unread_ns: int | None = None
        self.late, self._dated = False, True

    def update(self, received_ns: int, acquired_ns: int, arrival: Arrival = PROMPT) -> None:
        """Update with the newest reading; after a late one, only one that came in time is not late.

        A reading that waited reached the host long before it was read. One that is not late reaches it within
        ``stale_ns`` of its acquisition, so a stream that stopped during a stall is stale once the lines are empty.
        """
        waited_ns, self.unread_ns, self._dated, _ = arrival
        self.received_ns, self.acquired_ns, self.came_ns = received_ns, acquired_ns, received_ns
        excused_ns = 0 if self.late and arrival.dated else waited_ns
        self.late = received_ns - acquired_ns - excused_ns > self.stale_ns
        if waited_ns and arrival.dated:
            self.came_ns = min(received_ns, acquired_ns + self.stale_ns)

    def silent_ns(self, t_ns: int, unread_ns: int | None = None) -> int:
        """Return for how long the daemon read the line and nothing came, ns; 0 before the first reading.

        Args:
            t_ns: Now.
            unread_ns: How long the line counts as unread; None: it is empty, so the reading that was read last came
                last.
        """
        if self.came_ns is None:
            return 0
        return t_ns - (self.came_ns if unread_ns is None else self.received_ns + unread_ns)

    def is_stale(self, t_ns: int, unread_ns: int | None = None) -> bool:
        """Return whether readings are missing (see `silent_ns`); True before the first."""
        return self.came_ns is None or self.silent_ns(t_ns, unread_ns) > self.stale_ns

    def age_s(self, t_ns: int) -> float | None:
        """Return the age of the newest reading, s; None before the first."""
        return None if self.came_ns is None else (t_ns - self.acquired_ns) * 1e-9

    def serves_until_ns(self, since_ns: int) -> int | None:
        """Return the latest acquisition time of a force reading that the newest image serves; None: any.

        An image without a device time that was read after a stall serves any reading, as the time of its acquisition
        is not known.

        Args:
            since_ns: The force readings waited from here on.
        """
        if not self._dated and (self.came_ns or 0) > since_ns:
            return None
        return self.acquired_ns + self.stale_ns


def pop_served(reads: deque[Read], until_ns: int | None, t_ns: int, unread_ns: int | None) -> Iterator[Read]:
    """Remove and yield the reads that the newest image serves, with the time that they have waited by now.

    After a stall both lines of a finger hold readings, and the force may be read first. A verdict with the image from
    before the stall could call a slipping grip safe, and one without an image would report a healthy pad as silent.

    Args:
        reads: Reads of a force sensor that wait for the image of their time.
        until_ns: Latest acquisition time that it serves; None: any, as no image is awaited.
        t_ns: Now.
        unread_ns: How long the image's line counts as unread; None: it is empty.
    """
    while reads and (until_ns is None or reads[0].times_ns[-1] <= until_ns):
        read = reads.popleft()
        waited_ns = read.arrival.waited_ns + t_ns - read.samples[-1].t_ns
        yield read._replace(arrival=Arrival(waited_ns, unread_ns, read.arrival.dated))


class Lateness:
    """Measures the gaps between ticks.

    Attributes:
        first_ns: Time of the first event; None before it.
        late_ns: The longest stall since the lines were last read empty; 0 without one.
        slewed_ns: How far NTP has slewed CLOCK_MONOTONIC since the first tick.
        paused_ns: Time between the last two events.
    """

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self.late_ns = 0
        self.slewed_ns = self.paused_ns = self._event_ns = 0
        self._ahead_ns: int | None = None  # CLOCK_MONOTONIC less CLOCK_MONOTONIC_RAW at the first tick
        self._tick_ns: int | None = None
        self._since_ns = self._unread_since_ns = self._unread_until_ns = 0
        self._worst: tuple[int, int] = (0, 0)

    def update(self, event: Event, t_ns: int) -> None:
        """Update with the time of an event, before the event is handled."""
        if self.first_ns is None:
            self.first_ns = t_ns
        self.paused_ns, self._event_ns = t_ns - self._event_ns, t_ns
        if self._tick_ns is not None and t_ns - self._tick_ns > LATE_NS:
            self._stall(self._tick_ns, t_ns)
        if isinstance(event, Tick):
            self._tick_ns = t_ns
            if not event.unread:
                self.late_ns = 0
            if event.raw_ns:
                ahead_ns = t_ns - event.raw_ns
                self._ahead_ns = ahead_ns if self._ahead_ns is None else self._ahead_ns
                self.slewed_ns = ahead_ns - self._ahead_ns

    def unread_ns(self, t_ns: int) -> int | None:
        """Return for how long until ``t_ns`` a line that brought nothing counts as unread; None: it is empty."""
        if not self.late_ns:
            return None
        return t_ns - self._unread_since_ns if t_ns <= self._unread_until_ns else 0

    def arrival(self, t_ns: int) -> Arrival:
        """Return how bytes that are read at ``t_ns`` reached the daemon: they may wait since the lines were empty."""
        if not self.late_ns:
            return PROMPT
        return Arrival(min(t_ns - self._since_ns, LONGEST_WAIT_NS), self.unread_ns(t_ns), late_ns=self.late_ns)

    def worst_ns(self, t_ns: int) -> int:
        """Return the longest stall of the last second, ns."""
        stall_ns, at_ns = self._worst
        return stall_ns if t_ns - at_ns <= SHOWN_NS else 0

    def _stall(self, tick_ns: int, t_ns: int) -> None:
        stall_ns = t_ns - tick_ns
        if not self.late_ns:
            self._since_ns = tick_ns
        if not self.late_ns or t_ns > self._unread_until_ns:
            self._unread_since_ns = tick_ns
            self._unread_until_ns = t_ns + min(max(stall_ns, LEAST_CATCH_UP_NS), MOST_CATCH_UP_NS)
        self.late_ns = max(self.late_ns, stall_ns)
        if stall_ns > self.worst_ns(t_ns):
            self._worst = (stall_ns, t_ns)
