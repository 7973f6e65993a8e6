"""Turn one sample into a verdict: the order of all steps.

A force reading passes `ForceChannel.condition` (checks, tare, mounting, weight, drift), is marked if it is too late,
and goes with the newest image of its time through `ContactEstimator.estimate`, whose rows `VerdictBatch` turns into
states. An image passes `ImageChannel.update`, and is compared with the force by `ForceImageCheck`; that of three-axis
taxels is a force reading too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.finger.contact_estimator import ContactEstimator, Learning
from slipd.finger.contact_motion import ContactMotion
from slipd.finger.contact_presence import ContactPresence
from slipd.finger.finger_state import FingerState
from slipd.finger.force_channel import NO_UNCERTAINTY, ForceChannel, WrenchBatch
from slipd.finger.force_image_check import ForceImageCheck
from slipd.finger.force_summary import NO_SUMMARY
from slipd.finger.freshness import Arrival, Freshness
from slipd.finger.image_channel import ImageChannel
from slipd.finger.negative_force import NegativeForceDetector
from slipd.finger.tare_guard import TareGuard
from slipd.finger.three_axis import wrench_by_taxels
from slipd.finger.trust import is_trusted
from slipd.finger.verdict import PAD_FREE, ROTATION_UNOBSERVED, STREAM_STALE, Verdict
from slipd.finger.verdict_batch import VerdictBatch
from slipd.fusion.rows import LATE, PULLED
from slipd.motion.evidence import evidence_mask
from slipd.signals.tare import Tare
from slipd.types.samples import TactileSample, WrenchSample

LEVELS_BY_IMAGE = frozenset({"stable", "caution"})
"""Levels that need an image. Without it they become unknown; a worse level stays as it is."""


class VerdictPath:
    """Turns the samples of one finger into verdicts, and keeps the newest.

    Args:
        config: ``[finger.X]``.
        levels: ``[levels]``.
        force: The force sensor; None where the pad measures the force.
        image: The pad; None where there is none.
        tare: Tare of the stream that measures the force.
        freshness: Of the force readings.

    Attributes:
        newest: The newest verdicts; their end is that on the newest force reading.
        estimator: The contact, read by read.
        presence: Whether something presses on the pad.
        negative_force: Limit of a negative normal force.
        motion: Evidence of motion beside the load; None where the pad measures the force.
        tares: Tares of both channels while they are measured.
    """

    def __init__(
        self,
        config: FingerConfig,
        levels: Levels,
        force: ForceChannel | None,
        image: ImageChannel | None,
        tare: Tare,
        freshness: Freshness,
    ) -> None:
        self._force, self._image, self._freshness = force, image, freshness
        self.newest: FingerState | VerdictBatch = FingerState(0, STREAM_STALE)
        self._check: ForceImageCheck | None = None
        if config.pad is not None and force is not None and image is not None:
            self._check = ForceImageCheck(config, config.pad, force, image)
        self.estimator = ContactEstimator(config, levels)
        self.presence = ContactPresence(config, force, image, self.estimator, freshness)
        self.negative_force = NegativeForceDetector(config)
        self.motion = None if config.wrench is None else ContactMotion(config.wrench, image)
        self.tares = TareGuard(tare, image, freshness, self.presence)
        self._force_zero, self._image_zero = self.tares.current

    @property
    def state(self) -> FingerState:
        """State after the newest force reading."""
        newest = self.newest
        return newest if isinstance(newest, FingerState) else newest[-1]

    def decide(
        self,
        force: ForceChannel,
        samples: Sequence[WrenchSample],
        times_ns: Sequence[int],
        arrival: Arrival,
        t_ns: int | None = None,
    ) -> Iterator[VerdictBatch]:
        """Yield the verdicts on the force readings of one read: one batch, or one by one while a tare is measured.

        Args:
            force: The force sensor.
            samples: The readings.
            times_ns: When each was acquired, CLOCK_MONOTONIC.
            arrival: How they reached the daemon.
            t_ns: Now, if they were delayed; None: they were just received.
        """
        force.begin_read(times_ns[0], arrival)
        step = 1 if force.tare.busy else len(samples)
        for k in range(0, len(samples), step):
            readings = force.condition(samples[k : k + step], times_ns[k : k + step], self._is_untouched)
            yield self._estimate(readings if t_ns is None else readings._replace(received_ns=t_ns), arrival)

    def update_image(
        self, image: ImageChannel, sample: TactileSample, acquired_ns: int | None, arrival: Arrival
    ) -> VerdictBatch | None:
        """Update with an image; return the verdict where its three-axis taxels are what measures the force."""
        check, t_ns, newest = self._check, sample.t_ns if acquired_ns is None else acquired_ns, self.newest
        before_ns = t_ns if image.t_ns is None else image.t_ns
        normal_n = newest.normal_n
        summary = NO_SUMMARY if check is None else check.take_summary(normal_n, free=newest.level == PAD_FREE.level)
        image.update(sample, t_ns, summary, arrival)
        if check is not None:
            check.update_image(t_ns, self.estimator.least_normal_n, known=normal_n is not None)
        if check is not None and self.motion is not None:
            self._look_for_motion(self.motion, image, check, before_ns, t_ns)
        if self._force is not None or not image.three_axis:
            return None
        return self._estimate(wrench_by_taxels(image, sample, t_ns), arrival)

    def _look_for_motion(
        self, motion: ContactMotion, image: ImageChannel, check: ForceImageCheck, before_ns: int, t_ns: int
    ) -> None:
        """Look for motion in an image, with the forces since the one before, where force sensor and image agree."""
        if self.estimator.in_contact and image.is_independent and not check.disagreement:
            motion.update_image(image, t_ns, check.mean_wrench(before_ns, t_ns))
        else:
            motion.forget_image()

    def _estimate(self, readings: WrenchBatch, arrival: Arrival) -> VerdictBatch:
        """Return the verdicts on conditioned readings, and update the comparison and the tares with them."""
        force, image, check = self._force, self._image, self._check
        self._mark_late(readings, arrival)
        self._freshness.update(readings.received_ns, readings.times_ns[-1], arrival)
        uncertainty = NO_UNCERTAINTY if force is None else force.uncertainty(readings.times_ns[-1])
        batch = self.estimator.estimate(
            readings,
            uncertainty,
            image.load_distribution if image is not None and _serves(image, readings, arrival) else None,
            () if check is None else check.disagreement,
            "" if image is None else image.fault,
            self.negative_force.least_n(uncertainty, tared=self.presence.zero_known),
            self._learning(arrival),
            image_free=uncertainty.force_n > 0.0 and self.presence.is_free_by_image(),
            zero_known=self.presence.zero_known,
        )
        self.newest = batch
        if PULLED in batch.phases and self.tares.main.current.origin == "stored":
            cast("ForceChannel | ImageChannel", self._force or self._image).reject_tare(
                "the normal force is clearly negative"
            )
        if self.motion is not None:
            self.motion.update_force(batch)
        if check is not None:
            check.update_force(batch)
        if self.tares.busy:
            self.tares.check_load(self.state)
        return batch

    def _learning(self, arrival: Arrival) -> Learning:
        """Return what readings that arrived so may teach of friction; a new zero casts doubt on what they taught."""
        image, force_zero, image_zero = self._image, *self.tares.current
        if force_zero is not self._force_zero or image_zero is not self._image_zero:
            self._force_zero, self._image_zero = force_zero, image_zero
            self.estimator.friction.doubt()
        if image is None or self.tares.busy or arrival.waited_ns:
            return Learning.NOTHING
        if not image.is_reliable(at_rest=True) or image.taxel_health.saturates:
            return Learning.NOTHING
        if self._force is not None and self._force.suspect and not self._force.rests:
            return Learning.NOTHING
        return Learning.ALL if self.presence.zero_known else Learning.SLIPS

    def _mark_late(self, readings: WrenchBatch, arrival: Arrival) -> None:
        """Mark readings that are too old.

        Time in which they waited for the daemon does not count, unless the stream was stale before them.
        """
        received_ns, times_ns, usable_ns = readings.received_ns, readings.times_ns, self._freshness.stale_ns
        if arrival.waited_ns and not (arrival.dated and self.newest.is_stale):
            usable_ns += arrival.waited_ns
        if received_ns - min(times_ns) > usable_ns:
            readings.rows["phase"][received_ns - np.array(times_ns) > usable_ns] = LATE

    def _is_untouched(self) -> bool | None:
        """Return whether nothing touches the finger; None: unknown."""
        disagreement = self._check is not None and bool(self._check.disagreement)
        return self.presence.is_untouched(self.state, disagreement=disagreement)

    def check_silence(self, t_ns: int, unread_ns: int | None) -> FingerState | None:
        """Update the verdict if a stream that it depends on fell silent; see `Finger.check_silence`."""
        self.tares.check_silence(t_ns, unread_ns)
        newest, image = self.newest, self._image
        if newest.is_stale:
            return None
        if self._freshness.is_stale(t_ns, unread_ns):
            return self.lose_force(t_ns)
        rests_on_image = newest.load_distribution is not None and newest.level in LEVELS_BY_IMAGE
        if rests_on_image and image is not None and not image.is_fresh(t_ns, unread_ns):
            return self._lose_image()
        return None

    def _lose_image(self) -> FingerState:
        """Return the state without the image: rotation is not observed any more."""
        self.newest = replace(
            self.state,
            verdict=ROTATION_UNOBSERVED,
            load_distribution=None,
            utilisation=None,
            tipping_margin_m=math.nan,
            assessment=None,
            model="none",
        )
        return self.newest

    def note_motion(self, until_ns: int, kinds: tuple[str, ...]) -> FingerState | None:
        """Report slip until a time, because evidence of these kinds shows that the object moves.

        Returns:
            The state of the newest reading with it; None where that reading does not touch, or is not trusted.
        """
        state = self.state
        found = state.assessment
        if found is None or not is_trusted(state.verdict):
            return None
        mask = found.evidence | evidence_mask(*kinds)
        self.estimator.note_motion(until_ns, mask)
        reasons = state.verdict.reasons
        slips = Verdict("slipping", reasons if "slip_detected" in reasons else ("slip_detected", *reasons))
        self.newest = replace(state, verdict=slips, assessment=found._replace(slips=True, evidence=mask))
        return self.newest

    def lose_force(self, t_ns: int) -> FingerState:
        """Return the state without the force, at ``t_ns``: the contact is forgotten, and nothing is known."""
        if self.estimator.in_contact:
            self.forget_comparison()
        self.estimator.end_contact()
        if self.motion is not None:
            self.motion.forget()
        self.newest = FingerState(t_ns, STREAM_STALE, age_s=self._freshness.age_s(t_ns))
        return self.newest

    def forget_comparison(self) -> None:
        """Forget what force sensor and image contradict each other about."""
        if self._check is not None:
            self._check.reset()


def _serves(image: ImageChannel, readings: WrenchBatch, arrival: Arrival) -> bool:
    """Return whether the newest image is fresh, and of the time of the readings where they waited."""
    if not image.is_fresh(readings.received_ns, arrival.unread_ns):
        return False
    if not arrival.waited_ns:
        return True
    until_ns = image.freshness.serves_until_ns(readings.received_ns - arrival.waited_ns)
    return until_ns is None or readings.times_ns[-1] <= until_ns
