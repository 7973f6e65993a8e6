"""Shares of a contact's normal force on the taxels, by the image of the pad."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.fusion import Contact, Loads, grey_loads
from slipd.fusion.hull import Outline
from slipd.fusion.loads import active_loads
from slipd.types.arrays import Array


@dataclass(slots=True, frozen=True, eq=False)
class LoadDistribution:
    """How an image distributes a normal force of 1 N over its k ≥ 1 active taxels, in the pad frame.

    Attributes:
        x: Centres of the active taxels along X, shape (k,), m.
        y: Likewise along Y, shape (k,), m.
        loads: Normal force on each at 1 N; between two images it scales with the normal force.
        outline: Convex outline of the active taxels.
    """

    x: Array
    y: Array
    loads: Loads
    outline: Outline

    def spin_required(self, contact: Contact) -> float:
        """Return the coefficient of friction that the spin of a contact alone requires, with the sign of the spin.

        It is m / (f_n × mean distance of the load from the centroid): 0 where the load is at one point, NaN where the
        spin is not known.
        """
        lever_m = float(self.loads.loads @ np.hypot(self.x - contact.cx_m, self.y - contact.cy_m))
        return contact.spin_nm / (contact.normal_n * lever_m) if lever_m > 0.0 else 0.0


def distribute(rule: str, x: Array, y: Array, pressure: Array, contact: Contact) -> LoadDistribution | None:
    """Return the load distribution of an image for a contact; None where no taxel is active.

    Args:
        rule: ``load_rule`` of the config: "grey", "binary" or "matched". A contact without a centroid takes "grey".
        x: Centres of the taxels along X, shape (n,), m.
        y: Likewise along Y, shape (n,), m.
        pressure: Normal force on each taxel, 0 where it is inactive, shape (n,), any unit.
        contact: The contact by the force sensor.
    """
    active = np.flatnonzero(pressure)
    if active.size == 0:
        return None
    x, y, pressure = x[active], y[active], pressure[active]
    outline = Outline(x, y)
    if rule == "grey" or math.isnan(contact.cx_m):
        loads = grey_loads(pressure, 1.0)
    else:
        loads = active_loads(x, y, None if rule == "binary" else pressure, (contact.cx_m, contact.cy_m), outline)
    return LoadDistribution(x, y, loads, outline)
