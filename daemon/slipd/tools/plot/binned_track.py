"""A value over time in bounded memory, whatever the length of a recording."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, NamedTuple, TypeVar

from slipd.recording.reader import Gap
from slipd.tools.evaluation.config_run import joined

T = TypeVar("T")

BINS = 1600
"""Most bins of a track: finer than the columns of the picture."""

FIRST_WIDTH_S = 0.001
"""Width of a bin at first: no topic is published faster than once a millisecond by default."""

Range = tuple[float, float]
"""Least and largest value; the least is above the largest if no value is known."""

NO_VALUE: Range = (float("inf"), float("-inf"))


class Window(NamedTuple):
    """The part of a run that is drawn, s from its begin."""

    begin_s: float
    end_s: float


class Extent(NamedTuple):
    """How long values hold that no newer one replaces.

    Attributes:
        end_s: The end of what is drawn, s.
        gaps: Times of which nothing is known, in order; no value holds into one.
    """

    end_s: float
    gaps: Sequence[Gap] = ()

    def limit(self, t_s: float) -> float:
        """Return until when a value of ``t_s`` can hold: the next gap, or the end."""
        at = bisect_left(self.gaps, t_s, key=lambda gap: gap.begin_s)
        return self.gaps[at].begin_s if at < len(self.gaps) else self.end_s


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
        self._merge, self._most, self._width_s = merge, bins, width_s
        self._bins: dict[int, T] = {}
        self._begin_s: float | None = None

    def add(self, t_s: float, value: T) -> None:
        """Add the value at a time; one before the first counts as the first."""
        if self._begin_s is None:
            self._begin_s = t_s
        at = max(int((t_s - self._begin_s) / self._width_s), 0)
        while at >= self._most:
            self._halve()
            at //= 2
        self._put(at, value)

    def held(self, extent: Extent) -> Iterator[Held[T]]:
        """Yield the value of every bin that has one; it holds until the next, the next gap, or the end."""
        first_s = self._begin_s or 0.0
        found = [(first_s + at * self._width_s, value) for at, value in sorted(self._bins.items())]
        nexts_s = [begin_s for begin_s, _ in found[1:]] + [extent.end_s]
        for (begin_s, value), next_s in zip(found, nexts_s, strict=False):
            yield Held(begin_s, max(min(next_s, extent.limit(begin_s)), begin_s), value)

    def runs(self, extent: Extent) -> list[Held[T]]:
        """Return the same, with equal values that follow each other without a gap as one."""
        return [Held(*each) for each in joined(self.held(extent))]

    def _put(self, at: int, value: T) -> None:
        before = self._bins.get(at, value)
        self._bins[at] = value if before == value else self._merge(before, value)

    def _halve(self) -> None:
        narrow, self._bins = sorted(self._bins.items()), {}
        self._width_s *= 2.0
        for at, value in narrow:
            self._put(at // 2, value)


def widest(one: Range, other: Range) -> Range:
    """Merge two ranges into the one that contains both."""
    low, high = one
    other_low, other_high = other
    return (low if low < other_low else other_low), (high if high > other_high else other_high)


def later(_: T, newer: T) -> T:
    """Keep the newer of two values."""
    return newer
