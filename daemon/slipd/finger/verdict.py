"""Verdict on one reading: a level and its reasons, and the rules that give them."""

from __future__ import annotations

from dataclasses import dataclass

from slipd.fusion import Utilisation
from slipd.fusion.contact_state import Assessment
from slipd.fusion.rows import STABLE, WARNING

TRANSLATION_SHARE = 0.9
"""Rotation is a reason where translation alone explains less than this share of the utilisation."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Level of one reading, with its reasons.

    Attributes:
        level: Name of the level, one of `slipd_client.messages.LEVELS`.
        reasons: Why it was reached, the most important first; empty when stable or without contact.
    """

    level: str
    reasons: tuple[str, ...]


GRIP_HOLDS = Verdict("stable", ())
PAD_FREE = Verdict("no_contact", ())
STREAM_STALE = Verdict("unknown", ("stale",))
WEIGHT_UNKNOWN = Verdict("unknown", ("weight_unknown",))
"""The unknown weight of the finger may look like a contact, or hide one."""
NO_MU = Verdict("unknown", ("no_mu",))
SLIPS_WITHOUT_MU = Verdict("slipping", ("slip_detected", "no_mu"))
"""Motion is seen without a coefficient of friction; only a prediction needs one."""
UNTARED = Verdict("unknown", ("not_tared",))
"""The zero of the sensor that measures the force is not known: its reading may be a bias, and its bias may hide a
load."""
PAD_PULLED = Verdict("unknown", ("pulled",))
"""The normal force is clearly negative: the sensor or its config is wrong."""
ROTATION_UNOBSERVED = Verdict("unknown", ("rotation_unobserved",))
"""Without an image, translation alone can prove a grip unsafe, never safe."""
TRANSLATION_UNSAFE = Verdict("warning", ("translation",))


def contact_verdict(
    found: Assessment, level: str, used: Utilisation | None, friction_ratio: float, mu: float | None, caution: float
) -> Verdict:
    """Return the verdict on a contact that is not stable, and of which force sensor and image do not disagree.

    Args:
        found: Result of the slip decision.
        level: Its level.
        used: λ for force and spin together; None where only the translation is known.
        friction_ratio: R of the contact.
        mu: Coefficient of static friction; None: unknown.
        caution: Utilisation from which on the grip is in danger.
    """
    if mu is None:
        return SLIPS_WITHOUT_MU if found.slips else NO_MU
    if used is None:
        known = ROTATION_UNOBSERVED if found.friction_step < WARNING else TRANSLATION_UNSAFE
        return Verdict(level, ("slip_detected", *known.reasons)) if found.slips else known
    by_unknown_load = found.tipping_by_unknown_load
    reasons = danger_reasons(used.value, friction_ratio / mu, caution) if found.friction_step > STABLE else ()
    only_by_weight = used.upper < caution and found.utilisation_upper > used.upper
    if found.friction_step > STABLE and only_by_weight and not by_unknown_load:
        reasons = (*reasons, "weight_unknown")
    if found.tipping_step > STABLE:
        reasons = (*reasons, "tipping", "weight_unknown") if by_unknown_load else (*reasons, "tipping")
    return Verdict(level, ("slip_detected", *reasons) if found.slips else reasons)


def danger_reasons(utilisation: float, translation: float, caution: float) -> tuple[str, ...]:
    """Return what uses up the friction: translation, rotation, or both.

    Args:
        utilisation: λ of force and spin together, at or above ``caution`` less the hysteresis.
        translation: R / μ, the utilisation by the tangential force alone.
        caution: Utilisation from which on the grip is in danger.
    """
    if utilisation == float("inf"):
        return ("unsupportable", "rotation")
    reasons = []
    if translation < TRANSLATION_SHARE * utilisation:
        reasons.append("rotation")
    if translation >= caution or not reasons:
        reasons.append("translation")
    return tuple(reasons)
