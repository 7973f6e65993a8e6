"""A bed whose loop reads what waited as a real one does.

It reads a piece of each line a turn, with ticks between, until all are empty.
"""

from __future__ import annotations

from nanoseconds import MS
from simulation.bed import TICK_EVERY, Bed
from simulation.line import Line

from slipd.events import Bytes, Tick
from slipd.finger.freshness import LATE_NS

PIECE_BYTES = 1024
"""Most that is read of a line in one turn of the loop, as by the transports."""


class SlowReader(Bed):
    """A bed whose loop reads what waited in pieces.

    Attributes:
        force_first: In each turn force sensors are read before pads.
        tick_first: After a stall the tick comes before the first read.
        overloaded: It never finds the lines empty.
    """

    force_first = True
    tick_first = False
    overloaded = False
    _behind = False
    _late_ns = 0

    def stop(self, ms: float) -> None:
        """The loop stands still."""
        until_ns = self.t_ns + round(ms * MS)
        self._late_ns += round(ms * MS)
        while self.t_ns < until_ns:
            self._world_goes_on()

    def go_on(self) -> None:
        """It runs again, and finds the time of its first turn."""
        self._behind = self._late_ns > LATE_NS
        if self._behind and self.tick_first:
            self.feed(Tick(self.suspended_ns, unread=True))
        self._late_ns = 0

    def stall(self, seconds: float) -> None:
        """The loop stands still for a while, and goes on."""
        self.stop(1000 * seconds)
        self.go_on()

    def catch_up(self) -> None:
        """It reads until all lines are empty."""
        while self._behind:
            self.step()

    def step(self) -> None:
        self._steps += 1
        self._world_goes_on()
        lines = sorted(self.lines.values(), key=lambda line: (line.link.endswith("pad") == self.force_first, line.link))
        found = [self._read(line) for line in lines]
        ticks = self._steps % TICK_EVERY == 0
        if self._behind and not any(found) and not self.overloaded:
            self._behind, ticks = False, True
        if ticks:
            self.feed(Tick(self.suspended_ns, unread=self._behind or self.overloaded))
            if not self._behind:
                self.watch.tick(self.t_ns)

    def _read(self, line: Line) -> bool:
        """Read a piece of a line; True where more may wait behind it."""
        pieces, size = [], 0
        while line.queue and line.queue[0][0] <= self.t_ns and size < PIECE_BYTES:
            pieces.append(line.queue.popleft())
            size += len(pieces[-1][2])
        data = b"".join(piece[2] for piece in pieces)
        if data and line.listener.receive(data, self.t_ns):
            self.watch.fresh(line.link, pieces[-1][1])
        if data and line.up:
            self.feed(Bytes(line.link, data))
        return size >= PIECE_BYTES
