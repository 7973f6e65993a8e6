"""The changes of level of a run, and the image of the pad at each alarm: the first ones, and the count of all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from slipd_client.messages.typed import SlipLevel
from slipd_client.pad_picture import PadImage, pad_image

MOST_CHANGES = 400
"""Changes that are listed; a run may have any number."""

MOST_SNAPSHOTS = 24
"""Images that are kept."""


@dataclass(slots=True)
class Change:
    """One change of level.

    Attributes:
        t_s: When, s.
        finger: Name of the finger.
        previous: The level before.
        level: The level after.
        reasons: Its reasons.
        evidence: Kinds of evidence of motion.
        utilisation: Utilisation then; None: not known.
        image: Image of the pad at a rise to an alarm; None for other changes, without an image, and for later alarms.
        centroid_m: Contact centroid then, x and y, m; None: not known.
        pole_m: Pole then, likewise.
    """

    t_s: float
    finger: str
    previous: str
    level: str
    reasons: tuple[str, ...]
    evidence: tuple[str, ...]
    utilisation: float | None
    image: PadImage | None = None
    centroid_m: list[float] | None = None
    pole_m: list[float] | None = None


class ChangeLog:
    """The changes of a run.

    Attributes:
        changes: The first ``MOST_CHANGES``, in order.
        count: Number of all.
        snapshots: Those of them with an image, the first ``MOST_SNAPSHOTS``.
        alarms: Number of all rises to an alarm.
    """

    def __init__(self) -> None:
        self.changes: list[Change] = []
        self.count = 0
        self.snapshots: list[Change] = []
        self.alarms = 0
        self._newest_image: dict[str, Mapping[str, Any]] = {}
        self._unfinished: dict[str, Change] = {}

    def add_image(self, finger: str, body: Mapping[str, Any]) -> None:
        """Add a message ``tactile``."""
        self._newest_image[finger] = body

    def forget_images(self) -> None:
        """Forget the newest image of each pad: it does not show what follows."""
        self._newest_image.clear()

    def add_change(self, t_s: float, body: Mapping[str, Any]) -> None:
        """Add a message ``warning``."""
        finger = body["finger"]
        words = tuple(body["reasons"]), tuple(body["evidence"])
        change = Change(t_s, finger, body["previous"], body["level"], *words, body["utilisation"])
        self.count += 1
        if len(self.changes) < MOST_CHANGES:
            self.changes.append(change)
        if not (body["rising"] and SlipLevel(change.level).alarming):
            return
        self.alarms += 1
        if len(self.snapshots) < MOST_SNAPSHOTS and finger in self._newest_image:
            change.image = pad_image(self._newest_image[finger])
            if change.image is not None:
                self.snapshots.append(change)
                self._unfinished[finger] = change

    def add_verdict(self, finger: str, body: Mapping[str, Any]) -> None:
        """Add a message ``slip``; the first one after a change is about the same reading."""
        change = self._unfinished.pop(finger, None)
        if change is not None:
            change.centroid_m, change.pole_m = body["centroid_m"], body["pole_m"]
