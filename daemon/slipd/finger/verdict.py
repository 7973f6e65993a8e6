"""What a level is called, how alarming it is, and why it was reached."""

from __future__ import annotations

from dataclasses import dataclass

NAMES = ("stable", "caution", "warning")

#: How alarming each level is; "unknown" is worse than any verdict that says the grip holds.
SEVERITY = {"no_contact": 0, "stable": 1, "unknown": 2, "caution": 3, "warning": 4, "slipping": 5}

#: Rotation counts as a reason when translation alone explains less than this share of the utilisation.
TRANSLATION_SHARE = 0.9


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is decided on one reading.

    Attributes:
        level: Name of the level.
        reasons: Why, most telling first; empty when stable.
    """

    level: str
    reasons: tuple[str, ...]


def danger_reasons(utilisation: float, translation: float, caution: float) -> tuple[str, ...]:
    """Names what uses up the friction: translation, rotation, or both.

    Args:
        utilisation: λ of force and spin together, at or above ``caution`` less the hysteresis.
        translation: R / μ, the utilisation of the force alone.
        caution: Utilisation that counts as danger.
    """
    if utilisation == float("inf"):
        return ("unsupportable", "rotation")
    reasons = []
    if translation < TRANSLATION_SHARE * utilisation:
        reasons.append("rotation")
    if translation >= caution or not reasons:
        reasons.append("translation")
    return tuple(reasons)
