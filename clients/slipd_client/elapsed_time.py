"""Adds up the time between messages that come out of order."""

from __future__ import annotations

from typing import Optional

LONGEST_STEP_S = 0.5
"""Most that one step counts: in a longer gap, as while the machine stalls, nothing was seen, and nobody could act."""


class ElapsedTime:
    """Time that passed by the times of messages.

    Messages of different topics come out of order, and those of a stale stream are old. Only a message that is later
    than all before it lets time pass.

    Attributes:
        passed_s: Time since the first message, s.
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
