"""Contact mechanics and friction limit of one fingertip; pure NumPy, SciPy and Numba.

Lengths in m, forces in N, torques in N·m; arrays float64 with shape (n,) for taxels; all in the pad frame (origin at
the pad's centre, Z out of the pad towards the object, X along its longer side); forces are those on the finger.

This is what a scientist calls. `slipd.fusion.grasp` has the grasp that two fingers make, `slipd.fusion.streaming` and
`slipd.fusion.contact_state` have what follows a sensor reading by reading.
"""

from slipd.fusion.contact import Contact, contact_from_wrench
from slipd.fusion.limit_batch import TorqueLimits, Utilisations, torque_limits, utilisations
from slipd.fusion.limit_surface import (
    TorqueLimit,
    Utilisation,
    grip_needed_n,
    tipping_margin,
    torque_limit,
    utilisation,
)
from slipd.fusion.loads import Loads, binary_loads, grey_loads, matched_loads
from slipd.fusion.shape import ContactShape, contact_shape

__all__ = [
    "Contact",
    "ContactShape",
    "Loads",
    "TorqueLimit",
    "TorqueLimits",
    "Utilisation",
    "Utilisations",
    "binary_loads",
    "contact_from_wrench",
    "contact_shape",
    "grey_loads",
    "grip_needed_n",
    "matched_loads",
    "tipping_margin",
    "torque_limit",
    "torque_limits",
    "utilisation",
    "utilisations",
]
