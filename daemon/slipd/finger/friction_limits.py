"""What friction can carry on one pad: the torque limit and the grip force that a load needs.

Each takes a search on the limit surface, so they are computed only for messages and the reflex, once for each state.
"""

from __future__ import annotations

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.friction.learning import Z
from slipd.fusion import grip_needed_n, torque_limit
from slipd.fusion.load_noise import relative_noise
from slipd.types.finite import finite_or_none


def needed_normal_n(finger: Finger, state: FingerState) -> float | None:
    """Return the least normal force on this pad that holds its load with the configured safety, N.

    It holds the load with the noise of the reading too, at a one-sided confidence of 95 %. None where it is not known,
    and where no force would hold the load.
    """
    if not state.needed_is_known:
        state.needed_n, state.needed_is_known = _find_needed_n(finger, state), True
    return state.needed_n


def _find_needed_n(finger: Finger, state: FingerState) -> float | None:
    contact, distribution, used, friction = state.contact, state.load_distribution, state.utilisation, state.friction
    if contact is None or distribution is None or used is None or friction is None or friction.mu is None:
        return None
    force, about, config = (contact.fx_n, contact.fy_n), (contact.cx_m, contact.cy_m), finger.config
    wrench, noise = config.wrench, 0.0
    if wrench is not None:  # otherwise the pad measures the force, of unknown noise
        noise = relative_noise(force, contact.spin_nm, about, used.twist, wrench.force_std_n, wrench.torque_std_nm)
    found = grip_needed_n(
        distribution.x,
        distribution.y,
        distribution.loads.loads * contact.normal_n,
        friction.mu,
        force,
        contact.spin_nm * friction.spin_scale,
        about,
        growth=config.contact_growth,
        safety=config.grip_safety * (1.0 + Z * noise),
    )
    return finite_or_none(found)


def torque_limit_nm(state: FingerState) -> float | None:
    """Return the torque in the sense of the spin that friction carries together with the tangential force, N·m.

    None where it is not known.
    """
    contact, distribution, friction = state.contact, state.load_distribution, state.friction
    if contact is None or distribution is None or state.utilisation is None or friction is None or friction.mu is None:
        return None
    sense = 1 if contact.spin_nm >= 0.0 else -1
    force, about = (contact.fx_n, contact.fy_n), (contact.cx_m, contact.cy_m)
    loads_n = distribution.loads.loads * contact.normal_n
    limit = torque_limit(distribution.x, distribution.y, loads_n, friction.mu, force, about, sense)
    return finite_or_none(limit.torque_nm / friction.spin_scale)
