"""Give up the tares of one finger that would take a load for zero, or that lost their stream."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slipd.finger.finger import Finger

LONGEST_GAP_NS = 500_000_000
"""Longest silence of its stream that a tare survives; during a longer one a contact may have come and gone."""


class TareGuard:
    """Watches the tares of one finger while they are measured.

    Args:
        finger: The finger.

    Attributes:
        unloaded: The client that began the last tare states that nothing touches the finger, even if the normal force
            is clearly negative.
    """

    def __init__(self, finger: Finger) -> None:
        self._finger = finger
        self.unloaded = False

    def check_silence(self, t_ns: int, unread_ns: int | None) -> None:
        """Give up tares whose stream fell silent; arguments as of `Freshness.silent_ns`."""
        main, image = self._finger.tare, self._finger.image
        if main.busy and self._finger.freshness.silent_ns(t_ns, unread_ns) > LONGEST_GAP_NS:
            main.abort("silent")
        if image is not None and image.tare.busy and image.freshness.silent_ns(t_ns, unread_ns) > LONGEST_GAP_NS:
            image.tare.abort("silent")

    def check_load(self) -> None:
        """Give up tares that the load of the newest force reading would spoil."""
        main, image, presence = self._finger.tare, self._finger.image, self._finger.presence
        if main.busy and presence.is_pressed():
            main.abort("contact")
        elif main.busy and presence.is_pulled() and not self.unloaded:
            main.abort("pulled")
        if image is not None and image.tare.busy and presence.is_measured():
            image.tare.abort("contact")
