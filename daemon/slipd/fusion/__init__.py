"""The contact mechanics and the slip decision of one contact, and the grasp that two of them make; pure.

Lengths in m, forces in N, torques in N·m; arrays float64 with shape (n,) for taxels; all in the pad frame (origin at
the pad's centre, Z out of the pad towards the object, X along its longer side); forces are those on the finger.
"""

from slipd.fusion.contact import (
    AS_IS,
    FREE,
    LATE,
    PULLED,
    TOUCH,
    TOUCHING,
    UNTRUSTED,
    USABLE,
    USE,
    Carrier,
    Contact,
    carry,
    contact_from_wrench,
    contact_of,
    contact_told,
    find_contacts,
    wrench_told,
)
from slipd.fusion.grasp import (
    ExternalWrench,
    PadPose,
    asymmetry,
    external_wrench,
    grasp_needed_n,
    grasp_utilisation,
    internal_force,
    load_share,
)
from slipd.fusion.grip_force import grip_needed_n
from slipd.fusion.hull import Outline, tipping_margin
from slipd.fusion.limit_batch import TorqueLimits, Utilisations, torque_limits, utilisations
from slipd.fusion.limit_surface import (
    TorqueLimit,
    Utilisation,
    follow_readings,
    torque_limit,
    utilisation,
    utilisation_of,
    utilisation_told,
)
from slipd.fusion.loads import Loads, active_loads, binary_loads, grey_loads, matched_loads
from slipd.fusion.shape import ContactShape, contact_shape
from slipd.fusion.slip import ContactWatch, Doubt, Found, SlipSettings, Thresholds

__all__ = [
    "AS_IS",
    "FREE",
    "LATE",
    "PULLED",
    "TOUCH",
    "TOUCHING",
    "UNTRUSTED",
    "USABLE",
    "USE",
    "Carrier",
    "Contact",
    "ContactShape",
    "ContactWatch",
    "Doubt",
    "ExternalWrench",
    "Found",
    "Loads",
    "Outline",
    "PadPose",
    "SlipSettings",
    "Thresholds",
    "TorqueLimit",
    "TorqueLimits",
    "Utilisation",
    "Utilisations",
    "active_loads",
    "asymmetry",
    "binary_loads",
    "carry",
    "contact_from_wrench",
    "contact_of",
    "contact_shape",
    "contact_told",
    "external_wrench",
    "find_contacts",
    "follow_readings",
    "grasp_needed_n",
    "grasp_utilisation",
    "grey_loads",
    "grip_needed_n",
    "internal_force",
    "load_share",
    "matched_loads",
    "tipping_margin",
    "torque_limit",
    "torque_limits",
    "utilisation",
    "utilisation_of",
    "utilisation_told",
    "utilisations",
    "wrench_told",
]
