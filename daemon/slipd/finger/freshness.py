"""Decide when a stream is stale: its readings are missing, not merely unread because the daemon stalled.

The instants of one reading, and what lies between them::

    acquired        came              received            now (t_ns)
       |-- the line --|---- waited -----|------ silent -----|
       |                                                    |
       |------------------------ age -----------------------|

``acquired``: the sensor measured. ``came``: the reading reached this host. ``received``: the daemon read it, which is
later than ``came`` only after a stall. A stall is a gap between the daemon's ticks; from its begin until the lines are
read empty, bytes may wait and a line that brought nothing is *unread* (see `slipd.links.lateness`)::

    tick      stall       tick        lines read empty
     |---- late ---------->|                 |
     |---------------- unread --------------->|

Silence and age count against a stream only for the time in which the daemon read its line.
"""

from __future__ import annotations

from typing import NamedTuple


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
