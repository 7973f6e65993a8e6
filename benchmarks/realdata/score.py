"""Compare what slipd reports on one run of pushes with what the object did."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from realdata.truth import Motion, Span, spans_where

from slipd.types.arrays import Array

NEAR_S, NEAR_M = 0.05, 1.0e-3
"""An onset is reported in time by either of these."""

AHEAD_S = 0.5
"""A report that begins up to this long before an onset, and ends before it, is about this onset."""

STEPS = 200
"""Limits that an oracle tries."""

TREMOR_ROWS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What was published over a run: time, utilisation, required friction, and μ in use; each of shape (rows,)."""

    time_s: Array
    utilisation: Array
    required: Array
    mu: Array


@dataclass(frozen=True, slots=True)
class Onset:
    """One onset: when it was reported, s after it, and how far the object had moved by then; None: not in the slide."""

    late_s: float | None
    late_m: float | None

    @property
    def in_time(self) -> bool:
        """Whether it was reported within `NEAR_S` or `NEAR_M`."""
        return self.late_s is not None and self.late_m is not None and (self.late_s <= NEAR_S or self.late_m <= NEAR_M)


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """How the reports of one run agree with its motion.

    Attributes:
        onsets: One for each slide.
        slid_s: Time in which the object slid.
        reported_s: Part of it that was reported.
        rested_s: Time in which it rested.
        false_s: Part of it in which sliding was reported.
        clear: Rests in which the pusher is clear of the object, and how many of them had a report.
        pressed: Rests in which the pusher presses against the object, likewise.
    """

    onsets: list[Onset]
    slid_s: float
    reported_s: float
    rested_s: float
    false_s: float
    clear: tuple[int, int]
    pressed: tuple[int, int]


def score(motion: Motion, reports: list[Span], pressed: list[bool]) -> Score:
    """Compare reports of sliding with a motion; ``pressed`` says of each rest whether the pusher presses."""
    rests: dict[bool, list[bool]] = {False: [], True: []}
    for rest, is_pressed in zip(motion.rests, pressed, strict=True):
        rests[is_pressed].append(any(overlap_s(rest, report) > 0.0 for report in reports))
    return Score(
        [_onset(motion, slide, reports) for slide in motion.slides],
        sum(slide.seconds for slide in motion.slides),
        sum(overlap_s(slide, report) for slide in motion.slides for report in reports),
        sum(rest.seconds for rest in motion.rests),
        sum(overlap_s(rest, report) for rest in motion.rests for report in reports),
        (len(rests[False]), sum(rests[False])),
        (len(rests[True]), sum(rests[True])),
    )


def overlap_s(one: Span, other: Span) -> float:
    """Return for how long two spans hold together, s."""
    return max(0.0, min(one.end_s, other.end_s) - max(one.begin_s, other.begin_s))


def _onset(motion: Motion, slide: Span, reports: Iterable[Span]) -> Onset:
    about = [span for span in reports if span.end_s > slide.begin_s - AHEAD_S and span.begin_s < slide.end_s]
    if not about:
        return Onset(None, None)
    first_s = max(min(span.begin_s if span.end_s > slide.begin_s else slide.begin_s for span in about), slide.begin_s)
    return Onset(first_s - slide.begin_s, motion.travel_m(slide.begin_s, first_s))


def oracle(motion: Motion, time_s: Array, signal: Array, pressed: list[bool]) -> Score:
    """Return the score of the best limit on a signal of this run, chosen with the motion in view.

    It shows what the signal alone allows: best is the limit with which the object slides above it and rests below it
    for the longest time.
    """
    sliding, resting = (_within(time_s, spans) for spans in (motion.slides, motion.rests))
    limits = np.quantile(signal, np.linspace(0.0, 1.0, STEPS))
    gains = [(signal[sliding] > limit).mean() - (signal[resting] > limit).mean() for limit in limits]
    return score(motion, spans_where(time_s, signal > limits[int(np.argmax(gains))]), pressed)


def tremor(course: Course) -> Array:
    """Return the standard deviation of the required friction around its trend over the last 0.1 s."""
    rows = np.lib.stride_tricks.sliding_window_view(course.required, TREMOR_ROWS)
    trend = np.polyfit(np.arange(TREMOR_ROWS), rows.T, 1)
    rest = rows - trend[1][:, None] - trend[0][:, None] * np.arange(TREMOR_ROWS)
    return np.concatenate((np.zeros(TREMOR_ROWS - 1), rest.std(axis=1)))


def _within(time_s: Array, spans: list[Span]) -> NDArray[np.bool_]:
    found = np.zeros(len(time_s), dtype=bool)
    for span in spans:
        found |= (time_s >= span.begin_s) & (time_s <= span.end_s)
    return found
