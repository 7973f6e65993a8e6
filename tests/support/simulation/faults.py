"""Faults of a line: bytes dropped, split, delayed, changed or added, drawn from the bed's random numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from nanoseconds import MS
from simulation.line import Fault

Pieces = list[tuple[int, bytes]]


@dataclass
class Split(Fault):
    """Every read brings as much as it likes, down to single bytes."""

    rng: Random
    most: int = 24

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        pieces, at = [], 0
        while at < len(data):
            length = self.rng.randint(1, self.most)
            pieces.append((now_ns, data[at : at + length]))
            at += length
        return pieces


@dataclass
class Bunch(Fault):
    """An adapter hands over what it has every so often, as USB serial adapters do."""

    period_ns: int = 16 * MS

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [(-(-now_ns // self.period_ns) * self.period_ns, data)]


@dataclass
class Delay(Fault):
    """Everything comes late by the same time, longer than the device's clock can tell from the beginning."""

    delay_ns: int

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [(now_ns + self.delay_ns, data)]


@dataclass
class Drop(Fault):
    """A share of what is said is lost, whole pieces of it."""

    rng: Random
    share: float = 1.0

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [] if self.rng.random() < self.share else [(now_ns, data)]


@dataclass
class Bursts(Fault):
    """The line works and falls silent, for random whiles."""

    rng: Random
    mean_ns: int = 60 * MS
    _until_ns: int = field(default=0, repr=False)
    _silent: bool = field(default=False, repr=False)

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        if now_ns >= self._until_ns:
            self._silent = not self._silent
            self._until_ns = now_ns + round(self.rng.expovariate(1.0 / self.mean_ns))
        return [] if self._silent else [(now_ns, data)]


@dataclass
class Noise(Fault):
    """Bits are turned, bytes come and go: so many mishaps in a thousand bytes."""

    rng: Random
    per_thousand: float

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        said, rng = bytearray(), self.rng
        for byte in data:
            if rng.random() * 1000.0 >= self.per_thousand:
                said.append(byte)
                continue
            mishap = rng.randrange(3)
            if mishap == 0:
                said.append(byte ^ 1 << rng.randrange(8))
            elif mishap == 1:
                said += rng.randbytes(rng.randint(1, 4)) + bytes((byte,))
        return [(now_ns, bytes(said))]


@dataclass
class Garbage(Fault):
    """Random bytes instead of what was said, as with a wrong baud rate."""

    rng: Random

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [(now_ns, self.rng.randbytes(len(data)))]


@dataclass
class Flood(Fault):
    """The device says ten times as much as it should: everything, and noise of nine times the length."""

    rng: Random
    factor: int = 10

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [(now_ns, data + self.rng.randbytes((self.factor - 1) * len(data)))]


@dataclass
class Trickle(Fault):
    """One byte a second comes through."""

    period_ns: int = 1_000 * MS
    _next_ns: int = field(default=0, repr=False)

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        if now_ns < self._next_ns:
            return []
        self._next_ns = now_ns + self.period_ns
        return [(now_ns, data[:1])]


@dataclass
class Text(Fault):
    """A device that boots: its text instead of what it should say, for a while."""

    text: bytes = b"\r\nbootloader v1.2\r\nloading...\r\n\x1b[5n"

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [(now_ns, self.text[: len(data)])]


@dataclass
class Edit(Fault):
    """Each whole frame is changed into another well-formed one.

    Attributes:
        change: Of one piece, and the time at which it was said.
        lies: What comes through is untrue; where only the device's clock is changed, it is not.
    """

    change: Callable[[bytes, int], bytes]
    lies: bool = True

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        return [(now_ns, self.change(data, now_ns))]


@dataclass
class Chain(Fault):
    """Several faults at once, in order."""

    faults: list

    @property
    def lies(self) -> bool:
        return any(fault.lies for fault in self.faults)

    def pass_on(self, data: bytes, now_ns: int) -> Pieces:
        pieces = [(now_ns, data)]
        for fault in self.faults:
            pieces = [after for due_ns, piece in pieces for after in fault.pass_on(piece, due_ns)]
        return pieces
