"""Bounds the rate of the messages of each topic; the last one always comes through. Pure: time is an argument."""

from __future__ import annotations


class TopicLimit:
    """Lets messages of each topic through at a bounded rate; the last one of a topic always comes through.

    A message that comes too early is held back. A later one replaces it, and when none follows for a further period,
    it is due.

    Args:
        rate_hz: Most messages per second of each topic; None: all.
    """

    def __init__(self, rate_hz: float | None) -> None:
        self._period_s = 0.0 if rate_hz is None else 1.0 / rate_hz
        self._next_s: dict[str, float] = {}
        self._held: dict[str, bytes] = {}

    def passes(self, topic: str, payload: bytes, now_s: float) -> bool:
        """Return whether a message goes on now; one that does not is held back.

        Args:
            topic: Its topic.
            payload: Its bytes.
            now_s: The time, s of any clock.
        """
        next_s = self._next_s.get(topic, now_s)
        if next_s - 2.0 * self._period_s <= now_s < next_s:  # earlier still: the clock was set back
            self._held[topic] = payload
            return False
        self._held.pop(topic, None)
        in_time = next_s <= now_s < next_s + self._period_s  # else there was a pause, or the clock was set back
        self._next_s[topic] = (next_s if in_time else now_s) + self._period_s
        return True

    def due(self, now_s: float) -> list[tuple[str, bytes]]:
        """Return the messages that were held back and that no other one followed; they are held no more."""
        topics = [topic for topic in self._held if now_s >= self._next_s[topic] + self._period_s]
        for topic in topics:
            self._next_s[topic] = now_s + self._period_s
        return [(topic, self._held.pop(topic)) for topic in topics]

    def due_s(self) -> float | None:
        """Return when `due` has something to return; None while nothing is held back."""
        return min((self._next_s[topic] + self._period_s for topic in self._held), default=None)
