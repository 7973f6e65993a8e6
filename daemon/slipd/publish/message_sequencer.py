"""What every message carries, and how often at most a topic is published."""

from __future__ import annotations

from typing import Any

from slipd.events import Publish
from slipd_client.messages import PROTOCOL_VERSION

#: Of messages without vectors.
NO_FRAME = ""


class MessageSequencer:
    """Makes messages: numbers them per topic without gaps and dates them.

    Args:
        boot: Id of this run.
        config_id: Id of the config in force.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.
    """

    def __init__(self, boot: str, config_id: str, wall_minus_monotonic_ns: int) -> None:
        self.boot = boot
        self._config_id = config_id
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._seq: dict[str, int] = {}
        self.published = 0

    def message(self, topic: str, t_ns: int, frame: str, body: dict[str, Any]) -> Publish:
        """Makes the next message of a topic about the instant ``t_ns`` (CLOCK_MONOTONIC)."""
        seq = self._seq.get(topic, 0)
        self._seq[topic] = seq + 1
        self.published += 1
        head: dict[str, Any] = {
            "v": PROTOCOL_VERSION,
            "seq": seq,
            "boot": self.boot,
            "t_ns": t_ns,
            "timestamp": (t_ns + self._wall_minus_monotonic_ns) * 1e-9,
            "frame": frame,
            "config_id": self._config_id,
        }
        head.update(body)
        return Publish(topic, head)


class Pace:
    """Lets at most ``rate_hz`` pass, by data time, without drifting against it.

    Attributes:
        due_ns: From when on the next one passes.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self.due_ns = 0

    def passes(self, t_ns: int, *, now: bool = False) -> bool:
        """Whether a message about ``t_ns`` is due; ``now`` lets it pass anyway, beside the others."""
        if t_ns < self.due_ns:
            return now
        late = t_ns - self.due_ns
        self.due_ns = self.due_ns + self._period_ns if late < self._period_ns else t_ns + self._period_ns
        return True
