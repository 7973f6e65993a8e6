"""Force readings of a pad whose taxels measure three axes each, so that it needs no force sensor behind it."""

from __future__ import annotations

import math

from slipd.finger.force_channel import WrenchBatch
from slipd.finger.image_channel import ImageChannel
from slipd.fusion.rows import UNTRUSTED
from slipd.fusion.streaming import new_readings
from slipd.types.samples import UNTRUSTED as UNTRUSTED_WORDS
from slipd.types.samples import TactileSample

_UNKNOWN = (math.nan,) * 6


def wrench_by_taxels(image: ImageChannel, sample: TactileSample, t_ns: int) -> WrenchBatch:
    """Return the newest image of a pad as a batch of one force reading, in the pad frame.

    Args:
        image: The pad, updated with ``sample``.
        sample: The image.
        t_ns: When it was acquired, CLOCK_MONOTONIC.
    """
    reasons = tuple(sorted(UNTRUSTED_WORDS.intersection(sample.status)))
    if not image.zero_known:
        reasons = ("not_tared", *reasons)
    wrench = image.wrench()
    if wrench is None:
        reasons = reasons or ("not_finite",)
    rows = new_readings([_UNKNOWN if wrench is None else wrench], [t_ns * 1e-9])
    if wrench is not None and image.is_stuck(rows["wrench"], t_ns):
        reasons = ("stuck", *reasons)
    if reasons:
        rows["phase"] = UNTRUSTED
    return WrenchBatch((t_ns,), sample.t_ns, rows, True, {0: reasons} if reasons else {}, (sample.status,))
