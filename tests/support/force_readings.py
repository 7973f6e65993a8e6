"""Hand single force readings to a finger."""

from __future__ import annotations

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.samples import WrenchSample


def read_force(finger: Finger, sample: WrenchSample, acquired_ns: int | None = None) -> FingerState:
    """Return the state of a finger after a reading, acquired when it was received unless ``acquired_ns`` differs."""
    for _ in finger.decide((sample,), (sample.t_ns if acquired_ns is None else acquired_ns,)):
        pass
    return finger.state
