"""One finger: its samples in, a verdict on every force reading out."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels, Stream, in_newtons, stale_after_ns
from slipd.finger.contact_estimator import ContactEstimator
from slipd.finger.finger_state import FingerState
from slipd.finger.force_channel import NO_DOUBT, UNTRUSTED_FAULTS, ForceChannel, WrenchBatch
from slipd.finger.freshness import PROMPT, Arrival, Freshness, HeldRead, HeldReads
from slipd.finger.friction import Friction
from slipd.finger.image_channel import UNFELT, Felt, ImageChannel, image_channel
from slipd.finger.pull import PullDetector
from slipd.finger.verdict import PAD_PULLED, ROTATION_UNOBSERVED, STREAM_STALE, WEIGHT_UNKNOWN
from slipd.finger.verdict_batch import VerdictBatch
from slipd.fusion import AS_IS, LATE, UNTRUSTED, USABLE, USE, Contact, Doubt, contact_of, wrench_told
from slipd.fusion.slip import NO_CONTACT
from slipd.samples import UNTRUSTED as UNTRUSTED_WORDS
from slipd.samples import TactileSample, WrenchSample
from slipd.signals.agreement import CLEAR, STDS, Agreement
from slipd.signals.tare import Tare
from slipd_client.messages import Health

#: The normal force moves where its range between two images is wider than this many times its noise.
MOVING_STDS = 6.0
#: Force and image are compared at most every 10 ms: a disagreement counts only once it has lasted for longer.
COMPARE_NS = 10_000_000
#: A tare bears a moment's silence; over a longer one nobody knows what touched the finger.
LONGEST_TARE_GAP_NS = 500_000_000
#: Reasons with which nobody knows what the fingers feel.
DOUBTS = frozenset({"stale", "not_finite", "disagreement", "not_tared", "pulled"}) | UNTRUSTED_WORDS | UNTRUSTED_FAULTS
#: Levels that an image alone can reach: without it they are unknown, and what is worse stays as it is.
RESTS_ON_IMAGE = frozenset({"stable", "caution"})
#: A grip is raised only on readings acquired no longer ago than this, or so many periods, beside the line's delay.
OLDEST_S, OLDEST_PERIODS = 0.05, 2.5
#: Of readings this far apart one is kept for an image of its time; the longest scan is a tenth of a second old.
PAST_NS, PASTS = 1_000_000, 128


class Finger:
    """One finger of the gripper.

    Args:
        name: Its name.
        config: ``[finger.X]``.
        levels: ``[levels]``.

    Attributes:
        tare: The tare that force readings pass.
        in_newtons: Forces are in newtons, and not in the unit of a pad without calibration.
        image_in_newtons: Likewise the image.
    """

    def __init__(self, name: str, config: FingerConfig, levels: Levels) -> None:
        main = config.wrench or config.pad
        if main is None:
            raise ValueError(f"finger {name} has no stream")
        self.name = name
        self.config = config
        self._freshness = Freshness(stale_after_ns(main))
        self._oldest_ns = _oldest_ns(main)
        self._oldest_image_ns = _oldest_ns(config.pad or main)
        self.image: ImageChannel | None = image_channel(config)
        self.force = ForceChannel(config.wrench, stale_after_ns(config.wrench)) if config.wrench is not None else None
        self.tare: Tare = self._part(None).tare
        self.image_in_newtons = config.pad is not None and in_newtons(config.pad)
        self.in_newtons = config.wrench is not None or self.image_in_newtons
        self._newest: FingerState | VerdictBatch = FingerState(0, STREAM_STALE)
        self._estimator = ContactEstimator(config, levels)
        self._agreement = _agreement(config)
        self._disagreement: tuple[str, ...] = ()
        self._compared_ns = 0
        self._low_n, self._high_n = math.inf, -math.inf
        self._past: deque[tuple[int, tuple[float, ...]]] = deque(maxlen=PASTS)
        self._image_freshness = Freshness(stale_after_ns(config.pad or main))
        self._image_dated, self._image_late = True, False
        self._held = HeldReads()
        self._undated_wait = False
        self._free = False
        self._pull = PullDetector(config)
        self._unloaded = False
        self._received_ns = self._acquired_ns = 0
        self._unread_ns: int | None = None

    def channel(self, kind: str) -> ForceChannel | ImageChannel | None:
        """What stands behind the finger's stream "wrench" or "pad"."""
        return self.force if kind == "wrench" else self.image

    def is_pressed(self) -> bool | None:
        """Whether something presses on the pad; None where that is not known.

        A force sensor that was never tared reads its own bias as a contact, so until then only the image counts.
        """
        tared, shown = self._tared(), self._shows_contact()
        if shown or (tared and self._estimator.in_contact):
            return True
        if self.state.contact is None or self.state.verdict is WEIGHT_UNKNOWN:
            return None
        return False if tared else shown

    def contact_force_n(self, t_ns: int) -> float | None:
        """Normal force of a contact, N; None if there is none, or if the force is not trusted.

        An image alone does not count: it may hum or drift.
        """
        contact = self.state.contact
        if contact is None or not (self._tared() and self._estimator.in_contact and self.is_trusted_at_rest(t_ns)):
            return None
        return contact.normal_n

    def force_shows_contact(self) -> bool | None:
        """Whether the force sensor measures a contact; None if that is not known.

        This is the witness while the pad beside it is tared, whose own image has no zero yet.
        """
        if self.force is None or self.state.contact is None or self.state.verdict is WEIGHT_UNKNOWN:
            return None
        return self._estimator.in_contact if self.tare.current.id > 0 else None

    def is_pressed_without(self, streams: Collection[str]) -> bool | None:
        """Whether something presses, judged without the streams that are about to be tared; None: not known.

        Args:
            streams: "wrench", "pad", or both.
        """
        if self.force is None or "pad" not in streams:
            return self.is_pressed()
        felt = self.force_shows_contact()
        if "wrench" not in streams:
            return felt
        shown = self._shows_contact() if self.image is not None and self.image.zero_known else None
        if felt or shown:
            return True
        return None if felt is None and shown is None else False

    def is_fresh(self, stream: str, t_ns: int) -> bool:
        """Whether its stream "wrench" or "pad" has sent readings lately."""
        if stream == "wrench" or self.force is None:
            return self.state.verdict is not STREAM_STALE
        return self._has_image(t_ns, None)

    @property
    def state(self) -> FingerState:
        """What is known after the newest force reading."""
        newest = self._newest
        return newest if isinstance(newest, FingerState) else newest[-1]

    @property
    def friction(self) -> Friction:
        """Coefficients of friction in use, and who set them."""
        return self._estimator.friction

    def set_friction(self, mu_s: float, mu_d: float | None, by: str = "", t_ns: int | None = None) -> None:
        """Use the coefficients of friction that client ``by`` states at ``t_ns``; see `Friction.set`."""
        self._estimator.set_friction(mu_s, mu_d, by, t_ns)

    @property
    def is_trusted(self) -> bool:
        """The newest reading is fresh, and nothing speaks against its sensor."""
        return DOUBTS.isdisjoint(self.state.verdict.reasons)

    @property
    def main_stream(self) -> str:
        """The stream that measures the force: "wrench" or "pad"."""
        return "pad" if self.force is None else "wrench"

    @property
    def is_pulled(self) -> bool:
        """The normal force is clearly negative; the counts of a pad that was never tared say nothing of that."""
        return self.state.verdict is PAD_PULLED and (self.force is not None or self._tared())

    def is_trusted_for_raise(self, t_ns: int) -> bool:
        """Return whether a grip may be raised at ``t_ns``: readings and images are fresh, usable and beyond doubt.

        A late daemon is no excuse: what it has not read yet, or reads late, may be another situation. Nor is a sensor
        that may rest: one that hangs looks the same.
        """
        return self._is_trusted(t_ns, at_rest=False)

    def is_trusted_at_rest(self, t_ns: int) -> bool:
        """Return whether `is_trusted_for_raise`, or only a repeated reading that the config allows stands against it.

        This is enough to open the gripper, for otherwise nothing opens at rest.
        """
        return self._is_trusted(t_ns, at_rest=True)

    def _is_trusted(self, t_ns: int, *, at_rest: bool) -> bool:
        image, force = self.image, self.force
        if image is not None and not image.is_reliable(at_rest=at_rest):
            return False
        if image is not None and t_ns - (image.t_ns or 0) > self._oldest_image_ns:
            return False
        if force is not None and force.suspect and not (at_rest and force.rests):
            return False
        if self._freshness.is_stale(t_ns) or self._received_ns - self._acquired_ns > self._freshness.stale_ns:
            return False
        return self.is_trusted and t_ns - self._acquired_ns <= self._oldest_ns

    def age_s(self, t_ns: int) -> float | None:
        """Age of the newest force reading, s; None before the first."""
        return None if self._freshness.came_ns is None else (t_ns - self._acquired_ns) * 1e-9

    def conditions(self, kind: str, t_ns: int) -> list[tuple[Health, str]]:
        """What people should know of the readings of the stream "wrench" or "pad"."""
        side = self.channel(kind)
        found = [] if side is None else side.conditions(t_ns)
        if self.state.verdict is PAD_PULLED and side is (self.force or self.image):
            normal_n = math.nan if self.state.wrench is None else -self.state.wrench[2]
            advice = self._pull.advice(normal_n, tared=self._tared(), pressed=self._shows_contact())
            found.append((Health.ERROR, advice))
        return found

    def begin_tare(
        self, t_ns: int, seconds: float, by: str, stream: str | None = None, *, unloaded: bool = False
    ) -> None:
        """Start to average unloaded readings.

        Args:
            t_ns: Now.
            seconds: For how long, s.
            by: Who asks for it.
            stream: "wrench" or "pad"; None: what measures the force.
            unloaded: Somebody knows that nothing touches the finger, whatever normal force it reads below zero.
        """
        self._unloaded = unloaded
        self._part(stream).begin_tare(t_ns, seconds, by)

    def undo_tare(self, stream: str | None = None) -> bool:
        """Restore the offset before the last tare of a stream; False if there is none."""
        return self._part(stream).undo_tare()

    def _part(self, stream: str | None) -> ForceChannel | ImageChannel:
        return cast("ForceChannel | ImageChannel", self.force or self.image if stream is None else self.channel(stream))

    def decide(
        self, samples: Sequence[WrenchSample], times_ns: Sequence[int], arrival: Arrival = PROMPT
    ) -> Iterator[VerdictBatch]:
        """Decides on the readings of one read: on all at once, but for a tare, which a contact ends at once.

        Readings that waited for the daemon may first wait for the image of their time; see `decide_held`.

        Args:
            samples: The readings, received together.
            times_ns: When each was acquired, CLOCK_MONOTONIC.
            arrival: How they reached the daemon.
        """
        if self.force is None:
            raise ValueError(f"finger {self.name} has no force sensor")
        if arrival.waited_ns or self._held:
            self._held.hold(HeldRead(samples, times_ns, arrival))
            return self.decide_held(samples[-1].t_ns, arrival.unread_ns)
        return self._take_read(self.force, samples, times_ns, arrival)

    def decide_held(self, t_ns: int, unread_ns: int | None = None) -> Iterator[VerdictBatch]:
        """Decide on the force readings that need not wait for an image any more.

        Args:
            t_ns: Now.
            unread_ns: For how long the image's line counts as unread; None: it is empty.
        """
        if self.force is not None and self._held:
            until_ns = None
            if unread_ns and self._has_image(t_ns, unread_ns):
                until_ns = self._image_serves_until(t_ns - unread_ns)
            for samples, times_ns, arrival in self._held.release(until_ns):
                waited_ns = arrival.waited_ns + t_ns - samples[-1].t_ns
                yield from self._take_read(
                    self.force, samples, times_ns, Arrival(waited_ns, unread_ns, arrival.dated), t_ns
                )

    def _take_read(
        self,
        force: ForceChannel,
        samples: Sequence[WrenchSample],
        times_ns: Sequence[int],
        arrival: Arrival,
        t_ns: int | None = None,
    ) -> Iterator[VerdictBatch]:
        """Decide on a read; at ``t_ns`` where it was held."""
        if self._undated_wait:  # without a clock, time seems to stand still for what waited, and then to jump
            force.excuse(times_ns[0])
        self._undated_wait = arrival.waited_ns > 0 and not arrival.dated
        step = 1 if self.tare.busy else len(samples)
        for at in range(0, len(samples), step):
            read = force.take(samples[at : at + step], times_ns[at : at + step], self._untouched)
            yield self._decide(read if t_ns is None else read._replace(received_ns=t_ns), arrival)

    def update_image(
        self, sample: TactileSample, acquired_ns: int | None = None, arrival: Arrival = PROMPT
    ) -> VerdictBatch | None:
        """Takes an image; decides on it where its taxels are what measures the force."""
        if self.image is None:
            return None
        t_ns = sample.t_ns if acquired_ns is None else acquired_ns
        self.image.take(sample, t_ns, self._felt())
        excused_ns = 0 if self._image_late and arrival.dated else arrival.waited_ns
        self._image_late = sample.t_ns - t_ns - excused_ns > self._image_freshness.stale_ns
        self._image_freshness.update(sample.t_ns, t_ns, arrival)
        self._image_dated = arrival.dated
        self._compare(t_ns)
        if self.force is not None or not self.image.three_axis:
            return None
        words = tuple(sorted(UNTRUSTED_WORDS.intersection(sample.status)))
        if self.image.untared:
            words = ("not_tared", *words)
        wrench = self.image.wrench()
        if wrench is None:
            words = words or ("not_finite",)
        elif self.image.is_stuck(wrench, t_ns):
            words = ("stuck", *words)
        use = UNTRUSTED if words else USABLE
        rows = np.array([(*((math.nan,) * 6 if wrench is None else wrench), t_ns * 1e-9, use)])
        read = WrenchBatch((t_ns,), sample.t_ns, rows, AS_IS, {0: words} if words else {}, (sample.status,))
        return self._decide(read, arrival)

    def check_silence(self, t_ns: int, unread_ns: int | None = None) -> FingerState | None:
        """Notice that a stream which the verdict rests on fell silent; None where nothing changed.

        Args:
            t_ns: Now.
            unread_ns: For how long lines count as unread: no silence of a stream; None: they are empty.
        """
        if self.tare.busy and self._freshness.silent_ns(t_ns, unread_ns) > LONGEST_TARE_GAP_NS:
            self.tare.abort("the stream fell silent")
        image = self.image
        if (
            image is not None
            and image.tare.busy
            and self._image_freshness.silent_ns(t_ns, unread_ns) > LONGEST_TARE_GAP_NS
        ):
            image.tare.abort("the stream fell silent")
        if self.state.verdict is STREAM_STALE:
            return None
        if self._freshness.is_stale(t_ns, unread_ns):
            return self.lose(t_ns)
        verdict = self.state.verdict
        holds = verdict.level in RESTS_ON_IMAGE and DOUBTS.isdisjoint(verdict.reasons)
        if holds and self.state.load_distribution is not None and not self._has_image(t_ns, unread_ns):
            self._newest = replace(
                self.state,
                verdict=ROTATION_UNOBSERVED,
                load_distribution=None,
                utilisation=None,
                tipping_margin_m=math.nan,
                model="none",
            )
            return self._newest
        return None

    def expire_image(self, t_ns: int, unread_ns: int | None = None) -> bool:
        """Return whether the newest image just became too old; True once per image (see `check_silence`)."""
        image = self.image
        return image is not None and image.t_ns is not None and not self._has_image(t_ns, unread_ns) and image.expire()

    def disconnect(self, t_ns: int) -> FingerState:
        """The force stream ended: a tare that is being measured would average what lies before and behind."""
        self.tare.abort("the stream ended")
        self._held.clear()
        return self.lose(t_ns)

    def disconnect_image(self) -> None:
        """The image stream ended."""
        self._forget_comparison()
        if self.image is not None:
            self.image.tare.abort("the stream ended")
            self.image.forget()

    def lose(self, t_ns: int) -> FingerState:
        """Forgets what the force stream told: from now on the verdict is unknown."""
        self._end_contact()
        self._free = False
        self._newest = FingerState(t_ns, STREAM_STALE, age_s=self.age_s(t_ns))
        return self._newest

    def _decide(self, read: WrenchBatch, arrival: Arrival) -> VerdictBatch:
        """Decides on the readings of one read."""
        times_ns, received_ns, waited_ns = read.times_ns, read.received_ns, arrival.waited_ns
        usable_ns = self._freshness.stale_ns
        if waited_ns and not (
            arrival.dated and self.state.verdict is STREAM_STALE
        ):  # one that was late already is late itself
            usable_ns += waited_ns
        self._received_ns, self._acquired_ns, self._unread_ns = received_ns, times_ns[-1], arrival.unread_ns
        self._freshness.update(received_ns, times_ns[-1], arrival)
        if received_ns - min(times_ns) > usable_ns:
            read.rows[received_ns - np.array(times_ns) > usable_ns, USE] = LATE
        image = self.image
        shares_of = (
            image.load_distribution if image is not None and self._has_image(received_ns, arrival.unread_ns) else None
        )
        if waited_ns and shares_of is not None:
            until_ns = self._image_serves_until(received_ns - waited_ns)
            if until_ns is not None and times_ns[-1] > until_ns:
                shares_of = None
        doubt, fault = self._doubt(times_ns[-1]), "" if image is None else image.fault
        pulled_n = self._pull.least_n(doubt, tared=self.tare.current.id > 0)
        judged = self._estimator.estimate(read, doubt, shares_of, self._disagreement, fault, pulled_n)
        if judged.ends_at < len(judged):
            self._forget_comparison()
        self._newest = judged
        self._free = judged.levels[-1] == NO_CONTACT
        self._note(judged)
        if self.tare.busy:
            self._guard_tare()
        if image is not None and image.tare.busy and self.force_shows_contact():
            image.tare.abort("a contact began")
        return judged

    def _guard_tare(self) -> None:
        """Give up a tare that would take a load for zero."""
        if self.is_pressed():
            self.tare.abort("a contact began")
        elif self.is_pulled and not self._unloaded:
            self.tare.abort("the normal force became negative, as if the pad were pulled")

    def _tared(self) -> bool:
        """Readings have a known zero: by a tare, or of a pad by the config."""
        pad = self.config.pad
        return self.tare.current.id > 0 or (self.force is None and pad is not None and bool(pad.tare))

    def _felt(self) -> Felt:
        """What the force sensor felt since the image before."""
        contact = self.state.contact
        if self.force is None or contact is None or self.state.verdict is STREAM_STALE:
            return UNFELT
        moving = self._high_n - self._low_n > MOVING_STDS * self.force.noise_n
        self._low_n, self._high_n = contact.normal_n, contact.normal_n
        return Felt(self._free, contact.normal_n, moving, not self._disagreement)

    def _compare(self, t_ns: int) -> None:
        """Compares a new image with what the force sensor told of the contact at its time."""
        image, agreement = self.image, self._agreement
        if image is None or agreement is None or self.state.contact is None or not image.known:
            self._forget_comparison()
            return
        if t_ns - self._compared_ns < COMPARE_NS:
            return
        self._compared_ns = t_ns
        doubt = self._doubt(t_ns)
        wrench = self._felt_at(t_ns)
        shift = doubt._replace(force_n=doubt.force_n / STDS, torque_nm=doubt.torque_nm / STDS)
        contact = self._contact(wrench, shift)
        told = agreement.update(t_ns, contact, doubt.force_std_n + doubt.force_n, image.x, image.y, image.pressure)
        self._disagreement = tuple(f"disagreement_{what}" for what in told)

    def _felt_at(self, t_ns: int) -> tuple[float, ...]:
        """The reading of the force sensor that was nearest in time."""
        nearest = self._past[-1]
        for past in reversed(self._past):
            if abs(past[0] - t_ns) > abs(nearest[0] - t_ns):
                break
            nearest = past
        return nearest[1]

    def _contact(self, wrench: tuple[float, ...], doubt: Doubt) -> Contact:
        """The contact as the force sensor sees it; without torque, its centroid and spin are unknown."""
        least_n = self._estimator.least_normal_n
        force_std_n, torque_std_nm = doubt.force_std_n + doubt.force_n, doubt.torque_std_nm + doubt.torque_nm
        fx, fy, fz, *torque = wrench
        if math.isnan(torque[0]):
            found = contact_of((fx, fy, fz, 0.0, 0.0, 0.0), least_n, force_std_n, torque_std_nm)
            nan = math.nan
            return found._replace(cx_m=nan, cy_m=nan, cx_std_m=nan, cy_std_m=nan, spin_nm=nan)
        return contact_of((fx, fy, fz, *torque), least_n, force_std_n, torque_std_nm)

    def _doubt(self, t_ns: int) -> Doubt:
        """How far a reading at ``t_ns`` may be off."""
        return NO_DOUBT if self.force is None else self.force.doubt(t_ns)

    def _untouched(self) -> bool | None:
        """Whether nothing touches the finger; None where that is in doubt.

        The image is a witness of its own where it has something to say; it must not speak for a force it does not show.
        """
        contact = self.state.contact
        if self._disagreement or contact is None:
            return None
        shown = self._shows_contact()
        if shown is None:
            return True if self._free else None
        return not shown and contact.normal_n < CLEAR * self.config.min_normal_n

    def _shows_contact(self) -> bool | None:
        """What a fresh image says beside the force sensor; taxels that are the force sensor say nothing beside it."""
        image = self.image
        if image is None or self.force is None or image.tare.busy:
            return None
        if not self._has_image(self._received_ns, self._unread_ns):
            return None
        return image.shows_contact()

    def _has_image(self, t_ns: int, unread_ns: int | None) -> bool:
        """Whether the newest image is fresh; one that was old when it came is not."""
        known = self.image is not None and self.image.t_ns is not None
        return known and not self._image_late and not self._image_freshness.is_stale(t_ns, unread_ns)

    def _image_serves_until(self, since_ns: int) -> int | None:
        """Latest time of a force reading that waited since ``since_ns`` and is judged on the newest image; None: any.

        Of an image that has no time of its own, and was read after a stall, nobody knows better when it was acquired.
        """
        image, came_ns = self.image, self._image_freshness.came_ns
        if image is None or image.t_ns is None or came_ns is None or not (self._image_dated or came_ns <= since_ns):
            return None
        return image.t_ns + self._image_freshness.stale_ns

    def _note(self, judged: VerdictBatch) -> None:
        """Keeps what an image will be compared with."""
        if self.image is None:
            return
        last_ns = self._past[-1][0] if self._past else -PAST_NS
        for at, normal_n in enumerate(judged.contacts[:, 4].tolist()):
            if judged.phases[at] <= UNTRUSTED:
                continue
            t_ns = judged.readings.times_ns[at]
            if t_ns - last_ns >= PAST_NS:
                self._past.append((t_ns, wrench_told(judged.contacts[at].tolist())))
                last_ns = t_ns
            if normal_n < self._low_n:
                self._low_n = normal_n
            if normal_n > self._high_n:
                self._high_n = normal_n

    def _end_contact(self) -> None:
        if self._estimator.in_contact:
            self._forget_comparison()
        self._estimator.end_contact()

    def _forget_comparison(self) -> None:
        self._disagreement = ()
        if self._agreement is not None:
            self._agreement.reset()


def _oldest_ns(stream: Stream) -> int:
    """How old a reading may be to raise a grip on it."""
    return round(1e9 * (max(OLDEST_S, OLDEST_PERIODS / stream.rate_hz) + stream.delay_s))


def _agreement(config: FingerConfig) -> Agreement | None:
    """The cross-check of a finger that has both a force sensor and a pad beside it."""
    pad = config.pad
    if config.wrench is None or pad is None:
        return None
    return Agreement(pad.rows, pad.cols, pad.pitch_m, config.min_normal_n, pad.gain_error)
