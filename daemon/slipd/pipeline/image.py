"""The tactile side of one finger: from taxel readings to the share of the normal force on each taxel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from slipd.config import Finger, Pad, axes_of
from slipd.fusion import Contact, ContactShape, Loads, Outline, active_loads, contact_shape, grey_loads
from slipd.samples import Array, TactileSample
from slipd.signals.charge import ChargeReconstruction
from slipd.signals.pad import PadGeometry, taxel_wrench
from slipd.signals.tare import Tare
from slipd_client.messages import Health


@dataclass(slots=True, frozen=True, eq=False)
class Shares:
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
        axes = axes_of(pad)
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
        self._shares: Shares | None = None
        self._shared = False

    def take(self, sample: TactileSample, acquired_ns: int | None = None, *, known_free: bool) -> None:
        """Takes an image.

        Args:
            sample: The image, of as many taxels as the pad has.
            acquired_ns: When it was acquired, CLOCK_MONOTONIC; None: when it was received.
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
        self.t_ns = sample.t_ns if acquired_ns is None else acquired_ns
        self.status = sample.status
        self._shared = False
        self._assumed_free = self._charge is not None and known_free

    def forget(self) -> None:
        """Gives up the newest image: time passed, or the pad was away, and nobody saw what happened."""
        self._known, self.t_ns, self._shared = False, None, False
        if self._charge is not None:
            self._charge.forget()

    def conditions(self, t_ns: int) -> list[tuple[Health, str]]:
        """What people should know of the pad's readings."""
        del t_ns
        found = []
        if self.tare.aborted_reason:
            found.append((Health.OK, f"the last tare was given up: {self.tare.aborted_reason}"))
        return found

    def told(self, t_ns: int) -> dict[str, Any]:
        """What ``status.streams.<name>`` says of the conditioning."""
        return {}

    def wrench(self) -> tuple[float, ...] | None:
        """Force and torque about the pad's origin of three-axis taxels, N and N·m: six numbers; None where unknown."""
        if self._forces is None or not self._known:
            return None
        force, torque = taxel_wrench(self.x, self.y, self._forces)
        return (*force.tolist(), *torque.tolist())

    def shows_contact(self) -> bool | None:
        """Whether a taxel is active; None where the image does not say.

        A charge that is zero because the force sensor reads no contact says nothing of its own.
        """
        return bool(self.pressure.any()) if self._known and not self._assumed_free else None

    def shares(self, contact: Contact) -> Shares | None:
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

    def _share(self, contact: Contact) -> Shares | None:
        active = np.flatnonzero(self.pressure)
        if active.size == 0:
            return None
        x, y, p = self.x[active], self.y[active], self.pressure[active]
        outline = Outline(x, y)
        if self._rule == "grey" or math.isnan(contact.cx_m):
            loads = grey_loads(p, 1.0)
        else:
            loads = active_loads(x, y, None if self._rule == "binary" else p, (contact.cx_m, contact.cy_m), outline)
        return Shares(x, y, loads, outline)


def pad_image(finger: Finger) -> PadImage | None:
    """The image side of a finger, where it has a pad."""
    return None if finger.pad is None else PadImage(finger.pad, finger.load_rule)
