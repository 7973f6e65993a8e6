"""The tactile side of one finger: from taxel readings to the share of the normal force on each taxel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.config import Finger, Pad, axes_of, stale_after_ns
from slipd.fusion import Contact, ContactShape, Loads, Outline, active_loads, contact_shape, grey_loads
from slipd.samples import UNTRUSTED, Array, TactileSample
from slipd.signals.averaging import LARGEST_READING
from slipd.signals.charge import ChargeReconstruction
from slipd.signals.frozen import MOST, WrenchWatch
from slipd.signals.frozen_image import FrozenImage
from slipd.signals.pad import PadGeometry, taxel_wrench
from slipd.signals.tare import Offset, Tare
from slipd.signals.taxel_health import TaxelHealth
from slipd.signals.untared import UntaredWatch
from slipd_client.messages import Health

#: Reason for an image that is too old, or missing.
STALE: tuple[str, ...] = ("stale",)
_UNUSABLE = {
    "not_finite": "its images hold readings that are not finite numbers",
    "garbage": "its readings are larger than those of any pad: check axis_scale and the configuration of the pad",
}
_NO_ROWS: Array = np.empty((0, 6))
#: Movement of the force that an image must show, over the force sensor's noise.
FROZEN_STDS = 6.0
#: Advice for a pad that was never tared.
UNTARED = (
    "it was never tared and reads a load that may not exist: with nothing touching it, run `slipctl tare take FINGER "
    "--stream pad`, or set tare in the config to its unloaded counts"
)


@dataclass(slots=True, frozen=True, eq=False)
class LoadDistribution:
    """How an image shares a normal force of 1 among its active taxels.

    Attributes:
        x: Centres of the active taxels, shape (k,), k ≥ 1, m.
        y: Likewise, shape (k,), m.
        loads: The share of each; between two images they scale with the normal force.
        outline: The convex outline of the active taxels.
    """

    x: Array
    y: Array
    loads: Loads
    outline: Outline


@dataclass(slots=True, frozen=True)
class Felt:
    """What the finger's force sensor felt since the image before; nothing is known where there is none.

    Attributes:
        free: It reads no contact. Where it reads nothing, that is not known, and a held load must not be taken for an
            offset.
        normal_n: Normal force now, N; None: not known.
        moving: The normal force moved beyond its noise; None: not known.
        agrees: It and the images told the same contact until now.
    """

    free: bool = False
    normal_n: float | None = None
    moving: bool | None = None
    agrees: bool = False


UNFELT = Felt()


class ImageChannel:
    """The newest image of one pad, in the pad frame.

    In this order: tare, turn, scale, charge, health of the taxels, threshold.

    Args:
        pad: ``[finger.X.pad]``.
        finger: ``[finger.X]``, for the rule of the loads and the noise of the force sensor beside the pad.

    Attributes:
        three_axis: The taxels measure shear too, so that the pad gives a wrench by itself.
        tare: Offset of the readings, in counts.
        taxel_health: Which taxels are not believed, and why.
        pressure: Normal force on each taxel above the threshold, shape (n,), else 0; in the unit of ``axis_scale``.
        t_ns: When the image was acquired; None before the first.
        status: Conditions the device reported with it.
        hangs: The images repeat while the force moves.
        reasons: Why the newest image cannot be used; empty where it can.
    """

    def __init__(self, pad: Pad, finger: Finger) -> None:
        self.geometry = PadGeometry(
            pad.rows, pad.cols, pad.pitch_m, pad.electrode_m, pad.swap_xy, pad.flip_x, pad.flip_y
        )
        self.x, self.y = self.geometry.positions()
        taxels = self.geometry.taxels
        self.three_axis = axes_of(pad) == 3
        shape = (taxels, 3) if self.three_axis else (taxels,)
        self.tare = Tare(np.reshape(pad.tare, shape) if pad.tare else np.zeros(shape))
        self._scale = np.array(pad.axis_scale if self.three_axis else pad.axis_scale[0])
        self._threshold = pad.threshold
        self._least_n = finger.min_normal_n
        self._most = MOST if pad.gain_error is not None else LARGEST_READING
        self._rule = finger.load_rule
        self._calibrated = pad.gain_error is not None
        self._charge = ChargeReconstruction(taxels, pad.charge_tau_s) if pad.charge_tau_s else None
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
        self.hangs = False
        self._stated = bool(pad.tare)
        self._untared = UntaredWatch(finger.min_normal_n, pad.threshold, calibrated=self._calibrated)
        self._alone = finger.wrench is None
        self.pressure = np.zeros(taxels)
        self.t_ns: int | None = None
        self.status: tuple[str, ...] = ()
        self._forces: Array | None = None
        self.reasons = STALE
        self._known = False
        self._assumed_free = False
        self._shares: LoadDistribution | None = None
        self._shared = False

    def take(self, sample: TactileSample, acquired_ns: int | None = None, felt: Felt = UNFELT) -> None:
        """Takes an image.

        Args:
            sample: The image, of as many taxels as the pad has.
            acquired_ns: When it was acquired, CLOCK_MONOTONIC; None: when it was received.
            felt: What the force sensor felt meanwhile.
        """
        t_ns = sample.t_ns if acquired_ns is None else acquired_ns
        doubtful = not UNTRUSTED.isdisjoint(sample.status)
        self.hangs = self._frozen.update(sample.values, t_ns, felt.normal_n)
        before = self.tare.current
        values = self.tare.apply(sample.values, sample.t_ns, trusted=not doubtful and not self.hangs)
        self._take_offset(before)
        if self.three_axis and self.geometry.swap_xy:
            values = values[:, (1, 0, 2)]  # the pad is turned as a whole: its shear axes with its rows
        values = self._scale * values
        readings = -values[:, 2] if self.three_axis else values
        pressure = None
        if self._charge is not None:
            anchored = felt.agrees and not doubtful and not self.taxel_health.masks
            if self._calibrated and anchored and felt.normal_n is not None:
                self._charge.anchor(felt.normal_n)
            values = pressure = self._charge.update(values, t_ns * 1e-9, felt.free)
        free = felt.normal_n is not None and felt.free and felt.normal_n > -self._least_n
        self.taxel_health.update(readings, t_ns, free, felt.moving, pressure)
        if not doubtful and not self.zero_known:
            self._look(values, readings, t_ns, felt)
        self._believe(values, sample)
        self.t_ns, self.status = t_ns, sample.status
        self._assumed_free = self._charge is not None and felt.free

    def _believe(self, values: Array, sample: TactileSample) -> None:
        """Make pressures of forces, with the masked taxels mended."""
        mend = self.taxel_health.repair if self.taxel_health.masks else None
        if self.three_axis:
            if mend is not None:
                values = np.column_stack([mend(component) for component in values.T])
            self._forces = values
        elif mend is not None:
            values = mend(values)
        self.reasons = self._find_reasons(values.ravel(), sample)
        if self.three_axis:
            values = -values[:, 2]
        self._known = not self.reasons
        self.pressure = np.where(values > self._threshold, values, 0.0) if self._known else np.zeros_like(values)
        self._shared = False

    def begin_tare(self, t_ns: int, seconds: float, by: str) -> None:
        """Start to average images; those that the device marks as invalid stay out."""
        self.tare.begin(t_ns, seconds, by)

    def undo_tare(self) -> bool:
        """Restore the offset before the last tare; False if there is none."""
        before = self.tare.current
        if not self.tare.undo():
            return False
        self._take_offset(before)
        return True

    @property
    def zero_known(self) -> bool:
        """The config states the pad's unloaded counts, or a tare took them; a charge pad learns them by itself."""
        return self._stated or self.tare.current.id > 0 or self._charge is not None

    @property
    def fault(self) -> str:
        """Reason for which no image can be used now: "stuck", "not_tared", or "" where it is none of these."""
        return "stuck" if self.hangs else "not_tared" if self.untared else ""

    @property
    def untared(self) -> bool:
        """Without a tare the pad reads tens of newtons, so that its images say nothing."""
        return self._untared.missing and not self.zero_known

    def _take_offset(self, before: Offset) -> None:
        """What was learned of the readings is moved with their zero, or forgotten, where another is in force."""
        if self.tare.current is before:
            return
        self._untared.forget()
        if self._charge is not None:
            self._charge.shift(self._scale * (self.tare.current.value - before.value))

    def _look(self, values: Array, readings: Array, t_ns: int, felt: Felt) -> None:
        """Check whether the pad reads a load that does not exist."""
        if self._alone and self.three_axis:
            self._untared.look_alone(values)
        else:
            self._untared.look_beside(readings, t_ns, free=felt.free)

    def _find_reasons(self, values: Array, sample: TactileSample) -> tuple[str, ...]:
        """Why an image cannot be used that gives these forces on its taxels, in one row."""
        possible = float(np.dot(values, values)) <= self._most**2  # false for NaN
        if possible and not (sample.status or self.hangs or self.untared or self.taxel_health.masks):
            return ()
        found = sorted(UNTRUSTED.intersection(sample.status))
        if self.hangs:
            found.append("stuck")
        if self.untared:
            found.append("not_tared")
        if not self.taxel_health.usable:
            found.append("masked")
        if not possible:
            unseen = "contact_unseen" if np.isnan(values).any() else "garbage"
            found.append(unseen if np.isfinite(sample.values).all() else "not_finite")
        return tuple(found)

    def expire(self) -> bool:
        """Notice that the newest image is too old; False where that is known."""
        known = self.reasons == STALE
        self.reasons = STALE
        return not known

    def forget(self) -> None:
        """Drop the newest image, because the pad was not seen for some time."""
        self._known, self.t_ns, self._shared = False, None, False
        self.reasons = STALE
        if self._charge is not None:
            self._charge.forget()

    @property
    def known(self) -> bool:
        """The newest image tells the pressures, of its own."""
        return self._known and not self._assumed_free

    def is_reliable(self, *, at_rest: bool = False) -> bool:
        """Return whether the newest image can be used, and is not suspected of repeating the one before.

        Args:
            at_rest: Believe one that repeats where the config says that the pad's images may (``stuck_after`` 0).
        """
        repeats = self._watch.suspect and not (at_rest and self._watch.rests)
        return self._known and not self._frozen.suspect and not repeats

    def conditions(self, t_ns: int) -> list[tuple[Health, str]]:
        """What people should know of the pad's readings."""
        del t_ns
        found = []
        if self.status:
            level = Health.WARN if UNTRUSTED.isdisjoint(self.status) else Health.ERROR
            found.append((level, f"the device reports: {', '.join(self.status)}"))
        if self.untared:
            found.append((Health.ERROR, UNTARED))
        if self.hangs:
            found.append((Health.ERROR, "its images repeat while the force moves: it hangs"))
        if self._watch.fault == "stuck":
            found.append(
                (Health.ERROR, "its images repeat: it hangs, or stuck_after is too small for a pad this still")
            )
        found += [(Health.ERROR, _UNUSABLE[reason]) for reason in self.reasons if reason in _UNUSABLE]
        masked = "; ".join(f"{kind} {', '.join(map(str, at))}" for kind, at in self.taxel_health.report().items() if at)
        if masked and not self.taxel_health.usable:
            found.append((Health.ERROR, f"too many taxels cannot be believed: {masked}"))
        elif masked:
            found.append((Health.WARN, f"taxels that are not believed: {masked}"))
        if self.tare.aborted_reason:
            found.append((Health.OK, f"the last tare was given up: {self.tare.aborted_reason}"))
        return found

    def wrench(self) -> tuple[float, ...] | None:
        """Force and torque about the pad's origin of three-axis taxels, N and N·m: six numbers; None where unknown."""
        if self._forces is None or not self._known:
            return None
        force, torque = taxel_wrench(self.x, self.y, self._forces)
        return (*force.tolist(), *torque.tolist())

    def is_stuck(self, wrench: tuple[float, ...], t_ns: int) -> bool:
        """Return whether the images of taxels that measure the force by themselves repeat (``stuck_after``)."""
        self._watch.update((wrench,), (t_ns,), _NO_ROWS)
        return self._watch.fault == "stuck"

    def shows_contact(self) -> bool | None:
        """Whether a taxel is active; None where the image does not say.

        A charge that is zero because the force sensor reads no contact says nothing of its own.
        """
        return bool(self.pressure.any()) if self.known else None

    def load_distribution(self, contact: Contact) -> LoadDistribution | None:
        """How the image shares the force of a valid contact, found once an image; None without a usable image."""
        if not self._known or self.t_ns is None:
            return None
        if not self._shared:
            self._shares, self._shared = self._share(contact), True
        return self._shares

    def shape(self) -> ContactShape | None:
        """Features of the image; None where it is not known."""
        if not self._known:
            return None
        grid = (self.geometry.rows, self.geometry.cols)
        x, y, p = self.x.reshape(grid), self.y.reshape(grid), self.pressure.reshape(grid)
        return contact_shape(x, y, p, self.geometry.pitch_m)

    def _share(self, contact: Contact) -> LoadDistribution | None:
        active = np.flatnonzero(self.pressure)
        if active.size == 0:
            return None
        x, y, p = self.x[active], self.y[active], self.pressure[active]
        outline = Outline(x, y)
        if self._rule == "grey" or math.isnan(contact.cx_m):
            loads = grey_loads(p, 1.0)
        else:
            loads = active_loads(x, y, None if self._rule == "binary" else p, (contact.cx_m, contact.cy_m), outline)
        return LoadDistribution(x, y, loads, outline)


def image_channel(finger: Finger) -> ImageChannel | None:
    """The image side of a finger, where it has a pad."""
    return None if finger.pad is None else ImageChannel(finger.pad, finger)
