"""What the object really did, from its motion capture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from slipd.tools.recordings.pushes_import import CENTRE_M, Pushes
from slipd.types.arrays import Array

ARM_M = 0.025
"""Turns count times this arm, about the mean distance of the support from its centre, m."""

SMOOTHED = 7
"""Poses in a moving mean: 0.12 s at 60 Hz."""

WINDOW_S = 0.1
"""The speed is the displacement of the mean over this time; 0.04 mm of noise then reads as 0.2 mm/s."""

SLIDES_MPS, RESTS_MPS = 1.0e-3, 0.3e-3
"""Speeds above which the object slides, and below which it rests, m/s; the pusher moves at 3 to 10 mm/s."""

TRAVEL_M = 1.0e-3
"""Least travel of a slide, m: less is a tremor of the stand or of the markers."""

PAUSE_S = 0.2
"""Two slides with a shorter pause between them are one; a rest begins and ends this long from any slide, s."""

REST_S = 0.5
PUSHED_N = 0.05
"""Tangential force above which the pusher presses against the resting object, N; the zero drifts by 0.02."""

BEGIN_M = 0.1e-3
"""A slide begins when the object has moved so far from where it stood, m."""


@dataclass(frozen=True, slots=True)
class Span:
    """A time of a run, s."""

    begin_s: float
    end_s: float

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return self.end_s - self.begin_s


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion of one run.

    Attributes:
        time_s: Times of the poses.
        path_m: Travel up to each of them, turns included.
        slides: Times in which it slides.
        rests: Times in which it rests.
    """

    time_s: Array
    path_m: Array
    slides: list[Span]
    rests: list[Span]

    def travel_m(self, begin_s: float, end_s: float) -> float:
        """Return how far the object moves in this time."""
        begin, end = np.interp((begin_s, end_s), self.time_s, self.path_m)
        return float(end - begin)


def motion(pushes: Pushes) -> Motion:
    """Find slides and rests of one run."""
    time_s, place = pushes.object[:, 0], _place(pushes.object)
    half = WINDOW_S / 2.0
    before, after = (_at(time_s, place, time_s + shift) for shift in (-half, half))
    speed = np.linalg.norm(after - before, axis=1) / WINDOW_S
    path_m = np.concatenate(([0.0], np.cumsum(speed[:-1] * np.diff(time_s))))
    found = Motion(time_s, path_m, [], [])
    moving = _merged(spans_where(time_s, speed > SLIDES_MPS), PAUSE_S)
    for span in moving:
        if np.linalg.norm(_at(time_s, place, span.end_s) - _at(time_s, place, span.begin_s)) >= TRAVEL_M:
            found.slides.append(Span(_begin_s(time_s, place, span), span.end_s))
    calm = speed < RESTS_MPS
    for span in (*moving, *found.slides):
        calm &= (time_s < span.begin_s - PAUSE_S) | (time_s > span.end_s + PAUSE_S)
    found.rests.extend(span for span in _merged(spans_where(time_s, calm), PAUSE_S) if span.seconds >= REST_S)
    return found


def _place(poses: Array) -> Array:
    """Return the place of the centre of mass and the turn times its arm, shape (rows, 3), m."""
    heading = np.unwrap(poses[:, 3])
    cos, sin, (x, y) = np.cos(heading), np.sin(heading), CENTRE_M
    place = np.stack((poses[:, 1] + cos * x + sin * y, poses[:, 2] + sin * x - cos * y, heading * ARM_M), axis=1)
    return uniform_filter1d(place, SMOOTHED, axis=0, mode="nearest")


def _at(time_s: Array, place: Array, when_s: float | Array) -> Array:
    return np.stack([np.interp(when_s, time_s, part) for part in place.T], axis=-1)


def _begin_s(time_s: Array, place: Array, span: Span) -> float:
    """Return when the object has left the place where it stood before a slide."""
    stood = (time_s >= span.begin_s - 2.0 * PAUSE_S) & (time_s <= span.begin_s - WINDOW_S / 2.0)
    if not stood.any():
        return span.begin_s
    away = np.linalg.norm(place - np.median(place[stood], axis=0), axis=1) > BEGIN_M
    left = np.flatnonzero(away & (time_s >= span.begin_s - WINDOW_S / 2.0))
    return min(float(time_s[left[0]]), span.end_s) if len(left) else span.begin_s


def spans_where(time_s: Array, holds: NDArray[np.bool_]) -> list[Span]:
    """Return the times in which something holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], holds.astype(int), [0]))))
    return [Span(float(time_s[begin]), float(time_s[end - 1])) for begin, end in edges.reshape(-1, 2)]


def _merged(spans: list[Span], pause_s: float) -> list[Span]:
    found: list[Span] = []
    for span in spans:
        if found and span.begin_s - found[-1].end_s < pause_s:
            found[-1] = Span(found[-1].begin_s, span.end_s)
        else:
            found.append(span)
    return found
