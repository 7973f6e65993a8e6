"""The message bodies: what a state says on the wire. What is not known is nil, never 0, NaN or inf."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState, ForceReading
from slipd.finger.image_channel import ImageChannel
from slipd.finger.verdict import PAD_PULLED
from slipd.fusion import grip_needed_n, torque_limit
from slipd.gripper.grip_policy import GripPolicy
from slipd.samples import Array
from slipd_client.messages import level_code

Body = dict[str, Any]

#: ``force_unit``: that of every force in a message; a torque is in that unit times metres.
NEWTON, UNCALIBRATED = "N", "uncalibrated"


def number(value: float | None) -> float | None:
    """A finite float, or nil."""
    return None if value is None or not math.isfinite(value) else float(value)


def lease_body(policy: GripPolicy, t_ns: int) -> Body:
    """``lease`` of the messages."""
    expires_in_s = policy.expires_in_s(t_ns)
    return {"held": expires_in_s is not None, "expires_in_s": expires_in_s}


def vector(values: Array | None) -> list[float] | None:
    """A list of finite floats, or nil where one is unknown."""
    if values is None:
        return None
    listed = values.tolist()
    return listed if all(map(math.isfinite, listed)) else None


def finite(values: Sequence[float]) -> list[float] | None:
    """A list of finite floats, or nil where one is unknown."""
    return list(values) if all(map(math.isfinite, values)) else None


def pair(x: float, y: float) -> list[float] | None:
    """Two finite floats, or nil."""
    return [x, y] if math.isfinite(x) and math.isfinite(y) else None


def slip_body(finger: Finger, state: FingerState) -> Body:
    """``slip.<finger>``, exact while in contact."""
    contact = state.contact if state.contact is not None and state.contact.valid else None
    used, distribution = state.utilisation, state.load_distribution
    return {
        **verdict_body(finger, state),
        "force_unit": _force_unit(finger, state.status),
        "normal_n": _normal_n(state),
        "tangential_n": None if contact is None else pair(contact.fx_n, contact.fy_n),
        "spin_nm": None if contact is None else number(contact.spin_nm),
        "centroid_m": None if contact is None else pair(contact.cx_m, contact.cy_m),
        "centroid_std_m": None if contact is None else pair(contact.cx_std_m, contact.cy_std_m),
        "friction_ratio": None if contact is None else number(contact.friction_ratio),
        "friction_ratio_std": None if contact is None else number(contact.friction_ratio_std),
        "gravity": None if finger.force is None else finger.force.gravity.state(state.t_ns),
        "mu": finger.friction.mu,
        "mu_source": finger.friction.source,
        "utilisation": None if used is None else number(used.value),
        "utilisation_lower": None if used is None else number(used.lower),
        "utilisation_upper": None if used is None else number(used.upper),
        **_limits(state, finger),
        "pole_m": None if used is None else vector(used.pole_m),
        "tipping_margin_m": number(state.tipping_margin_m),
        "tipping_margin_std_m": None if finger.image is None else 0.5 * finger.image.geometry.pitch_m,
        "centroid_residual_m": None if distribution is None else number(distribution.loads.centroid_residual_m),
        "model": state.model,
        "tare_id": finger.tare.current.id,
        "age_s": state.age_s,
    }


def _force_unit(finger: Finger, status: Sequence[str]) -> str:
    return NEWTON if finger.in_newtons and "raw" not in status else UNCALIBRATED


def _normal_n(state: FingerState) -> float | None:
    """Normal force, N; also the negative one that is why nothing else is known."""
    if state.contact is not None:
        return number(state.contact.normal_n)
    return number(-state.wrench[2]) if state.verdict is PAD_PULLED and state.wrench is not None else None


def verdict_body(finger: Finger, state: FingerState) -> Body:
    """What ``slip`` and ``warning`` say alike."""
    return {
        "finger": finger.name,
        "level": state.verdict.level,
        "level_code": level_code(state.verdict.level),
        "reasons": list(state.verdict.reasons),
    }


def needed_n(state: FingerState, finger: Finger) -> float | None:
    """The least normal force on this pad that holds its load with the configured safety, N.

    None where it is not known, and where no force would do.
    """
    contact, shares, loads = state.contact, state.load_distribution, state.loads
    if contact is None or loads is None or shares is None or state.utilisation is None:
        return None
    found = grip_needed_n(
        shares.x,
        shares.y,
        loads.loads,
        finger.friction.mu or math.nan,
        (contact.fx_n, contact.fy_n),
        contact.spin_nm,
        (contact.cx_m, contact.cy_m),
        growth=finger.config.contact_growth,
        safety=finger.config.grip_safety,
    )
    return number(found)


def _limits(state: FingerState, finger: Finger) -> Body:
    """The torque limit in the sense of the spin, and the grip that would hold the load."""
    contact, shares, loads = state.contact, state.load_distribution, state.loads
    if contact is None or loads is None or shares is None or state.utilisation is None:
        return {"torque_limit_nm": None, "grip_needed_n": None}
    mu = finger.friction.mu or math.nan
    sense = 1 if contact.spin_nm >= 0.0 else -1
    force, about = (contact.fx_n, contact.fy_n), (contact.cx_m, contact.cy_m)
    limit = torque_limit(shares.x, shares.y, loads.loads, mu, force, about, sense)
    return {"torque_limit_nm": number(limit.torque_nm), "grip_needed_n": needed_n(state, finger)}


def wrench_body(finger: Finger, felt: ForceReading) -> Body:
    """``wrench.<finger>``: the force on the finger in the pad frame, tared and mounted."""
    wrench = felt.wrench
    return {
        "finger": finger.name,
        "force_unit": _force_unit(finger, felt.status),
        "force_n": None if wrench is None else finite(wrench[:3]),
        "torque_nm": None if wrench is None else finite(wrench[3:]),
        "normal_n": None if wrench is None else number(-wrench[2]),
        "tangential_n": None if wrench is None else finite(wrench[:2]),
        "status": list(felt.status),
        "tare_id": finger.tare.current.id,
        "age_s": felt.age_s,
    }


def tactile_body(finger: Finger, image: ImageChannel) -> Body:
    """``tactile.<finger>``: loads on the taxels in scan order, and the shape of the contact."""
    known = not image.reasons
    shape = image.shape() if known else None
    geometry = image.geometry
    return {
        "finger": finger.name,
        "rows": geometry.rows,
        "cols": geometry.cols,
        "pitch_m": geometry.pitch_m,
        "tare_id": image.tare.current.id,
        "image_ok": known,
        "image_reasons": list(image.reasons),
        "force_unit": NEWTON if finger.image_in_newtons else UNCALIBRATED,
        "loads_n": image.pressure.tolist() if known else None,
        "active": None if shape is None else shape.active,
        "area_m2": None if shape is None else shape.area_m2,
        "centroid_m": None if shape is None else vector(shape.centroid_m),
        "axis_rad": None if shape is None else number(shape.axis_rad),
        "elongation": None if shape is None else number(shape.elongation),
        "holes": None if shape is None else shape.holes,
        "corners_m": None if shape is None else shape.corners_m.tolist(),
        "status": list(image.status),
    }
