"""Find mass and centre of mass of a finger from its readings in a few poses, and check the mounting against them.

Pure. A finger that nothing touches reads F = b + A⁻¹ m g, where A = s R takes forces of the sensor to the pad frame.
The rotation that fits the poses best solves Wahba's problem (SciPy's ``align_vectors``), for both signs s. It is
compared with the config and never written: a pose that was not the one that was asked for looks like a wrong mounting,
and the touches decide between the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.signals.gravity import STANDARD_GRAVITY_MPS2
from slipd.tools.commission.sensor_pose import STATED, nearest_known
from slipd.tools.commission.touches import Doubt, Mount
from slipd.tools.commission.weight_identification import LEAST_CHANGE_MPS2, Identification, identify
from slipd.types.arrays import Array, cross_matrix

MOST_MISFIT = 0.2
"""Largest residual of the force, as a share of the weight, root mean square over the poses: hands hold a pose to about
5° (0.1)."""

LEAST_LEVER_M = 0.02
"""Added to the levers with which residuals of the torque are compared, m: the torque of a light finger is near the
noise of the sensor."""

Misfit = Callable[[Array, Array], float]


def force_misfit(wrenches: Array, gravities: Array) -> float:
    """Return how far the forces are from those of the best weight, as a share of it, root mean square over the poses.

    Args:
        wrenches: In the pad frame, shape (poses, 6), N and N·m; or the forces alone.
        gravities: Shape (poses, 3), m/s².
    """
    weight_n, d_force, d_gravity = _centred(wrenches, gravities)
    if weight_n <= 0.0:
        return math.inf
    residual_n = float(np.linalg.norm(d_force - weight_n / STANDARD_GRAVITY_MPS2 * d_gravity))
    return residual_n / math.sqrt(len(gravities)) / weight_n


def torque_misfit(wrenches: Array, gravities: Array, sensor_m: float) -> float:
    """Return how far the torques are from those of the best centre of mass, as a share of the weight times its levers.

    Args:
        wrenches: In the pad frame, shape (poses, 6), N and N·m.
        gravities: Shape (poses, 3), m/s².
        sensor_m: Distance of the sensor from the pad, m.
    """
    weight_n, _, _ = _centred(wrenches, gravities)
    if weight_n <= 0.0:
        return math.inf
    matrix = np.vstack([np.hstack((-cross_matrix(each), np.eye(3))) for each in gravities])  # p × g + b
    torques = wrenches[:, 3:].ravel()
    found = np.linalg.lstsq(matrix, torques, rcond=None)[0]
    com_m = float(np.linalg.norm(found[:3])) * STANDARD_GRAVITY_MPS2 / weight_n
    residual_nm = float(np.linalg.norm(torques - matrix @ found)) / math.sqrt(len(gravities))
    return residual_nm / (weight_n * (com_m + sensor_m + LEAST_LEVER_M))


def worst_pose(misfit: Misfit, wrenches: Array, gravities: Array) -> int | None:
    """Return the pose without which the others fit; None where all fit, or no single one is to blame.

    Args:
        misfit: Of some poses.
        wrenches: In the pad frame, shape (poses, 6), N and N·m.
        gravities: Shape (poses, 3), m/s².
    """
    without = [
        misfit(np.delete(wrenches, number, axis=0), np.delete(gravities, number, axis=0))
        for number in range(len(gravities))
    ]
    if misfit(wrenches, gravities) <= MOST_MISFIT or min(without) > MOST_MISFIT:
        return None
    return int(np.argmin(without))


def _centred(wrenches: Array, gravities: Array) -> tuple[float, Array, Array]:
    """Return the best weight, N, and forces and gravities less their means."""
    d_force, d_gravity = wrenches[:, :3] - wrenches[:, :3].mean(axis=0), gravities - gravities.mean(axis=0)
    scatter = float(np.sum(d_gravity**2))
    mass_kg = float(np.sum(d_gravity * d_force)) / scatter if scatter > 0.0 else 0.0
    return mass_kg * STANDARD_GRAVITY_MPS2, d_force, d_gravity


MASSES_KG = (0.001, 20.0)
"""Least and largest mass of a finger."""

MOST_LEVER_M = 0.25
"""Largest distance of its centre of mass from the pad, m."""

SURELY_MM_M = 1.0
"""A longer lever follows from torques in N·mm, which make it a thousand times as long: every true one exceeds 1 mm."""

LEAST_SPREAD = 1e-12
"""Forces that spread less across their main direction than this part of what they spread along it are on one line."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Mean readings of a finger that is held still, in the frame of its sensor, without sign.

    Attributes:
        force: Force, shape (3,), N.
        torque: Torque about the origin of the sensor, shape (3,), N·m.
        gravity: Gravity in the pad frame, shape (3,), m/s².
    """

    force: Array
    torque: Array
    gravity: Array


@dataclass(slots=True)
class WeightFindings:
    """What the poses show.

    Attributes:
        found: Mass and centre of mass; None where they do not follow.
        notes: What was found, for people, with residuals.
        problems: What does not follow or contradicts, and what to do.
        contradicts: The poses fit another mounting than the stated one.
        worst: Index of the one pose that is to blame for the problems; None where no single one is.
    """

    found: Identification | None = None
    notes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    contradicts: bool = False
    worst: int | None = None


@dataclass(frozen=True, slots=True)
class _Fit:
    sign: int
    rotation: Rotation
    mass_kg: float
    misfit: float


def find_weight(poses: Sequence[Pose], present: Mount) -> WeightFindings:
    """Find mass and centre of mass of a finger.

    Args:
        poses: Three or more.
        present: Mounting of the sensor by the config, or by the touches.
    """
    findings = WeightFindings()
    gravities = np.array([pose.gravity for pose in poses])
    wrenches = np.array([present.matrix @ np.concatenate((pose.force, pose.torque)) for pose in poses])
    try:
        findings.found = _weigh(poses, wrenches, gravities, present, findings)
        findings.notes += findings.found.lines()
    except (Doubt, ValueError) as problem:
        findings.problems.append(str(problem))
        by_torque = partial(torque_misfit, sensor_m=math.hypot(*present.xyz_m))
        misfit = force_misfit if force_misfit(wrenches, gravities) > MOST_MISFIT else by_torque
        findings.worst = worst_pose(misfit, wrenches, gravities)
    return findings


def _weigh(
    poses: Sequence[Pose], wrenches: Array, gravities: Array, present: Mount, findings: WeightFindings
) -> Identification:
    """Return mass and centre of mass.

    Args:
        poses: As read.
        wrenches: The same in the pad frame, shape (poses, 6).
        gravities: Shape (poses, 3), m/s².
        present: Mounting by which they are in the pad frame.
        findings: Where to add what is known of it.

    Raises:
        Doubt: The readings are not those of a weight with this mounting.
        ValueError: See `identify`.
    """
    _check_mounting(np.array([pose.force for pose in poses]), gravities, present, findings)
    found = identify(wrenches[:, :3], wrenches[:, 3:], gravities)
    _check_lever(float(np.linalg.norm(found.com_m)))
    _check_misfit(force_misfit(wrenches, gravities))
    if torque_misfit(wrenches, gravities, math.hypot(*present.xyz_m)) > MOST_MISFIT:
        raise Doubt(
            f"the torques are {found.residual_nm:.2g} N·m from those of any centre of mass in these poses: the finger "
            "was touched, or a cable pulls at it"
        )
    return found


def _check_mounting(forces: Array, gravities: Array, present: Mount, findings: WeightFindings) -> None:
    """Raise where the forces contradict the mounting; note what cannot be decided."""
    fit = _fit(forces, gravities)
    if fit is None:
        findings.notes.append(
            "sign and rotation of the sensor are not checked: gravity changed in one plane only; a fourth pose would"
        )
        return
    if not MASSES_KG[0] < fit.mass_kg < MASSES_KG[1]:
        raise Doubt(_wrong_force(fit.mass_kg))
    _check_misfit(fit.misfit)
    quaternion, how = nearest_known(fit.rotation, present)
    away = math.degrees((fit.rotation * Rotation.from_quat(quaternion).inv()).magnitude())
    if (fit.sign, how) == (present.sign, STATED):
        findings.notes.append(f"sign {fit.sign:+d} and rotation of the config fit the weight, {away:.0f}° apart")
        return
    findings.contradicts = True
    raise Doubt(
        f"the weight fits sign {fit.sign:+d} and a rotation that is {how}, not those of the config (sign "
        f"{present.sign:+d}): either the mounting is wrong, or the poses were not those asked for. Touches decide: "
        "slipd commission FILE --from mounting"
    )


def _fit(forces: Array, gravities: Array) -> _Fit | None:
    """Return the mounting and the mass that fit the poses best; None where gravity leaves a direction out."""
    _, d_force, d_gravity = _centred(forces, gravities)
    if np.linalg.svd(d_gravity, compute_uv=False)[-1] < LEAST_CHANGE_MPS2 * math.sqrt(len(gravities) - 1):
        return None
    spread = np.linalg.svd(d_force, compute_uv=False)
    if spread[1] <= LEAST_SPREAD * spread[0]:  # on one line: no rotation follows, and no weight fits
        return _Fit(1, Rotation.identity(), 0.0, math.inf)
    fits = ((Rotation.align_vectors(d_gravity, sign * d_force), sign) for sign in (1, -1))
    (rotation, _), sign = min(fits, key=lambda fit: fit[0][1])
    turned = sign * rotation.apply(forces)
    weight_n, _, _ = _centred(turned, gravities)
    return _Fit(sign, rotation, weight_n / STANDARD_GRAVITY_MPS2, force_misfit(turned, gravities))


def _wrong_force(mass_kg: float) -> str:
    if MASSES_KG[0] < mass_kg / 1000.0 < MASSES_KG[1]:
        return f"the finger would weigh {mass_kg:.3g} kg: the forces are in mN, not N, or a gain is wrong"
    return (
        f"the finger would weigh {1e3 * mass_kg:.2g} g: it is too light to be weighed, and needs no mass_kg; or the "
        "forces are in kN, or a gain is wrong"
    )


def _check_lever(lever_m: float) -> None:
    """Raise where the centre of mass is too far from the pad."""
    if not lever_m < MOST_LEVER_M:
        unit = "the torques are in N·mm, not N·m" if lever_m > SURELY_MM_M else "the torques are wrong"
        raise Doubt(
            f"the centre of mass would be {lever_m:.3g} m from the pad: {unit}, or xyz_m is wrong. Weighing cannot "
            "tell these apart; presses beside a pad image can"
        )


def _check_misfit(share: float) -> None:
    """Raise where the forces are too far from those of a weight, as a share of it."""
    if share > MOST_MISFIT:
        raise Doubt(
            f"the readings are {share:.0%} of the weight from any weight in these poses: the finger was touched or "
            "moved, a cable pulls at it, or the poses were not those asked for"
        )
