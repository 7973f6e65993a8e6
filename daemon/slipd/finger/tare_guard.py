"""Give up the tares of one finger that would take a load for zero, or that lost their stream."""

from __future__ import annotations

from slipd.finger.contact_presence import ContactPresence
from slipd.finger.finger_state import FingerState
from slipd.finger.freshness import Freshness
from slipd.finger.image_channel import ImageChannel
from slipd.signals.tare import Tare

LONGEST_GAP_NS = 500_000_000
"""Longest silence of its stream that a tare survives; during a longer one a contact may have come and gone."""


class TareGuard:
    """Watches the tares of one finger while they are measured.

    Args:
        main: Tare of the stream that measures the force.
        image: The pad; None where there is none. Its tare may be ``main``.
        freshness: Of the force readings.
        presence: Decides whether something presses on the pad.

    Attributes:
        main: Tare of the stream that measures the force.
        unloaded: The client that began the last tare states that nothing touches the finger, even if the normal force
            is clearly negative.
    """

    def __init__(self, main: Tare, image: ImageChannel | None, freshness: Freshness, presence: ContactPresence) -> None:
        self.main, self._image = main, image
        self._freshness, self._presence = freshness, presence
        self.unloaded = False

    def check_silence(self, t_ns: int, unread_ns: int | None) -> None:
        """Give up tares whose stream fell silent; arguments as of `Freshness.silent_ns`."""
        main, image = self.main, self._image
        if main.busy and self._freshness.silent_ns(t_ns, unread_ns) > LONGEST_GAP_NS:
            main.abort("silent")
        if image is not None and image.tare.busy and image.freshness.silent_ns(t_ns, unread_ns) > LONGEST_GAP_NS:
            image.tare.abort("silent")

    def check_load(self, state: FingerState) -> None:
        """Give up tares that a load would spoil; ``state`` is that after the newest force reading."""
        main, image, presence = self.main, self._image, self._presence
        if main.busy and presence.is_pressed(state):
            main.abort("contact")
        elif main.busy and presence.is_pulled(state) and not self.unloaded:
            main.abort("pulled")
        if image is not None and image.tare.busy and presence.is_measured(state):
            image.tare.abort("contact")
