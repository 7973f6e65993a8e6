"""One finger of the gripper: samples in, verdicts out, and its state for the other rooms.

This file has the order of all steps. A force reading passes `ForceChannel.condition` (checks, tare, mounting, weight,
drift), is marked if it is too late, and goes with the newest image of its time through `ContactEstimator.estimate`. An
image passes `ImageChannel.update`, and is compared with the force by `ForceImageCheck`; that of three-axis taxels is a
force reading too. What a verdict depends on and what changes rarely is noted where it changes, by `_follow_tares` and
`_follow_image`, and not asked for at each reading.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import replace

from slipd.config import Finger as FingerConfig
from slipd.config import Levels, in_newtons
from slipd.finger.contact_estimator import ContactEstimator
from slipd.finger.finger_state import FingerState, VerdictBatch
from slipd.finger.finger_tares import TareGuard
from slipd.finger.force_channel import ForceChannel, WrenchBatch
from slipd.finger.force_image_check import CLEAR, NO_SUMMARY, ForceImageCheck
from slipd.finger.freshness import PROMPT, Arrival, Read, pop_served
from slipd.finger.image_channel import STALE, ImageChannel
from slipd.finger.trust import ContactPresence, Trust, is_trusted
from slipd.finger.verdict import PAD_FREE, ROTATION_UNOBSERVED, STREAM_STALE, Verdict
from slipd.fusion.contact_state import WrenchUncertainty
from slipd.fusion.recent_forces import mean_wrench
from slipd.fusion.rows import LATE, PULLED, TOUCHING
from slipd.fusion.streaming import without_verdict
from slipd.motion.evidence import Evidence, evidence_mask
from slipd.motion.image_shift import ImageShift
from slipd.signals.tare import Offset
from slipd.types.samples import TactileSample
from slipd_client.messages import LEVELS

LEVELS_BY_IMAGE = frozenset({"stable", "caution"})
"""Levels that need an image. Without it they become unknown; a worse level stays as it is."""


class Finger:
    """A force sensor with a pad in front of it, one of both, or a pad of three-axis taxels.

    Force readings come through `decide`, images through `update_image`, the passing of time through `check_silence`.

    Args:
        name: Name of the finger.
        config: ``[finger.X]``.
        levels: ``[levels]``.

    Attributes:
        name: Name of the finger.
        config: ``[finger.X]``.
        force: The force sensor; None where the pad measures the force.
        image: The pad; None where there is none.
        channels: Both by stream, "wrench" first; a stream that the finger does not have is missing.
        main_stream: The stream that measures the force, "wrench" or "pad"; ``main``: its channel; ``tare``: its tare.
        in_newtons: Forces are in newtons, not in the unit of a pad without calibration.
        image_in_newtons: Likewise the loads of the image.
        friction: Coefficients of friction in use, and who set them.
        motion: Looks for motion in the images; None without a pad in front of a force sensor.
        motion_evidence: Evidence of motion in the newest image; None where it shows none.
        freshness: Of the force readings.
        presence: Whether something presses on the pad.
        trust: Whether the readings are trusted, and a grip may be raised on them.
        level: Level after the newest force reading.
        zero_known: The zero of the force is known. Without it, a reading may be a bias of any size.
    """

    def __init__(self, name: str, config: FingerConfig, levels: Levels) -> None:
        wrench, pad = config.wrench, config.pad
        self.name, self.config = name, config
        self._estimator = ContactEstimator(config, levels)
        self.friction, state = self._estimator.friction, self._estimator.contact.row
        self.force = ForceChannel(wrench, state) if wrench is not None else None
        self.image = ImageChannel(pad, config) if pad is not None else None
        both = {"wrench": self.force, "pad": self.image}
        self.channels = {stream: channel for stream, channel in both.items() if channel is not None}
        self.main_stream = "pad" if wrench is None else "wrench"
        self.main = self.channels[self.main_stream]
        self.tare = self.main.tare
        self.image_in_newtons = pad is not None and in_newtons(pad)
        self.in_newtons = wrench is not None or self.image_in_newtons
        self.freshness = self.main.freshness
        self.presence, self.trust, self._guard = ContactPresence(self), Trust(self), TareGuard(self)
        self._delayed: deque[Read] = deque()
        self._newest: FingerState | VerdictBatch = FingerState(0, STREAM_STALE)
        self.level, self._stale = STREAM_STALE.level, True  # of the newest reading
        self._check: ForceImageCheck | None = None
        if pad is not None and self.force is not None and self.image is not None:
            self._check = ForceImageCheck(config, pad, self.force, self.image, state)
        self.motion: ImageShift | None = None
        self.motion_evidence: Evidence | None = None
        if wrench is not None and self.image is not None and not self.image.three_axis:
            lever_m = math.hypot(*wrench.pad_from_sensor.xyz_m)
            torque_nm = math.hypot(wrench.torque_std_nm, lever_m * wrench.force_std_n)
            self.motion = ImageShift(self.image.geometry, WrenchUncertainty(wrench.force_std_n, torque_nm))
        # noted where they change, by _follow_tares and _follow_image
        noise = WrenchUncertainty() if self.force is None else self.force.noise
        self._in_force: tuple[WrenchUncertainty, bool | None] = noise, None
        self._image_fault, self._image_teaches = "", False
        for channel in self.channels.values():
            channel.tare.on_change.append(self._follow_tares)
        self._follow_tares(self.tare.current, self.tare.current)

    # Samples

    def decide(self, read: Read) -> Iterable[VerdictBatch]:
        """Return the verdicts on the force readings of one read: one batch, or one for each while a tare is measured.

        After a stall of the daemon, readings may first wait for the image of their time; see `decide_delayed`.

        Raises:
            ValueError: The finger has no force sensor.
        """
        force = self.force
        if force is None:
            raise ValueError(f"finger {self.name} has no force sensor")
        if read.arrival.waited_ns or self._delayed:
            self._delayed.append(read)
            return self.decide_delayed(read.samples[-1].t_ns, read.arrival.unread_ns)
        return self._judge_read(force, read)

    def decide_delayed(self, t_ns: int, unread_ns: int | None = None) -> Iterable[VerdictBatch]:
        """Return the verdicts on the force readings that need not wait for an image any more.

        Args:
            t_ns: Now.
            unread_ns: How long the image's line counts as unread; None: it is empty, and no image is awaited.
        """
        force, image, until_ns = self.force, self.image, None
        if force is None or not self._delayed:
            return ()
        if unread_ns and image is not None and image.is_fresh(t_ns, unread_ns):
            until_ns = image.freshness.serves_until_ns(t_ns - unread_ns)
        served = pop_served(self._delayed, until_ns, t_ns, unread_ns)
        return (batch for read in served for batch in self._judge_read(force, read, t_ns))

    def _judge_read(self, force: ForceChannel, read: Read, received_ns: int | None = None) -> Iterable[VerdictBatch]:
        """Return the verdicts on a read, as received at ``received_ns``; None: when it was."""
        samples, times_ns, arrival, _ = read
        force.begin_read(times_ns[0], arrival)
        if not force.tare.busy:
            return (self._judge(force.condition(samples, times_ns, self._may_learn_zero, received_ns), arrival),)
        return (
            self._judge(force.condition((sample,), (time_ns,), self._may_learn_zero, received_ns), arrival)
            for sample, time_ns in zip(samples, times_ns, strict=True)
        )

    def update_image(
        self, sample: TactileSample, acquired_ns: int | None = None, arrival: Arrival = PROMPT
    ) -> tuple[VerdictBatch, ...]:
        """Update with an image.

        Args:
            sample: The image, of as many taxels as the pad has.
            acquired_ns: When it was acquired, CLOCK_MONOTONIC; None: when it was received.
            arrival: How it reached the daemon.

        Returns:
            The verdict on it where three-axis taxels are what measures the force; else none.
        """
        image, check = self.image, self._check
        if image is None:
            return ()
        t_ns, normal_n, summary = sample.t_ns if acquired_ns is None else acquired_ns, None, NO_SUMMARY
        before_ns = t_ns if image.t_ns is None else image.t_ns
        if check is not None:
            normal_n = self._newest.normal_n
            summary = check.take_summary(normal_n, free=self.level == PAD_FREE.level)
        image.update(sample, t_ns, summary, arrival)
        if check is not None:
            check.update_image(t_ns, known=normal_n is not None)
            if self.motion is not None:
                self.motion_evidence = self._look_for_motion(self.motion, image, check, before_ns, t_ns)
        readings = image.force_reading(sample, t_ns) if self.force is None and image.three_axis else None
        self._follow_image()
        return () if readings is None else (self._judge(readings, arrival),)

    def _look_for_motion(
        self, motion: ImageShift, image: ImageChannel, check: ForceImageCheck, before_ns: int, t_ns: int
    ) -> Evidence | None:
        """Look for motion in an image, with the forces since the one before, where force sensor and image agree."""
        if self.in_contact and image.is_independent and not check.agreement.reported:
            wrench = mean_wrench(self._estimator.contact.row, before_ns, t_ns)
            return motion.update(t_ns, image.loads, wrench, image.taxel_health.measured)
        motion.reset()
        return None

    def _judge(self, readings: WrenchBatch, arrival: Arrival) -> VerdictBatch:
        """Return the verdicts on conditioned readings, and update the comparison and the tares with them."""
        force, check, received_ns, newest_ns = self.force, self._check, readings.received_ns, readings.times_ns[-1]
        usable_ns = self.freshness.stale_ns
        if arrival.waited_ns and not (arrival.dated and self._stale):
            usable_ns += arrival.waited_ns  # the daemon let them wait, and the stream was not stale before them
        sure = True
        if force is not None:  # an image has updated its own
            self.freshness.update(received_ns, newest_ns, arrival)
            sure = force.watch.rests or not force.watch.suspect
            if force.mass_kg > 0.0:
                self._set_uncertainty(force.uncertainty(newest_ns))
        serves = self.image is not None and self.image.serves(newest_ns, received_ns, arrival)
        batch = self._estimator.estimate(
            readings,
            self.image if serves else None,
            received_ns - usable_ns,
            () if check is None else check.agreement.reported,
            self._image_fault,
            teaches=sure and self._image_teaches and not arrival.waited_ns,
            image_free=not self._estimator.certain and self.presence.is_free_by_image(),
        )
        self._newest, self.level = batch, LEVELS[batch.levels[-1]]
        self._stale = bool(batch.phases & 1 << LATE) and batch.phase(-1) == LATE
        if batch.phases & 1 << PULLED:
            self.tare.reject("the normal force is clearly negative")
        if self.motion is not None and batch.phases != 1 << TOUCHING:
            self.motion.reset()
        if check is not None and batch.ends_at < len(batch.levels):
            check.agreement.reset()
        if self._taring:
            self._guard.check_load()
        return batch

    def _may_learn_zero(self) -> bool | None:
        """Return whether nothing touches the finger; None: unknown."""
        disagreement = self._check is not None and bool(self._check.agreement.reported)
        return self.presence.may_learn_zero(disagreement=disagreement)

    # What verdicts depend on, noted where it changes

    def _follow_tares(self, now: Offset, before: Offset) -> None:
        """Follow a change of a tare: what was pulled, or learned of friction, with the zero before is in doubt."""
        self._taring = any(channel.tare.busy for channel in self.channels.values())
        self.zero_known = self.main.zero.known
        self._set_uncertainty(self._in_force[0])
        if now is not before:
            self.friction.doubt()
            self._estimator.contact.row["memory"]["pulled_s"] = -math.inf
        self._follow_image()

    def _set_uncertainty(self, uncertainty: WrenchUncertainty) -> None:
        """Put the uncertainty of the readings in force, if it or what is known of the zero changed."""
        if (uncertainty, self.zero_known) != self._in_force:
            self._in_force = uncertainty, self.zero_known
            self._estimator.set_uncertainty(uncertainty, zero_known=self.zero_known)

    def _follow_image(self) -> None:
        """Note what is wrong with the newest image, and whether readings beside it teach friction."""
        image = self.image
        if image is not None:
            self._image_fault = image.fault
            reliable = image.is_reliable(at_rest=True) and not image.taxel_health.saturates
            self._image_teaches = reliable and not self._taring

    # Time

    def check_silence(self, t_ns: int, unread_ns: int | None = None) -> FingerState | None:
        """Update the verdict if a stream that it depends on fell silent.

        Args:
            t_ns: Now.
            unread_ns: How long lines count as unread, which is no silence of a stream; None: they are empty.

        Returns:
            The new state; None where nothing changed.
        """
        if self._taring:
            self._guard.check_silence(t_ns, unread_ns)
        if self._stale:
            return None
        if self.freshness.is_stale(t_ns, unread_ns):
            return self._lose_force(t_ns)
        if not self._needs_image() or self.image is None or self.image.is_fresh(t_ns, unread_ns):
            return None
        return self._lose_image()

    def _needs_image(self) -> bool:
        """Return whether the newest verdict is unknown without its image."""
        return self.level in LEVELS_BY_IMAGE and self._newest.load_distribution is not None

    def quiet_until_ns(self, t_ns: int) -> int:
        """Return until when `check_silence` and `expire_image` find no change, unless an image comes; -1: not known.

        A stream that is stale at ``t_ns`` cannot become so again before it had time to bring a reading.
        """
        if self._delayed:
            return -1
        since_ns, image = t_ns if self._stale else self.freshness.came_ns or 0, self.image
        until_ns = since_ns + self.freshness.stale_ns
        if image is not None and (image.reasons != STALE or self._needs_image()):
            until_ns = min(until_ns, image.fresh_until_ns)
        return min(until_ns, self._guard.quiet_until_ns()) if self._taring else until_ns

    def expire_image(self, t_ns: int, unread_ns: int | None) -> bool:
        """Return whether the newest image just became too old, see `check_silence`; True once for each image."""
        return self.image is not None and self.image.expire(t_ns, unread_ns)

    def disconnect(self, t_ns: int) -> FingerState:
        """Return the state at ``t_ns`` without the force stream, which ended; its tare would average across the gap."""
        self.tare.abort("ended")
        self._delayed.clear()
        return self._lose_force(t_ns)

    def disconnect_image(self) -> None:
        """Forget the image: its stream ended."""
        if self._check is not None:
            self._check.agreement.reset()
        if self.image is not None:
            self.image.tare.abort("ended")
            self.image.forget()
            self._follow_image()

    def _lose_force(self, t_ns: int) -> FingerState:
        """Return the state without the force, at ``t_ns``: the contact is forgotten, and nothing is known."""
        if self.in_contact and self._check is not None:
            self._check.agreement.reset()
        self._estimator.end_contact()
        if self.motion is not None:
            self.motion.reset()
        return self._set_state(FingerState(t_ns, STREAM_STALE, age_s=self.freshness.age_s(t_ns)))

    def _lose_image(self) -> FingerState:
        """Return the state without the image: rotation is not observed any more."""
        state = self.state
        reading = None if state.reading is None else without_verdict(state.reading)
        return self._set_state(replace(state, verdict=ROTATION_UNOBSERVED, reading=reading, load_distribution=None))

    def note_motion(self, until_ns: int, kinds: tuple[str, ...]) -> FingerState | None:
        """Report slip until a time, because evidence of these kinds shows that the object moves.

        Returns:
            The state of the newest reading with it; None where that reading does not touch, or is not trusted.
        """
        state = self.state
        if state.reading is None or state.phase != TOUCHING or not is_trusted(state.verdict):
            return None
        reading = state.reading.copy()
        found = reading["assessment"]
        found["slips"] = True
        found["evidence"] |= evidence_mask(*kinds)
        self._estimator.note_motion(until_ns, found["evidence"].item(0))
        reasons = state.verdict.reasons
        slips = Verdict("slipping", reasons if "slip_detected" in reasons else ("slip_detected", *reasons))
        return self._set_state(replace(state, verdict=slips, reading=reading))

    # What is known now

    @property
    def state(self) -> FingerState:
        """State after the newest force reading."""
        newest = self._newest
        return newest if isinstance(newest, FingerState) else newest[-1]

    def _set_state(self, state: FingerState) -> FingerState:
        self._newest, self.level, self._stale = state, state.verdict.level, state.verdict is STREAM_STALE
        return state

    def is_fresh(self, stream: str, t_ns: int) -> bool:
        """Return whether readings of the stream "wrench" or "pad" came lately."""
        if stream == "wrench" or self.force is None:
            return not self._stale
        return self.image is not None and self.image.is_fresh(t_ns, None)

    @property
    def in_contact(self) -> bool:
        """The newest reading that could be trusted touches."""
        return bool(self._estimator.contact.row["memory"]["in_contact"][0])

    def note_grip(self, force_n: float) -> None:
        """Note the force on one pad of a grip that the gripper and another finger show together, N; 0: they do not."""
        if self._check is not None:
            self._check.agreement.gripped = force_n > CLEAR * self.config.min_normal_n

    # Requests

    def set_friction(self, mu_s: float, mu_d: float | None, by: str = "", t_ns: int | None = None) -> None:
        """Use the coefficients of friction that client ``by`` states at ``t_ns``; see `FrictionEstimate.set`."""
        self.friction.set(mu_s, mu_d, by, t_ns)
        self._estimator.contact.row["drop"]["least_drop"] = self.friction.drop

    def begin_tare(
        self, t_ns: int, seconds: float, by: str, stream: str | None = None, *, unloaded: bool = False
    ) -> None:
        """Begin to average unloaded readings.

        Args:
            t_ns: Now.
            seconds: Duration, s.
            by: The client that asks for it.
            stream: "wrench" or "pad"; None: the one that measures the force.
            unloaded: The client states that nothing touches the finger, even if the normal force is clearly negative.
        """
        self._guard.unloaded = unloaded
        self.channels[stream or self.main_stream].begin_tare(t_ns, seconds, by)
