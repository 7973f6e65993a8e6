"""What one run of a daemon in a fleet has published: its newest state, and when it was heard."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from slipd_client.messages.codec import RunOrder
from slipd_client.messages.schema.topics import Message, SlipWarning, Status

BESIDE_S = 3.0
"""A daemon whose last ``status`` is no older counts beside the one that was heard last, s."""

CLASH_S = 1.2
"""Daemons whose times of ``status`` overlap by so much are those of several robots, s: the network drops a silent
connection within 1 s, so the last messages of a daemon that ended are not that late."""


@dataclass
class DaemonRun:
    """One run of a daemon, of which `status` and `warning` arrive in any order.

    Attributes:
        heard_s: When its last message arrived.
        first_status_s: When its first ``status`` arrived.
        last_status_s: When its last ``status`` arrived.
        order: Numbers of its messages.
        status: The last ``status``; None before the first.
        fingers: Finger → time (CLOCK_MONOTONIC of the daemon, ns), level and reasons.
    """

    heard_s: float = 0.0
    first_status_s: float = math.inf
    last_status_s: float = -math.inf
    order: RunOrder = field(default_factory=RunOrder)
    status: Status | None = None
    fingers: dict[str, tuple[int, str, tuple[str, ...]]] = field(default_factory=dict)

    def beside(self, now_s: float) -> bool:
        """Return whether its daemon published a moment ago."""
        return now_s - self.last_status_s <= BESIDE_S

    def overlaps(self, other: DaemonRun) -> bool:
        """Return whether both daemons published at the same time."""
        both_s = min(self.last_status_s, other.last_status_s) - max(self.first_status_s, other.first_status_s)
        return both_s >= CLASH_S

    def note(self, message: Message, now_s: float) -> None:
        """Update with a message that arrived at ``now_s``."""
        self.heard_s = now_s
        if isinstance(message, SlipWarning):
            self._level(message.finger, message.t_ns, message.level.value, message.reasons)
        elif isinstance(message, Status):
            self.status = message
            self.first_status_s, self.last_status_s = min(self.first_status_s, now_s), now_s
            for finger, each in message.fingers.items():
                self._level(finger, message.t_ns, each.level.value, each.reasons)

    def _level(self, finger: str, t_ns: int, level: str, reasons: tuple[str, ...]) -> None:
        """Note the level of a finger; warnings overtake ``status`` on the way."""
        if t_ns >= self.fingers.get(finger, (t_ns,))[0]:
            self.fingers[finger] = (t_ns, level, reasons)
