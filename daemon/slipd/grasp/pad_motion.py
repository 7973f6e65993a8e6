"""Evidence "image_change" of a grasp by pads that measure the force themselves: looks at the images of all of them.

Two quantities show motion: `ImageStep` is the change of the taxels' shares at unchanged grip, `LoadBelief` the odds of
motion by the load. `slipd.engine.held_motion` judges them with all other evidence.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slipd.finger.finger import Finger
from slipd.finger.trust import is_trusted
from slipd.motion.evidence import REPORTED_NS, SAME_SHARE, Evidence
from slipd.types.arrays import Array

LOOK_NS = 60_000_000
"""Least time between two looks: pads report 40 Hz and more, but many renew their readings at only 10 Hz."""
LOOKS_PER_HOUR = 3600.0 * 10.0
"""Independent looks in an hour; changes of the arm's motion last longer than the time between two looks."""
PAIR_PERIODS = 0.75
"""Images of two pads belong to one look where their times differ by at most this share of the slower pad's period. Each
sensor has a clock of its own: an image is at most half a period from the nearest one of the other pad, and jitter comes
on top."""
BACKGROUND = 0.0040
"""Scale of the exponential tail of the change without slip. Over 84 s of 13 holds with the arm moving (two pads of 16
taxels, 10 new images a second) the tail has a scale of 0.0039 from 0.004 up to 0.014, and is thinner up to the largest
of 794 looks, 0.028. It is the middle of the range in which the counts on labelled grasps change by two at most, 0.0034
to 0.0046. A grasp with more background of its own raises the scale."""
FOLLOW = 0.05
"""Share of each new change in the running mean of the grasp's own changes."""
TAIL_SHARE = 0.55
"""Scale of the tail over the mean change of a noisy hold, 0.0040 over 0.0076, rounded up."""

BELIEF_AT_LIMIT = 6.9
"""Odds of motion at the friction limit over those without load, in nats: 1000. They grow evenly with the load between,
as for a coefficient of friction known to about 20 %."""
AHEAD = 0.5
"""Part of the last change by which a load is extrapolated: a pad with 10 new images a second lags behind an object that
swings."""
NEAR_CARRIED = 0.85
"""A load above this share of the largest that was carried is a new one."""
SETTLED_LOOKS = 2
"""A load counts as carried when this many looks later nothing moves."""


def belong_together(times_ns: Sequence[int], period_ns: float) -> bool:
    """Return whether images of several pads, acquired at these times, are one look.

    Args:
        times_ns: When each was acquired, CLOCK_MONOTONIC.
        period_ns: Period of the slowest pad.
    """
    return max(times_ns) - min(times_ns) <= PAIR_PERIODS * period_ns


class _Look(NamedTuple):
    """Shares of the taxels of each pad, and the normal force of all pads."""

    t_ns: int
    shares: list[Array]
    total: float


class ImageStep:
    """Compares the images of all pads of a grasp from look to look.

    While the object sticks, the taxels' shares of the normal force change only a little: the arm accelerates, the
    elastomer creeps. When the object turns or slides in the fingers, its edges and its pressure move over the taxels.
    Both pads hold the same object, so the changes of both are averaged. A motion lasts longer than a look, and what the
    arm does swings back, so the larger one of the changes since the last look and since the one before counts. While
    the grip closes or opens, shares change without slip.
    """

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque(maxlen=2)
        self._scale = BACKGROUND

    def forget(self) -> None:
        """Forget the grasp: it ended."""
        self._looks.clear()
        self._scale = BACKGROUND

    def update(self, pressures: Sequence[Array], t_ns: int) -> float | None:
        """Look at the newest images.

        Args:
            pressures: Normal force on each taxel of each pad, ≥ 0 with a positive sum, one array a pad; any unit.
            t_ns: When the newest was acquired.

        Returns:
            Surprise of the change since the looks before. None where this is no look: it is too early, an image
            repeats, the grip changed, or there is nothing to compare with.
        """
        totals = [float(pressure.sum()) for pressure in pressures]
        shares = [pressure / total for pressure, total in zip(pressures, totals, strict=True)]
        look = _Look(t_ns, shares, sum(totals))
        last = self._looks[-1] if self._looks else None
        if last is not None and t_ns - last.t_ns <= REPORTED_NS:
            if t_ns - last.t_ns < LOOK_NS or any(map(np.array_equal, shares, last.shares)):
                return None
            if _same_grip(last, look):
                change = max(_change(before, look) for before in self._looks if _same_grip(before, look))
                self._looks.append(look)
                surprise = change / max(self._scale, BACKGROUND)
                self._scale += FOLLOW * (TAIL_SHARE * min(change, 2.0 * self._scale) - self._scale)
                return surprise
        self._looks.clear()  # later looks are compared with this one
        self._looks.append(look)
        return None


def _same_grip(before: _Look, now: _Look) -> bool:
    return abs(now.total - before.total) <= SAME_SHARE * now.total


def _change(before: _Look, now: _Look) -> float:
    """Return the change of the shares, as the length of a vector: the mean of all pads."""
    changes = [float(np.linalg.norm(new - old)) for new, old in zip(now.shares, before.shares, strict=True)]
    return sum(changes) / len(changes)


class LoadBelief:
    """Belief that the object moves, from the load of a grasp alone: how near it is to what friction carries.

    Two utilisations count, the larger one decides: that of the tangential force alone, R / μ, and that of the spin
    alone, m / (μ f_n ρ), with ρ the mean distance of the normal load from its centroid. What a grasp carried before
    without motion shows that μ is larger: a load below that adds no belief.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget the grasp: it ended."""
        self._before: tuple[float, float] | None = None
        self.forget_carried()

    def forget_carried(self) -> None:
        """Forget what was carried: the object moved, and lies otherwise now."""
        self._carried = 0.0
        self._recent: deque[float] = deque(maxlen=SETTLED_LOOKS)

    def update(self, spin: float, tangential: float) -> float:
        """Add a look.

        Args:
            spin: Utilisation by the spin alone, with the sign of the spin.
            tangential: Utilisation by the tangential force alone, ≥ 0.

        Returns:
            Odds of motion over those without load, in nats.
        """
        spin_before, tangential_before = self._before or (spin, tangential)
        self._before = spin, tangential
        ahead = max(abs(spin + AHEAD * (spin - spin_before)), tangential + AHEAD * (tangential - tangential_before))
        if len(self._recent) == SETTLED_LOOKS:
            self._carried = max(self._carried, self._recent[0])
        self._recent.append(max(abs(spin), tangential))
        return BELIEF_AT_LIMIT * ahead if ahead >= NEAR_CARRIED * self._carried else 0.0


LEAST_SURPRISE = 1.0
"""The load counts only beside an image that changes by more than that of a hold does in the mean: a pad that is still
shows no motion, however near the limit its load is. By the definition of `slipd.grasp.pad_motion.BACKGROUND`."""
SENSES = 1.0, -1.0
"""Signs of the spin of one twist of the object on the first and the second pad, which face each other."""


class PadMotion:
    """Looks at the pads of a grasp for motion of the object.

    Args:
        fingers: The one or two fingers whose pad measures the force.
    """

    looks_per_hour = LOOKS_PER_HOUR

    def __init__(self, fingers: Sequence[Finger]) -> None:
        self._fingers = fingers
        self._period_ns = max(1e9 / finger.config.pad.rate_hz for finger in fingers if finger.config.pad is not None)
        self._step, self._belief = ImageStep(), LoadBelief()

    def update(self) -> tuple[Evidence, float] | None:
        """Look after an image of a pad.

        Returns:
            Evidence, and the odds of motion by the load alone, in nats. None where this is no look.
        """
        images = [finger.image for finger in self._fingers if finger.image is not None]
        loads = [load for finger in self._fingers if (load := _load(finger)) is not None]
        times_ns = [image.t_ns for image in images if image.t_ns is not None]
        if not len(loads) == len(times_ns) == len(self._fingers):
            self._step.forget()
            self._belief.forget()
            return None
        if not belong_together(times_ns, self._period_ns):
            return None  # the other pad's image of this time is still to come
        t_ns = max(times_ns)
        surprise = self._step.update([image.pressure for image in images], t_ns)
        if surprise is None:
            return None
        spin = sum(sense * load[0] for sense, load in zip(SENSES, loads, strict=False)) / len(loads)
        tangential = sum(load[1] for load in loads) / len(loads)
        belief = self._belief.update(spin, tangential)
        return Evidence("image_change", t_ns, surprise), belief if surprise > LEAST_SURPRISE else 0.0

    def confirm(self) -> None:
        """Take the newest evidence as true: the object lies otherwise now, so what was carried does not count."""
        self._belief.forget_carried()


def make_pad_motion(fingers: Sequence[Finger]) -> PadMotion | None:
    """Make the look at all pads; None where a finger has a force sensor, or no pad that measures the force."""
    alone = all(finger.force is None and finger.image is not None and finger.image.three_axis for finger in fingers)
    return PadMotion(fingers) if alone and len(fingers) <= len(SENSES) else None


def _load(finger: Finger) -> tuple[float, float] | None:
    """Return utilisation by the spin, signed, and by the tangential force; 0 for both where no friction is stated.

    None without a contact and an image of it, or where the readings are not trusted. The stated friction counts, not
    what this grasp taught: a look is compared with what was carried before it.
    """
    contact, distribution, friction = finger.state.contact, finger.state.load_distribution, finger.friction
    if contact is None or distribution is None or math.isnan(contact.spin_nm) or not is_trusted(finger.state.verdict):
        return None
    stated = friction.stated
    if stated is None:
        return 0.0, 0.0
    return distribution.spin_required(contact) / (friction.rotation.stated or stated), contact.friction_ratio / stated
