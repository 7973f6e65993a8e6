"""The tactile side of one finger: from taxel readings to the share of the normal force on each taxel."""

from __future__ import annotations

import numpy as np

from slipd.config import Finger, Pad
from slipd.devices import DEVICES
from slipd.fusion import Contact, ContactShape, Loads, binary_loads, contact_shape, grey_loads, matched_loads
from slipd.samples import Array, TactileSample
from slipd.signals.charge import ChargeReconstruction
from slipd.signals.pad import PadGeometry, taxel_wrench
from slipd.signals.tare import Tare


class PadImage:
    """The newest image of one pad, in the pad frame.

    Attributes:
        three_axis: The taxels measure shear too, so that the pad gives a wrench by itself.
        tare: Offset of the readings, in counts.
        pressure: Normal force on each taxel above the threshold, shape (n,), else 0; in the unit of ``axis_scale``.
        t_ns: When the image was received; None before the first.
        status: Conditions the device reported with it.
    """

    def __init__(self, pad: Pad, rule: str) -> None:
        self.geometry = PadGeometry(
            pad.rows, pad.cols, pad.pitch_m, pad.electrode_m, pad.swap_xy, pad.flip_x, pad.flip_y
        )
        self.x, self.y = self.geometry.positions()
        axes = DEVICES[pad.device].axes
        self.three_axis = axes == 3
        shape = (self.geometry.taxels, 3) if self.three_axis else (self.geometry.taxels,)
        self.tare = Tare(np.reshape(pad.tare, shape) if pad.tare else np.zeros(shape))
        self._scale = np.array(pad.axis_scale if self.three_axis else pad.axis_scale[0])
        self._threshold = pad.threshold
        self._rule = rule
        self._charge = ChargeReconstruction(self.geometry.taxels, pad.charge_tau_s) if pad.charge_tau_s else None
        self.pressure = np.zeros(self.geometry.taxels)
        self.t_ns: int | None = None
        self.status: tuple[str, ...] = ()
        self._forces: Array | None = None
        self._known = False
        self._assumed_free = False
        self._loads: Loads | None = None
        self._active = np.empty(0, dtype=np.int64)

    def take(self, sample: TactileSample, *, known_free: bool) -> None:
        """Takes an image.

        Args:
            sample: The image, of as many taxels as the pad has.
            known_free: The force sensor reads no contact. Where it reads nothing, that is not known, and a held load
                must not be taken for an offset.
        """
        values = self.tare.apply(sample.values, sample.t_ns)
        if self.three_axis and self.geometry.swap_xy:
            values = values[:, (1, 0, 2)]  # the pad is turned as a whole: its shear axes with its rows
        values = self._scale * values
        if self._charge is not None:
            values = self._charge.update(values, sample.t_ns * 1e-9, known_free)
        normal = -values[:, 2] if self.three_axis else values
        self._known = bool(np.isfinite(normal).all())
        self._forces = values if self.three_axis else None
        self.pressure = np.where(normal > self._threshold, normal, 0.0) if self._known else np.zeros_like(normal)
        self.t_ns, self.status = sample.t_ns, sample.status
        self._loads = None
        self._assumed_free = self._charge is not None and known_free

    def forget(self) -> None:
        """Gives up the newest image: time passed, or the pad was away, and nobody saw what happened."""
        self._known, self.t_ns, self._loads = False, None, None
        if self._charge is not None:
            self._charge.forget()

    def wrench(self) -> tuple[Array, Array] | None:
        """Force (3,) and torque about the pad's origin (3,) of three-axis taxels; None where there are none."""
        if self._forces is None:
            return None
        return taxel_wrench(self.x, self.y, self._forces)

    def shows_contact(self) -> bool | None:
        """Whether a taxel is active; None where the image does not say.

        A charge that is zero because the force sensor reads no contact says nothing of its own.
        """
        return bool(self.pressure.any()) if self._known and not self._assumed_free else None

    def loads(self, contact: Contact) -> tuple[Array, Array, Loads] | None:
        """Positions (k,), (k,) and loads of the active taxels, for a valid contact; None without a usable image.

        The shares are found once an image; between two images they scale with the normal force.
        """
        if not self._known or self.t_ns is None:
            return None
        if self._loads is None:
            self._active = np.flatnonzero(self.pressure)
            self._loads = self._share(contact)
        if self._loads.status == "no_image":
            return None
        shares = self._loads
        scaled = Loads(shares.loads * contact.normal_n, shares.centroid_residual_m, shares.status)
        return self.x[self._active], self.y[self._active], scaled

    def shape(self) -> ContactShape | None:
        """Features of the image; None where it is not known."""
        if not self._known:
            return None
        grid = (self.geometry.rows, self.geometry.cols)
        x, y, p = self.x.reshape(grid), self.y.reshape(grid), self.pressure.reshape(grid)
        return contact_shape(x, y, p, self.geometry.pitch_m)

    def _share(self, contact: Contact) -> Loads:
        x, y, p = self.x[self._active], self.y[self._active], self.pressure[self._active]
        if self._rule == "grey":
            return grey_loads(p, 1.0)
        if self._rule == "binary":
            return binary_loads(x, y, 1.0, contact.centroid_m)
        return matched_loads(x, y, p, 1.0, contact.centroid_m)


def pad_image(finger: Finger) -> PadImage | None:
    """The image side of a finger, where it has a pad."""
    return None if finger.pad is None else PadImage(finger.pad, finger.load_rule)
