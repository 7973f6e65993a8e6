"""Decide whether something presses on a pad, from force sensor and image; what is not known is None, never False."""

from __future__ import annotations

from collections.abc import Collection

from slipd.config import Finger as FingerConfig
from slipd.finger.contact_estimator import ContactEstimator
from slipd.finger.finger_state import FingerState
from slipd.finger.force_channel import ForceChannel
from slipd.finger.freshness import Freshness
from slipd.finger.image_channel import ImageChannel
from slipd.finger.verdict import PAD_FREE, PAD_PULLED, UNTARED, WEIGHT_UNKNOWN
from slipd.signals.force_image_agreement import CLEAR


class ContactPresence:
    """Whether something presses on the pad of one finger.

    Args:
        config: ``[finger.X]``.
        force: The force sensor; None where the pad measures the force.
        image: The pad; None where there is none.
        estimator: Decides whether the force is that of a contact.
        freshness: Of the force readings.
    """

    def __init__(
        self,
        config: FingerConfig,
        force: ForceChannel | None,
        image: ImageChannel | None,
        estimator: ContactEstimator,
        freshness: Freshness,
    ) -> None:
        self._force, self._image = force, image
        self._estimator, self._freshness = estimator, freshness
        self._clear_n = CLEAR * config.min_normal_n

    @property
    def zero_known(self) -> bool:
        """The force has a known zero; see `ForceChannel.zero_known` and `ImageChannel.zero_known`."""
        channel = self._force or self._image
        return channel is not None and channel.zero_known

    def is_pressed(self, state: FingerState) -> bool | None:
        """Return whether something presses.

        A force sensor that was never tared reads its own bias as a contact, so until then only the image counts.
        """
        zero_known, shown = self.zero_known, self.shown_by_image()
        if shown or (zero_known and self._estimator.in_contact):
            return True
        if not zero_known:
            return shown if state.verdict == UNTARED else None
        return None if state.contact is None or state.verdict is WEIGHT_UNKNOWN else False

    def is_pulled(self, state: FingerState) -> bool:
        """Return whether the normal force is clearly negative; the counts of a pad without a tare do not show that."""
        return state.verdict is PAD_PULLED and (self._force is not None or self.zero_known)

    def is_measured(self, state: FingerState) -> bool | None:
        """Return whether the force sensor alone measures a contact; None also where there is no such sensor.

        It decides while the pad in front of the sensor is tared, because the image has no zero yet.
        """
        if self._force is None or state.contact is None or state.verdict is WEIGHT_UNKNOWN:
            return None
        return self._estimator.in_contact if self._force.zero_known else None

    def is_pressed_without(self, streams: Collection[str], state: FingerState) -> bool | None:
        """Return whether something presses, without the streams that are about to be tared: "wrench", "pad" or both."""
        if self._force is None or "pad" not in streams:
            return self.is_pressed(state)
        measured = self.is_measured(state)
        if "wrench" not in streams:
            return measured
        shown = self.shown_by_image() if self._image is not None and self._image.zero_known else None
        if measured or shown:
            return True
        return None if measured is None and shown is None else False

    def is_untouched(self, state: FingerState, *, disagreement: bool) -> bool | None:
        """Return whether nothing touches the finger, so that its zero may be learned.

        A known image decides together with the force: a force that the image does not show is not taken for a zero.
        """
        if disagreement or state.contact is None:
            return None
        shown = self.shown_by_image()
        if shown is None:
            return True if state.verdict is PAD_FREE else None
        return not shown and state.contact.normal_n < self._clear_n

    def is_free_by_image(self) -> bool:
        """Return whether a fresh, reliable image of a pad with a known zero shows by itself that nothing presses."""
        image = self._image
        if image is None or not image.zero.tared or not image.is_reliable(at_rest=True):
            return False
        return self.shown_by_image() is False

    def shown_by_image(self) -> bool | None:
        """Return whether a fresh image beside a force sensor shows a contact."""
        image = self._image
        if image is None or self._force is None or image.tare.busy:
            return None
        if not image.is_fresh(self._freshness.received_ns, self._freshness.unread_ns):
            return None
        return image.shows_contact()
