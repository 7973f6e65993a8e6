"""What may be believed of a finger: whether something presses on its pad, and whether a grip may be raised on it.

What is not known is None, never False. No raise on a stale sensor: a stall of the daemon excuses nothing, because a
reading that it has not read, or reads late, may show something else.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from slipd.config import Stream
from slipd.finger.force_channel import UNTRUSTED_FAULTS
from slipd.finger.force_image_check import CLEAR
from slipd.finger.verdict import PAD_FREE, PAD_PULLED, UNTARED, Verdict
from slipd.types.samples import UNTRUSTED_WORDS

if TYPE_CHECKING:
    from slipd.finger.finger import Finger

DOUBTS = frozenset({"stale", "not_finite", "disagreement", "not_tared", "pulled"}) | UNTRUSTED_WORDS | UNTRUSTED_FAULTS
"""Reasons of a verdict that leave the force on the finger unknown."""
FREE_NS = 200_000_000
"""A pad whose images show nothing for so long is free."""
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

    def for_raise(self, t_ns: int) -> bool:
        """Return whether a grip may be raised at ``t_ns``: readings and images are fresh, usable and trusted.

        A repeated reading of a sensor whose readings may rest is not enough: one that hangs looks the same. Nor is a
        force sensor that measures nothing of what its pad shows.
        """
        return self._allows(t_ns, at_rest=False) and not self._finger.presence.is_missed_by_force()

    def for_opening(self, t_ns: int) -> bool:
        """Return whether a gripper may open at ``t_ns``, because readings are trusted that show nothing gripped.

        Unlike for a raise, they may repeat as the config allows: at rest those of some sensors always do.
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
        return is_trusted(self._finger.state.verdict) and t_ns - freshness.acquired_ns <= self._oldest_ns


def _oldest_ns(stream: Stream) -> int:
    """Return the greatest age of a reading on which a grip is raised, ns."""
    return round(1e9 * (max(OLDEST_S, OLDEST_PERIODS / stream.rate_hz) + stream.delay_s))


class ContactPresence:
    """Whether something presses on the pad of one finger: as both sensors show it, or one alone, or for one purpose.

    Args:
        finger: The finger.
    """

    def __init__(self, finger: Finger) -> None:
        self._finger = finger
        self._clear_n = CLEAR * finger.config.min_normal_n

    def is_pressed(self) -> bool | None:
        """Return whether something presses, as both sensors show it together; None: unknown.

        A force sensor that was never tared reads its own bias as a contact, so until then only the image counts.
        """
        finger, by_image = self._finger, self.is_pressed_by_image()
        if by_image or (finger.zero_known and finger.in_contact):
            return True
        state = finger.state
        if not finger.zero_known:
            return by_image if state.verdict == UNTARED else None
        return False if finger.level == PAD_FREE.level else None

    def is_pressed_by_force(self) -> bool | None:
        """Return whether something presses, by the force sensor alone; None: unknown, or no force sensor.

        It decides while the pad in front of the sensor is tared, because the image has no zero yet.
        """
        finger, state = self._finger, self._finger.state
        if finger.force is None or state.contact is None or not finger.zero_known:
            return None
        return finger.in_contact or (False if finger.level == PAD_FREE.level else None)

    def is_pressed_by_image(self) -> bool | None:
        """Return whether something presses, as a fresh image alone shows it beside a force sensor; None: unknown."""
        image, freshness = self._finger.image, self._finger.freshness
        if image is None or self._finger.force is None or image.tare.busy:
            return None
        return image.shows_contact() if image.is_fresh(freshness.received_ns, freshness.unread_ns) else None

    def is_pressed_without(self, streams: Collection[str]) -> bool | None:
        """Return whether something presses, without the streams that are about to be tared: "wrench", "pad" or both."""
        finger = self._finger
        if finger.force is None or "pad" not in streams:
            return self.is_pressed()
        by_force = self.is_pressed_by_force()
        if "wrench" not in streams:
            return by_force
        by_image = self.is_pressed_by_image() if finger.image is not None and finger.image.zero.known else None
        if by_force or by_image:
            return True
        return None if by_force is None and by_image is None else False

    def is_free_by_image(self) -> bool:
        """Return whether fresh, reliable images of a pad with a known zero show by themselves that nothing presses.

        All of the last `FREE_NS` must: what rubber keeps after a release comes and goes at the threshold.
        """
        image = self._finger.image
        if image is None or not image.zero.tared or not image.is_reliable(at_rest=True):
            return False
        return self.is_pressed_by_image() is False and (image.t_ns or 0) - image.pressed_ns > FREE_NS

    def is_missed_by_force(self) -> bool:
        """Return whether the image shows a clear contact, of which the force sensor measures nothing, or nothing more.

        Without the contact that the force sensor lost, only a fresh image in newtons shows that.
        """
        finger, image = self._finger, self._finger.image
        if image is None or finger.in_contact:
            return False
        shown = finger.image_in_newtons and bool(self.is_pressed_by_image() and image.pressure.sum() > self._clear_n)
        return shown or "disagreement_contact" in finger.state.verdict.reasons

    def is_pulled(self) -> bool:
        """Return whether the normal force is clearly negative; the counts of a pad without a tare do not show that."""
        finger = self._finger
        return finger.state.verdict is PAD_PULLED and (finger.force is not None or finger.zero_known)

    def may_learn_zero(self, *, disagreement: bool) -> bool | None:
        """Return whether the zero may be learned, because nothing touches the finger; None: unknown.

        A known image decides together with the force: a force that the image does not show is not taken for a zero.
        """
        state = self._finger.state
        if disagreement or state.contact is None:
            return None
        by_image = self.is_pressed_by_image()
        if by_image is None:
            return True if state.verdict is PAD_FREE else None
        return not by_image and state.contact.normal_n < self._clear_n

    def contact_force_n(self, t_ns: int) -> float | None:
        """Return the normal force of a contact at ``t_ns``, N; None without contact, or where the force is not trusted.

        An image alone does not count: its noise or drift may look like a contact.
        """
        finger = self._finger
        contact = finger.state.contact
        if contact is None or not (finger.zero_known and finger.in_contact):
            return None
        return contact.normal_n if finger.trust.for_opening(t_ns) else None
