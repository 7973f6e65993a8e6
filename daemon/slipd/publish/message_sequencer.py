"""What all messages share: their head, with number, times, run and config, and the largest rate of a topic."""

from __future__ import annotations

from slipd.events import Body, Publish, WallClock
from slipd_client.messages import PROTOCOL_VERSION

NO_FRAME = ""
"""Frame of messages without vectors."""


class MessageSequencer:
    """Number messages without gaps within their topic, and date them.

    Args:
        boot: Id of this run.
        config_id: Id of the config in force.
        wall: Wall clock of the run.
    """

    def __init__(self, boot: str, config_id: str, wall: WallClock) -> None:
        self._boot = boot
        self._config_id = config_id
        self._wall = wall
        self._seq: dict[str, int] = {}

    @property
    def published(self) -> int:
        """Number of messages so far."""
        return sum(self._seq.values())

    def message(self, topic: str, t_ns: int, frame: str, body: Body) -> Publish:
        """Return the next message of a topic.

        Args:
            topic: The topic.
            t_ns: Time of the readings that the message is about, CLOCK_MONOTONIC.
            frame: Frame of its vectors.
            body: Its fields beside the head.
        """
        seq = self._seq.get(topic, 0)
        self._seq[topic] = seq + 1
        whole = {
            "v": PROTOCOL_VERSION,
            "seq": seq,
            "boot": self._boot,
            "t_ns": t_ns,
            "timestamp": (t_ns + self._wall.minus_monotonic_ns) * 1e-9,
            "frame": frame,
            "config_id": self._config_id,
            **body,
        }
        return Publish(topic, whole, frame)


class Pace:
    """Let at most ``rate_hz`` messages of a topic pass, and one more where what they state has changed.

    It goes by the time of their data, without drift against that time.

    Attributes:
        due_ns: Time from which the next message passes.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self.due_ns = 0
        self._stated: object = None

    def passes(self, t_ns: int, stated: object = None) -> bool:
        """Return whether a message about ``t_ns`` passes: it is due, or states something else than the one before."""
        before, self._stated = self._stated, stated
        if t_ns < self.due_ns:
            return stated != before
        late = t_ns - self.due_ns
        self.due_ns = self.due_ns + self._period_ns if late < self._period_ns else t_ns + self._period_ns
        return True
