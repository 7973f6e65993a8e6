"""Condition the images of one pad: from taxel readings to the normal force on each taxel, in the pad frame.

A pad whose taxels measure three axes each needs no force sensor behind it: its images are force readings too.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.config import Finger, Pad, axes_of, stale_after_ns
from slipd.finger.finger_state import LoadDistribution, distribute
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.force_image_check import NO_SUMMARY, ForceSummary
from slipd.finger.freshness import PROMPT, Arrival, Freshness
from slipd.finger.pad_zero import PadZero
from slipd.fusion import ContactShape
from slipd.fusion.rows import UNTRUSTED, Rows
from slipd.fusion.shape import shape_of
from slipd.fusion.streaming import first_contact, new_readings
from slipd.signals.charge_reconstruction import ChargeReconstruction
from slipd.signals.frozen import MOST, WrenchWatch
from slipd.signals.pad import PadGeometry, loads_above, taxel_wrench
from slipd.signals.tare import LARGEST_READING
from slipd.signals.taxel_health import FrozenImage, TaxelHealth
from slipd.types.arrays import Array
from slipd.types.samples import UNTRUSTED_WORDS, TactileSample

STALE: tuple[str, ...] = ("stale",)
"""Reason why an image that is too old, or missing, cannot be used."""
FROZEN_STDS = 6.0
"""An image must show a movement of the normal force beyond this many standard deviations of its noise."""
_UNKNOWN = (math.nan,) * 6
_NEVER_NS = -(1 << 62)


class ImageChannel:
    """The newest image of one pad of n taxels.

    Each image passes, in this order: tare, turn, scale, reconstruction of the charge, health of the taxels, threshold.

    Args:
        pad: ``[finger.X.pad]``.
        finger: ``[finger.X]``, for the load rule and the noise of the force sensor beside the pad.

    Attributes:
        geometry: Layout of the taxels.
        x: Centres of the taxels along X of the pad frame, in scan order, shape (n,), m.
        y: Likewise along Y, shape (n,), m.
        three_axis: The taxels measure shear too, so the pad gives a wrench by itself.
        zero: Whether the zero of the readings is known.
        tare: Offset of the readings, in counts.
        taxel_health: Which taxels are masked, and why.
        freshness: Of the images.
        pressure: Normal force on each taxel above the threshold, else 0, shape (n,), in the unit of ``axis_scale``.
        loads: The same without the threshold; NaN where it is not known.
        t_ns: When the newest image was acquired, CLOCK_MONOTONIC; None before the first, and after the stream ended.
        status: Conditions that the device reported with it.
        pressed_ns: When the last image was acquired that did not show a free pad by itself.
        is_frozen: The images repeat while the force moves.
        reasons: Why the newest image cannot be used; empty where it can.
        fresh_until_ns: Until when the newest image is fresh, if its line is read empty; -1 where there is none. See
            `is_fresh`.
        is_independent: The newest image is usable, and not assumed to be free because the force sensor reads no
            contact.
    """

    def __init__(self, pad: Pad, finger: Finger) -> None:
        self.geometry = PadGeometry(
            pad.rows, pad.cols, pad.pitch_m, pad.electrode_m, pad.swap_xy, pad.flip_x, pad.flip_y
        )
        self.x, self.y = self.geometry.positions()
        taxels = self.geometry.taxels
        self.three_axis = axes_of(pad) == 3
        self._scale = np.array(pad.axis_scale if self.three_axis else pad.axis_scale[0])
        self._threshold, self._least_n, self._rule = pad.threshold, finger.min_normal_n, finger.load_rule
        self._calibrated = pad.gain_error is not None
        self._most = MOST if self._calibrated else LARGEST_READING
        self._charge = ChargeReconstruction(taxels, pad.charge_tau_s) if pad.charge_tau_s else None
        self.zero = PadZero(pad, (taxels, 3) if self.three_axis else (taxels,), self._scale, self._charge)
        self.tare = self.zero.tare
        self.taxel_health = TaxelHealth(
            pad.rows,
            pad.cols,
            full_scale=None if pad.full_scale is None else pad.full_scale * abs(pad.axis_scale[-1]),
            threshold=pad.threshold,
            light_touch=finger.min_normal_n if self._calibrated else 0.0,
        )
        noise_n = 0.0 if finger.wrench is None else finger.wrench.force_std_n
        self._frozen = FrozenImage(max(FROZEN_STDS * noise_n, finger.min_normal_n))
        self._watch = WrenchWatch(LARGEST_READING, LARGEST_READING, repeats=pad.stuck_after, gap_ns=stale_after_ns(pad))
        self.freshness = Freshness(stale_after_ns(pad))
        self.pressure = self.loads = np.zeros(taxels)
        self.t_ns: int | None = None
        self.fresh_until_ns, self.pressed_ns = -1, _NEVER_NS
        self.status: tuple[str, ...] = ()
        self._forces: Array | None = None
        self.reasons = STALE
        self.is_frozen = self._usable = self.is_independent = False
        self._distribution: LoadDistribution | None = None
        self._distributed = False

    def update(
        self,
        sample: TactileSample,
        t_ns: int,
        summary: ForceSummary = NO_SUMMARY,
        arrival: Arrival = PROMPT,
    ) -> None:
        """Update with an image.

        Args:
            sample: The image, of as many taxels as the pad has.
            t_ns: When it was acquired, CLOCK_MONOTONIC.
            summary: What the force sensor measured since the image before.
            arrival: How the image reached the daemon.
        """
        values, assumed_free = self._condition(sample, t_ns, summary)
        flat = values.ravel()
        possible = float(flat.dot(flat)) <= self._most**2  # false for NaN
        usable = self.zero.known and possible and not (sample.status or self.is_frozen or self.taxel_health.masks)
        self.reasons = () if usable else self._find_reasons(sample, flat, possible=possible)
        if self.three_axis:
            self._forces, values = values, -values[:, 2]
        self.loads, self._usable, self._distributed = values, not self.reasons, False
        self.is_independent = self._usable and not assumed_free
        self.pressure = loads_above(values, self._threshold) if self._usable else np.zeros_like(values)
        self.t_ns, self.status = t_ns, sample.status
        freshness = self.freshness
        freshness.update(sample.t_ns, t_ns, arrival)
        self.fresh_until_ns = -1 if freshness.late else (freshness.came_ns or 0) + freshness.stale_ns
        if not self.is_independent or np.count_nonzero(self.pressure):
            self.pressed_ns = t_ns

    def _condition(self, sample: TactileSample, t_ns: int, summary: ForceSummary) -> tuple[Array, bool]:
        """Check an image acquired at ``t_ns``, and turn its readings into forces.

        Returns:
            The force on each taxel, shape (n,), or (n, 3) of three-axis taxels; and whether the pad is assumed to be
            free because the force sensor reads no contact.
        """
        doubtful = not UNTRUSTED_WORDS.isdisjoint(sample.status)
        self.is_frozen = self._frozen.update(sample.values, t_ns, summary.normal_n)
        values = self.tare.apply(sample.values, sample.t_ns, trusted=not doubtful and not self.is_frozen)
        if self.three_axis and self.geometry.swap_xy:
            values = values[:, (1, 0, 2)]  # the pad is turned as a whole: its shear axes with its rows
        values = self._scale * values
        readings, shear = (-values[:, 2], values[:, :2]) if self.three_axis else (values, None)
        health, pressure, assumed_free = self.taxel_health, None, False
        if self._charge is not None:
            known = self._calibrated and summary.agrees and not doubtful and not health.masks
            anchor = math.nan if summary.normal_n is None or not known else summary.normal_n
            assumed_free = summary.no_contact
            values = pressure = self._charge.update(values, t_ns * 1e-9, assumed_free, anchor)
        free = summary.normal_n is not None and summary.no_contact and summary.normal_n > -self._least_n
        health.update(readings, t_ns, free and not self.is_frozen, summary.moving, pressure, shear)
        if not doubtful and self._charge is None:
            self.zero.judge(readings, t_ns, free=summary.no_contact)
        return health.repair(values) if health.masks else values, assumed_free

    def _find_reasons(self, sample: TactileSample, values: Array, *, possible: bool) -> tuple[str, ...]:
        """Return why an image with these forces on its taxels, in one row, cannot be used."""
        found = sorted(UNTRUSTED_WORDS.intersection(sample.status))
        if self.is_frozen:
            found.append("stuck")
        if not self.zero.known:
            found.append("not_tared")
        if not self.taxel_health.usable:
            found.append("masked")
        if not possible:
            unseen = "contact_unseen" if np.isnan(values).any() else "garbage"
            found.append(unseen if np.isfinite(sample.values).all() else "not_finite")
        return tuple(found)

    def begin_tare(self, t_ns: int, seconds: float, by: str) -> None:
        """Begin to average images, except those that the device marks as invalid."""
        self.tare.begin(t_ns, seconds, by)

    @property
    def fault(self) -> str:
        """Reason why no image can be used now: "stuck", "not_tared", or "" where it is neither."""
        if self.is_frozen:
            return "stuck"
        return "" if self.zero.known or self.t_ns is None else "not_tared"

    def is_fresh(self, t_ns: int, unread_ns: int | None) -> bool:
        """Return whether there is an image that is not too old, nor was when it came; see `Freshness.is_stale`."""
        if unread_ns is None:
            return t_ns <= self.fresh_until_ns
        return self.t_ns is not None and not self.freshness.late and not self.freshness.is_stale(t_ns, unread_ns)

    def serves(self, acquired_ns: int, received_ns: int, arrival: Arrival) -> bool:
        """Return whether the newest image is fresh, and of the time of force readings where these waited.

        Args:
            acquired_ns: When the newest of them was acquired.
            received_ns: When they were received.
            arrival: How they reached the daemon.
        """
        if not self.is_fresh(received_ns, arrival.unread_ns):
            return False
        waited_ns = arrival.waited_ns
        until_ns = self.freshness.serves_until_ns(received_ns - waited_ns) if waited_ns else None
        return until_ns is None or acquired_ns <= until_ns

    def expire(self, t_ns: int, unread_ns: int | None) -> bool:
        """Mark the newest image as stale where it is too old; return True once for each image."""
        if self.t_ns is None or self.is_fresh(t_ns, unread_ns):
            return False
        expired = self.reasons != STALE
        self.reasons = STALE
        return expired

    def forget(self) -> None:
        """Drop the newest image: the stream ended."""
        self._usable = self.is_independent = self._distributed = False
        self.t_ns, self.fresh_until_ns, self.reasons = None, -1, STALE
        if self._charge is not None:
            self._charge.forget()

    def is_reliable(self, *, at_rest: bool) -> bool:
        """Return whether the newest image is usable, and not suspected of repeating the one before.

        Args:
            at_rest: Accept one that repeats where the config says that the pad's images may rest (``stuck_after`` 0).
        """
        suspect = self._watch.suspect and not (at_rest and self._watch.rests)
        return self._usable and not self._frozen.suspect and not suspect

    def wrench(self) -> tuple[float, ...] | None:
        """Return the wrench by three-axis taxels; None where it is unknown.

        Force on the finger, N, and torque about the pad's origin, N·m, both in the pad frame: six numbers.
        """
        if self._forces is None or not self._usable:
            return None
        force, torque = taxel_wrench(self.x, self.y, self._forces)
        return (*force.tolist(), *torque.tolist())

    def force_reading(self, sample: TactileSample, t_ns: int) -> WrenchBatch:
        """Return the newest image of three-axis taxels as a batch of one force reading; call it once for each image.

        Args:
            sample: The image.
            t_ns: When it was acquired, CLOCK_MONOTONIC.
        """
        reasons = tuple(sorted(UNTRUSTED_WORDS.intersection(sample.status)))
        if not self.zero.known:
            reasons = ("not_tared", *reasons)
        wrench = self.wrench()
        rows = new_readings([_UNKNOWN if wrench is None else wrench], [t_ns])
        if wrench is None:
            reasons = reasons or ("not_finite",)
        else:
            self._watch.update(rows)
            reasons = ("stuck", *reasons) if self.repeats else reasons
        if reasons:
            rows["phase"] = UNTRUSTED
        return WrenchBatch((t_ns,), sample.t_ns, rows, True, {0: reasons} if reasons else {}, (sample.status,))

    @property
    def repeats(self) -> bool:
        """The wrench of three-axis taxels repeats for as long as ``stuck_after`` says."""
        return self._watch.fault == "stuck"

    def shows_contact(self) -> bool | None:
        """Return whether something presses; None where the image does not show that by itself.

        It does not where every active taxel reads no more than its noise: that may be a light touch or none.
        """
        if not self.is_independent:
            return None
        return True if (self.pressure > self.zero.noise).any() else None if self.pressure.any() else False

    def load_distribution(self, readings: Rows) -> LoadDistribution | None:
        """Return the shares of the normal force on the taxels; None without a usable image.

        They are computed once for each image, with the first contact of the readings that touch then.
        """
        if not self._usable:
            return None
        if not self._distributed:
            self._distribution = distribute(self._rule, self.x, self.y, self.pressure, first_contact(readings))
            self._distributed = True
        return self._distribution

    def shape(self) -> ContactShape | None:
        """Return features of the newest image; None where it is not usable."""
        if not self._usable:
            return None
        return shape_of(self.x, self.y, self.pressure, self.geometry.cols, self.geometry.pitch_m)
