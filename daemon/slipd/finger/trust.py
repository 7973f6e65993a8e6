"""Decide whether a finger's readings are trusted, and whether a grip may be raised or opened on them.

No raise on a stale sensor: a stall of the daemon excuses nothing, because a reading that it has not read, or reads
late, may show something else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from slipd.config import Stream
from slipd.finger.force_channel import UNTRUSTED_FAULTS
from slipd.finger.verdict import Verdict
from slipd.types.samples import UNTRUSTED as UNTRUSTED_WORDS

if TYPE_CHECKING:
    from slipd.finger.finger import Finger

DOUBTS = frozenset({"stale", "not_finite", "disagreement", "not_tared", "pulled"}) | UNTRUSTED_WORDS | UNTRUSTED_FAULTS
"""Reasons of a verdict that leave the force on the finger unknown."""
OLDEST_S = 0.05
"""Largest age of a reading on which a grip is raised, s, in addition to the delay of the stream."""
OLDEST_PERIODS = 2.5
"""Likewise in periods of the stream; the longer of the two applies."""


def is_trusted(verdict: Verdict) -> bool:
    """Return whether the reading of a verdict was fresh, and its sensor shows no fault."""
    return DOUBTS.isdisjoint(verdict.reasons)


class Trust:
    """Trust in the sensors of one finger, for motions of the gripper.

    Args:
        finger: The finger.
    """

    def __init__(self, finger: Finger) -> None:
        config = finger.config
        streams = [stream for stream in (config.wrench, config.pad) if stream is not None]
        self._finger = finger
        self._oldest_ns, self._oldest_image_ns = _oldest_ns(streams[0]), _oldest_ns(streams[-1])

    @property
    def newest(self) -> bool:
        """The newest force reading is fresh, and its sensor shows no fault."""
        return is_trusted(self._finger.state.verdict)

    def for_raise(self, t_ns: int) -> bool:
        """Return whether a grip may be raised at ``t_ns``: readings and images are fresh, usable and trusted.

        A repeated reading of a sensor whose readings may rest is not enough: one that hangs looks the same.
        """
        return self._allows(t_ns, at_rest=False)

    def at_rest(self, t_ns: int) -> bool:
        """Return whether readings are trusted as in `for_raise`, or repeat as the config allows.

        This is enough to open the gripper: at rest the readings of some sensors always repeat.
        """
        return self._allows(t_ns, at_rest=True)

    def _allows(self, t_ns: int, *, at_rest: bool) -> bool:
        image, force, freshness = self._finger.image, self._finger.force, self._finger.freshness
        if image is not None and not image.is_reliable(at_rest=at_rest):
            return False
        if image is not None and t_ns - (image.t_ns or 0) > self._oldest_image_ns:
            return False
        if force is not None and force.watch.suspect and not (at_rest and force.watch.rests):
            return False
        if freshness.is_stale(t_ns) or freshness.received_ns - freshness.acquired_ns > freshness.stale_ns:
            return False
        return self.newest and t_ns - freshness.acquired_ns <= self._oldest_ns


def _oldest_ns(stream: Stream) -> int:
    """Return the greatest age of a reading on which a grip is raised, ns."""
    return round(1e9 * (max(OLDEST_S, OLDEST_PERIODS / stream.rate_hz) + stream.delay_s))
