"""What waits to be taken, with a share for each peer: one that floods delays only itself. Pure."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class FairQueue(Generic[Item]):
    """Items of any number of peers, taken from each in turn.

    Args:
        share: Most items of one peer that wait; the oldest gives way to a further one.
        most_peers: Most peers with a share of their own; further ones share that of the peer "".
    """

    def __init__(self, share: int, most_peers: int) -> None:
        self._share, self._most_peers = share, most_peers
        self._waiting: dict[str, deque[Item]] = {}

    def __bool__(self) -> bool:
        """Return whether anything waits."""
        return bool(self._waiting)

    def add(self, peer: str, item: Item) -> bool:
        """Let an item wait; return whether an older one of the same peer gave way."""
        if peer not in self._waiting and len(self._waiting) >= self._most_peers:
            peer = ""
        items = self._waiting.setdefault(peer, deque(maxlen=self._share))
        full = len(items) == self._share
        items.append(item)
        return full

    def take(self) -> Item:
        """Return the oldest item of the peer whose turn it is; there must be one."""
        peer = next(iter(self._waiting))
        items = self._waiting.pop(peer)
        item = items.popleft()
        if items:
            self._waiting[peer] = items
        return item
