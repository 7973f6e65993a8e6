"""The noise of a utilisation, from that of the force sensor."""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled


@compiled
def relative_noise(
    force: tuple[float, float], spin: float, about: tuple[float, float], twist: tuple[float, float, float],
    force_std: float, torque_std: float,
) -> float:  # fmt: skip
    """Return the relative standard deviation of a utilisation; 0 where no motion is known that would begin.

    The gradient of λ with respect to the load is the motion that would begin, over its frictional power. Components of
    force and torque about the pad's origin have independent noise.

    Args:
        force: Tangential force, N.
        spin: Torque about the pad normal through ``about``, N·m.
        about: Centroid of the contact, m.
        twist: Velocity of that point (2) and angular velocity of the motion that would begin.
        force_std: Standard deviation of each force component, N.
        torque_std: Standard deviation of each torque component, N·m.

    Source: envelope theorem on λ = max ℓ·q / D(q).
    """
    vx, vy, omega = twist
    power = abs(force[0] * vx + force[1] * vy + spin * omega)
    if not power > 0.0:
        return 0.0
    origin = math.hypot(vx + omega * about[1], vy - omega * about[0])
    return math.hypot(origin * force_std, omega * torque_std) / power
