"""Adds up the time between messages that come out of order."""

from __future__ import annotations

from typing import Optional

LONGEST_STEP_S = 0.5
"""Largest step that counts, s: in a longer gap, such as a stall of the machine, nothing is seen and nobody can act."""


class ElapsedTime:
    """Time that passed by the times of messages.

    Messages of different topics arrive out of order, and those of a stale stream are old. Time advances only with a
    message that is newer than all before it.

    Attributes:
        passed_s: Time since the first message, s, with every step cut to ``LONGEST_STEP_S``.
    """

    def __init__(self) -> None:
        self.passed_s = 0.0
        self._newest_s: Optional[float] = None

    def update(self, now_s: float) -> float:
        """Update with the time of a message, s of any clock; return ``passed_s``."""
        newest_s = self._newest_s
        if newest_s is None:
            self._newest_s = now_s
        elif now_s > newest_s:
            self._newest_s = now_s
            self.passed_s += min(now_s - newest_s, LONGEST_STEP_S)
        return self.passed_s
