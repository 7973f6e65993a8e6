"""The largest rate of the messages of one topic."""

from __future__ import annotations


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
