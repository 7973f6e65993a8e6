"""A value over time in bounded memory, whatever the length of a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")

BINS = 1600
"""Most bins of a track: finer than the columns of the picture."""

FIRST_WIDTH_S = 0.001
"""Width of a bin at first: no topic is published faster than once a millisecond by default."""

Range = tuple[float, float]
"""Least and largest value; the least is above the largest where none is known."""

NO_VALUE: Range = (float("inf"), float("-inf"))


class Window(NamedTuple):
    """The part of a run that is drawn, s from its begin."""

    begin_s: float
    end_s: float


class Held(NamedTuple, Generic[T]):
    """What a track holds from one time to another, s."""

    begin_s: float
    end_s: float
    value: T


class BinnedTrack(Generic[T]):
    """Bins of equal width from the first time on. When the time passes the last, neighbours are merged and all widen.

    Args:
        merge: Returns what a bin keeps of an earlier and a later value.
        bins: Most bins.
        width_s: Width of a bin at first, s.
    """

    def __init__(self, merge: Callable[[T, T], T], bins: int = BINS, width_s: float = FIRST_WIDTH_S) -> None:
        self._merge = merge
        self._bins: list[T | None] = [None] * bins
        self._width_s = width_s
        self._begin_s: float | None = None

    def add(self, t_s: float, value: T) -> None:
        """Add the value at a time; one before the first counts as the first."""
        if self._begin_s is None:
            self._begin_s = t_s
        at = max(int((t_s - self._begin_s) / self._width_s), 0)
        while at >= len(self._bins):
            self._halve()
            at //= 2
        before = self._bins[at]
        self._bins[at] = value if before is None else self._merge(before, value)

    def held(self, end_s: float) -> Iterator[Held[T]]:
        """Yield the value of every bin that has one; it holds until the next, and the last until ``end_s``."""
        first_s = self._begin_s or 0.0
        found = [(first_s + at * self._width_s, value) for at, value in enumerate(self._bins) if value is not None]
        for at, (begin_s, value) in enumerate(found, start=1):
            until_s = found[at][0] if at < len(found) else end_s
            yield Held(begin_s, max(until_s, begin_s), value)

    def runs(self, end_s: float) -> Iterator[Held[T]]:
        """Yield the same, with equal values that follow each other as one."""
        last: Held[T] | None = None
        for each in self.held(end_s):
            if last is not None and last.value == each.value:
                last = Held(last.begin_s, each.end_s, last.value)
                continue
            if last is not None:
                yield last
            last = each
        if last is not None:
            yield last

    def _halve(self) -> None:
        old = self._bins
        merged = [self._merged(old[at], old[at + 1] if at + 1 < len(old) else None) for at in range(0, len(old), 2)]
        self._bins = merged + [None] * (len(old) - len(merged))
        self._width_s *= 2.0

    def _merged(self, earlier: T | None, later: T | None) -> T | None:
        if earlier is None or later is None:
            return later if earlier is None else earlier
        return self._merge(earlier, later)


def widest(one: Range, other: Range) -> Range:
    """Merge two ranges into the one that contains both."""
    return min(one[0], other[0]), max(one[1], other[1])


def later(_: T, newer: T) -> T:
    """Keep the newer of two values."""
    return newer
