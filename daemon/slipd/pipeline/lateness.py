"""How late the daemon itself is: what it reads after it stood still may have waited as long."""

from __future__ import annotations

from slipd.pipeline.events import Event, Tick

#: Ticks come every few milliseconds; a longer silence than this is a daemon that stood still.
STALL_NS = 25_000_000
#: After a stall several reads empty what has waited; what comes later was sent later.
CATCH_UP_NS = 10_000_000
#: The worst stall is told for so long.
TOLD_NS = 1_000_000_000


class Lateness:
    """Watches the ticks.

    Attributes:
        late_ns: How long bytes that are read now may have waited; 0 while the daemon runs freely.
    """

    def __init__(self) -> None:
        self.late_ns = 0
        self._tick_ns: int | None = None
        self._until_ns = 0
        self._worst: tuple[int, int] = (0, 0)

    def note(self, event: Event, t_ns: int) -> None:
        """Takes the time of an event, before the event is handled."""
        stall_ns = 0 if self._tick_ns is None else t_ns - self._tick_ns
        if stall_ns > STALL_NS:
            self.late_ns, self._until_ns = stall_ns, t_ns + CATCH_UP_NS
            if stall_ns > self.worst_ns(t_ns):
                self._worst = (stall_ns, t_ns)
        elif self.late_ns and t_ns > self._until_ns:
            self.late_ns = 0
        if isinstance(event, Tick):
            self._tick_ns = t_ns

    def worst_ns(self, t_ns: int) -> int:
        """The longest stall of late, ns."""
        stall_ns, at_ns = self._worst
        return stall_ns if t_ns - at_ns <= TOLD_NS else 0
