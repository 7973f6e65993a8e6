"""What friction can carry on one pad: the torque limit and the grip force that a load needs.

Each takes a search on the limit surface, so they are computed only for messages and the reflex.
"""

from __future__ import annotations

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.friction.learning import Z
from slipd.fusion import Contact, Utilisation, grip_needed_n, torque_limit
from slipd.fusion.load_noise import relative_noise
from slipd.types.finite import finite_or_none


def needed_normal_n(finger: Finger, state: FingerState) -> float | None:
    """Return the least normal force on this pad that holds its load with the configured safety, N.

    It holds the load with the noise of the reading too, at a one-sided confidence of 95 %. None where it is not known,
    and where no force would hold the load.
    """
    contact, distribution, mu = state.contact, state.load_distribution, _mu(state)
    if contact is None or distribution is None or state.utilisation is None or mu is None:
        return None
    found = grip_needed_n(
        distribution.x,
        distribution.y,
        distribution.loads.loads * contact.normal_n,
        mu,
        (contact.fx_n, contact.fy_n),
        contact.spin_nm * _spin_scale(state),
        (contact.cx_m, contact.cy_m),
        growth=finger.config.contact_growth,
        safety=finger.config.grip_safety * (1.0 + Z * _load_noise(finger, contact, state.utilisation)),
    )
    return finite_or_none(found)


def _load_noise(finger: Finger, contact: Contact, used: Utilisation) -> float:
    """Return the relative standard deviation of the load by the stated noise of the force sensor."""
    wrench = finger.config.wrench
    if wrench is None:  # the pad measures the force, of unknown noise
        return 0.0
    force, about = (contact.fx_n, contact.fy_n), (contact.cx_m, contact.cy_m)
    return relative_noise(force, contact.spin_nm, about, used.twist, wrench.force_std_n, wrench.torque_std_nm)


def torque_limit_nm(finger: Finger, state: FingerState) -> float | None:
    """Return the torque in the sense of the spin that friction carries together with the tangential force, N·m.

    None where it is not known.
    """
    contact, distribution, mu = state.contact, state.load_distribution, _mu(state)
    if contact is None or distribution is None or state.utilisation is None or mu is None:
        return None
    sense = 1 if contact.spin_nm >= 0.0 else -1
    force, about = (contact.fx_n, contact.fy_n), (contact.cx_m, contact.cy_m)
    loads_n = distribution.loads.loads * contact.normal_n
    limit = torque_limit(distribution.x, distribution.y, loads_n, mu, force, about, sense)
    return finite_or_none(limit.torque_nm / _spin_scale(state))


def _spin_scale(state: FingerState) -> float:
    return 1.0 if state.friction is None else state.friction.spin_scale


def _mu(state: FingerState) -> float | None:
    return None if state.friction is None else state.friction.mu
