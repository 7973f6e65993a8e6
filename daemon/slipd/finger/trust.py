"""Decide whether a finger's readings are trusted, and whether a grip may be raised or opened on them."""

from __future__ import annotations

from slipd.config import Stream
from slipd.finger.force_channel import UNTRUSTED_FAULTS, ForceChannel
from slipd.finger.freshness import Freshness
from slipd.finger.image_channel import ImageChannel
from slipd.finger.verdict import Verdict
from slipd.types.samples import UNTRUSTED as UNTRUSTED_WORDS

DOUBTS = frozenset({"stale", "not_finite", "disagreement", "not_tared", "pulled"}) | UNTRUSTED_WORDS | UNTRUSTED_FAULTS
"""Reasons of a verdict that leave the force on the finger unknown."""
OLDEST_S = 0.05
"""Largest age of a reading on which a grip is raised, s, in addition to the delay of the stream."""
OLDEST_PERIODS = 2.5
"""Likewise in periods of the stream; the longer of the two applies."""


def is_trusted(verdict: Verdict) -> bool:
    """Return whether the reading of a verdict was fresh, and its sensor shows no fault."""
    return DOUBTS.isdisjoint(verdict.reasons)


class RaiseTrust:
    """Trust in the sensors of one finger, for motions of the gripper.

    Args:
        stream: Config of the stream that measures the force.
        pad: ``[finger.X.pad]``; None where there is none.
        force: The force sensor; None where the pad measures the force.
        image: The pad; None where there is none.
        freshness: Of the force readings.
    """

    def __init__(
        self,
        stream: Stream,
        pad: Stream | None,
        force: ForceChannel | None,
        image: ImageChannel | None,
        freshness: Freshness,
    ) -> None:
        self._force, self._image, self._freshness = force, image, freshness
        self._oldest_ns = _oldest_ns(stream)
        self._oldest_image_ns = _oldest_ns(pad or stream)

    def allows(self, verdict: Verdict, t_ns: int, *, at_rest: bool) -> bool:
        """Return whether the newest readings and images are fresh, usable and trusted at ``t_ns``.

        A stall of the daemon excuses nothing: a reading that it has not read, or reads late, may show something else.

        Args:
            verdict: On the newest force reading.
            t_ns: Now.
            at_rest: Accept a reading that repeats, where the config says that this sensor's readings may rest.
        """
        image, force, freshness = self._image, self._force, self._freshness
        if image is not None and not image.is_reliable(at_rest=at_rest):
            return False
        if image is not None and t_ns - (image.t_ns or 0) > self._oldest_image_ns:
            return False
        if force is not None and force.watch.suspect and not (at_rest and force.watch.rests):
            return False
        if freshness.is_stale(t_ns) or freshness.received_ns - freshness.acquired_ns > freshness.stale_ns:
            return False
        return is_trusted(verdict) and t_ns - freshness.acquired_ns <= self._oldest_ns


def _oldest_ns(stream: Stream) -> int:
    """Return the greatest age of a reading on which a grip is raised, ns."""
    return round(1e9 * (max(OLDEST_S, OLDEST_PERIODS / stream.rate_hz) + stream.delay_s))
