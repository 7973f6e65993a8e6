"""Verdict on one reading, the rules that give it, and whether a grip may be raised or opened on it.

No raise on a stale sensor: a stall of the daemon excuses nothing, because a reading that it has not read, or reads
late, may show something else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from slipd.config import Stream
from slipd.finger.force_channel import UNTRUSTED_FAULTS
from slipd.fusion import Utilisation
from slipd.fusion.levels import Assessment
from slipd.fusion.rows import STABLE, WARNING
from slipd.types.samples import UNTRUSTED as UNTRUSTED_WORDS

if TYPE_CHECKING:
    from slipd.finger.finger import Finger


TRANSLATION_SHARE = 0.9
"""Rotation is a reason where translation alone explains less than this share of the utilisation."""
DOUBTS = frozenset({"stale", "not_finite", "disagreement", "not_tared", "pulled"}) | UNTRUSTED_WORDS | UNTRUSTED_FAULTS
"""Reasons of a verdict that leave the force on the finger unknown."""
OLDEST_S = 0.05
"""Largest age of a reading on which a grip is raised, s, in addition to the delay of the stream."""
OLDEST_PERIODS = 2.5
"""Likewise in periods of the stream; the longer of the two applies."""


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
    """Return the verdict on a contact of which force sensor and image do not disagree.

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
    if found.friction_step == found.tipping_step == STABLE and not found.slips:
        return GRIP_HOLDS
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
