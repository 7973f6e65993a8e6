"""A rigid object held by two compliant pads: distributed stick and slip, computed from mechanics alone.

Each loaded cell of the contact has a tangential spring and damper (a bristle) in series with a Coulomb slider. The
object moves in the plane of the pads: x, y and the angle about their normal. Nothing here uses `slipd.fusion` for the
dynamics, so the truth does not depend on the code that is tested with it; only `GraspTrace.utilisation`, solved
afterwards, does. Pure and without seed: the same scene gives the same trace.

All coordinates are in the frame of the left pad. The right pad is the same hardware turned by half a turn about x, so
it sees the mirror image: y, the spin and the moment about y change sign, x does not.
"""

from slipd.tools.sim.stickslip.contact_patch import ContactPatch
from slipd.tools.sim.stickslip.grasp_parts import FrictionLaw, FrictionMap, GraspedObject, LoadHistory, PadCompliance
from slipd.tools.sim.stickslip.grasp_trace import GraspTrace, simulate
from slipd.tools.sim.stickslip.stepped_grasp import SteppedGrasp

__all__ = [
    "ContactPatch",
    "FrictionLaw",
    "FrictionMap",
    "GraspTrace",
    "GraspedObject",
    "LoadHistory",
    "PadCompliance",
    "SteppedGrasp",
    "simulate",
]
