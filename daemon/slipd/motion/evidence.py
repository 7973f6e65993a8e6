"""Kinds of evidence that the object moves on the pad, and one piece of it."""

from __future__ import annotations

from typing import NamedTuple

EVIDENCE = ("load_drop", "image_change", "spin_change", "vibration", "width", "external")
"""Kinds of evidence, by their bit in ``evidence`` of `slipd.fusion.rows.ASSESSMENT`.

- load_drop: The load falls from static to dynamic friction, or exceeds what any friction carries.
- image_change: The shares of the taxels change at unchanged load.
- spin_change: The spin changes at unchanged load.
- vibration: The high band of the force sensor is loud; it only supports other evidence.
- width: The width of the gripper changes at unchanged grip force.
- external: A driver of the user's says so.
"""


class Evidence(NamedTuple):
    """One piece of evidence that the object moves.

    Attributes:
        kind: A word of EVIDENCE.
        t_ns: When it was found, CLOCK_MONOTONIC.
        surprise: −ln of the probability of a statistic this large without motion.
    """

    kind: str
    t_ns: int
    surprise: float


def evidence_mask(*kinds: str) -> int:
    """Return the bits of some kinds of evidence."""
    return sum(1 << EVIDENCE.index(kind) for kind in set(kinds))


def evidence_names(mask: int) -> tuple[str, ...]:
    """Return the kinds of evidence in a bit mask, in the order of EVIDENCE."""
    return tuple(kind for bit, kind in enumerate(EVIDENCE) if mask >> bit & 1)
