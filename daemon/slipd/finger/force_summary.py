"""Summary of the force readings between two images, for the pad in front of the sensor."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True, frozen=True)
class ForceSummary:
    """Measurements of the finger's force sensor since the image before.

    Attributes:
        no_contact: It reads no contact. False also where it reads nothing: a held load must not be taken for an offset.
        normal_n: Normal force now, N; None: unknown.
        moving: The normal force moved beyond its noise; None: unknown.
        agrees: Force and images did not contradict each other so far.
    """

    no_contact: bool = False
    normal_n: float | None = None
    moving: bool | None = None
    agrees: bool = False


NO_SUMMARY = ForceSummary()
"""No force sensor, or its contact is not known."""
