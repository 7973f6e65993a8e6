"""From utilisation to a level, with hysteresis and reasons."""

from __future__ import annotations

from dataclasses import dataclass

from slipd.config import Levels

STABLE, CAUTION, WARNING = range(3)
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


class LevelGate:
    """Two thresholds, each left a hysteresis below where it was reached."""

    def __init__(self, levels: Levels) -> None:
        self._thresholds = (levels.caution, levels.warning)
        self._hysteresis = levels.hysteresis
        self._step = STABLE

    def reset(self) -> None:
        """Starts anew: the contact ended."""
        self._step = STABLE

    def update(self, utilisation: float) -> int:
        """Takes the upper bound of the utilisation (inf counts as over every threshold) and returns the step."""
        step = sum(utilisation >= threshold for threshold in self._thresholds)
        while step < self._step and utilisation >= self._thresholds[step] - self._hysteresis:
            step += 1
        self._step = step
        return step


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
