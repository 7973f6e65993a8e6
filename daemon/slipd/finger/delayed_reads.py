"""Force readings that wait for the image of their time.

After a stall both lines of a finger hold readings, and the force may be read first. A verdict with the image from
before the stall could call a slipping grip safe, and one without an image would report a healthy pad as silent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from slipd.finger.freshness import Arrival
from slipd.finger.image_channel import ImageChannel
from slipd.types.samples import WrenchSample


class DelayedRead(NamedTuple):
    """Arguments of `slipd.finger.finger.Finger.decide`."""

    samples: Sequence[WrenchSample]
    times_ns: Sequence[int]
    arrival: Arrival


class DelayedReads:
    """Force readings that wait, in their order.

    Args:
        image: The pad beside the force sensor; None: no reading waits.
    """

    def __init__(self, image: ImageChannel | None) -> None:
        self._image = image
        self._reads: deque[DelayedRead] = deque()

    def __len__(self) -> int:
        return len(self._reads)

    def add(self, read: DelayedRead) -> None:
        """Append a read."""
        self._reads.append(read)

    def clear(self) -> None:
        """Forget the reads: their stream ended."""
        self._reads.clear()

    def release(self, t_ns: int, unread_ns: int | None) -> Iterator[DelayedRead]:
        """Yield the reads that need not wait any more, in order, with how long they waited until ``t_ns``.

        Args:
            t_ns: Now.
            unread_ns: How long the image's line counts as unread; None: it is empty, and no image is awaited.
        """
        image, until_ns = self._image, None
        if unread_ns and image is not None and image.is_fresh(t_ns, unread_ns):
            until_ns = image.freshness.serves_until_ns(t_ns - unread_ns)
        while self._reads and (until_ns is None or self._reads[0].times_ns[-1] <= until_ns):
            samples, times_ns, arrival = self._reads.popleft()
            waited_ns = arrival.waited_ns + t_ns - samples[-1].t_ns
            yield DelayedRead(samples, times_ns, Arrival(waited_ns, unread_ns, arrival.dated))
