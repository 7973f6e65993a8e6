"""Find sign, rotation and position of a force sensor, and the orientation of the image, from presses and pushes.

Pure. Everything is measured as a difference to the untouched finger. The person presses the centre of the pad, the
middle of its +X end and its +X +Y corner, and pushes along +X and +Y at the centre. In the frame of the sensor a press
is s Rᵀ(−z), and the pushes are s Rᵀx and s Rᵀy, so their determinant is the sign s. The torque of a press gives its
place, from which the position of the sensor follows, and which of the eight symmetries the image has.

What does not follow is reported and never guessed: presses at one place leave the symmetry open, and a place that
contradicts the pushes leaves the sign open.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.tools.commission.sensor_pose import find_position, nearest_known
from slipd.tools.commission.touches import (
    CENTRE,
    CORNER,
    END,
    LEAST_FORCE_N,
    LEAST_TRAVEL_M,
    PRESSES,
    PUSH_X,
    PUSH_Y,
    PUSHES,
    STEPS,
    SYMMETRIES,
    Doubt,
    Findings,
    Mount,
    Symmetry,
    Touch,
    goes_to_corner,
    goes_to_end,
)
from slipd.types.arrays import Array, cross_matrix

SAME_DIRECTION_RAD = math.radians(20.0)
"""Presses whose directions differ by more were not all normal to the pad."""

SQUARE_RAD = math.radians(40.0)
"""The pushes may miss a right angle by this much; they are coarse, and the image corrects the turn about the normal."""

YAW_RAD = math.radians(30.0)
"""Largest such correction."""

KEEP_M = 0.003
"""A position of the config this near to the measured one is kept, m."""

CLEAR = 2.0
"""The second-best symmetry must fit this many times worse than the best."""

SCALES = (0.7, 1.4)
"""Range of the travel by torque over the travel in the image; beyond it a unit or the pitch is wrong."""

WRONG_UNITS = {1000.0: "its torques are in N·mm, not N·m", 0.001: "its torques are in kN·m, or its forces in mN"}
"""What such a ratio means."""


def find_mounting(touches: Mapping[str, Touch], present: Mount, *, has_pad: bool = True) -> Findings:
    """Find the mounting of a force sensor and the orientation of the image in front of it.

    Args:
        touches: By step; the image may be missing.
        present: What the config states now; kept where it agrees with the touches.
        has_pad: There should be an image.
    """
    found = Findings()
    with found.searching():
        axes = _axes(touches)
        sign = 1 if np.linalg.det(axes) > 0.0 else -1
        coarse, _ = Rotation.align_vectors(np.eye(3), sign * axes.T)
        travels = _travels(_turned(touches, sign, coarse))
        symmetry, yaw_rad = _orientation(touches, travels, found, has_pad=has_pad)
        turn = Rotation.from_euler("z", yaw_rad)
        _check_places(travels @ turn.as_matrix()[:2, :2].T)
        _add_mount(touches, sign, turn * coarse, symmetry, present, found)
    return found


def _orientation(
    touches: Mapping[str, Touch], travels: Array, found: Findings, *, has_pad: bool
) -> tuple[Symmetry | None, float]:
    """Return the orientation of the image, None without one, and the turn by which it corrects the travels, rad."""
    images = _image_travels(touches)
    if images is None:
        if has_pad:
            _add_missing_image(touches, found)
        return None, 0.0
    _check_scale(sum(map(math.hypot, *travels.T)) / sum(math.hypot(*image) for image in images))
    return _find_symmetry(images, travels, found)


def _add_mount(
    touches: Mapping[str, Touch],
    sign: int,
    rotation: Rotation,
    symmetry: Symmetry | None,
    present: Mount,
    found: Findings,
) -> None:
    """Add mounting and orientation, if the torques show where the sensor is."""
    quaternion, how = nearest_known(rotation, present)
    loads = _turned(touches, sign, Rotation.from_quat(quaternion))
    xyz_m, residual_m = find_position(touches, loads, symmetry)
    kept = math.dist(xyz_m, present.xyz_m) <= KEEP_M
    x_m, y_m, z_m = map(float, xyz_m)
    found.mount = Mount(sign, present.xyz_m if kept else (x_m, y_m, z_m), quaternion)
    found.symmetry = symmetry
    away = math.degrees((rotation * Rotation.from_quat(quaternion).inv()).magnitude())
    found.notes.append(f"sign {sign:+d}; rotation {how}, {away:.0f}° from that of the touches")
    found.notes.append(
        f"sensor at {_mm(xyz_m)} mm in the pad frame, residual {1e3 * residual_m:.1f} mm"
        f"{'; the position of the config is kept' if kept else ''}"
    )


def _axes(touches: Mapping[str, Touch]) -> Array:
    """Return the directions of X, Y and Z of the pad in the signed frame of the sensor, as columns."""
    if missing := [step for step in STEPS if step not in touches or not touches[step].felt]:
        raise Doubt(f"the force sensor showed nothing at: {', '.join(missing)}")
    presses = [_unit(touches[step].force) for step in PRESSES]
    total = np.sum(presses, axis=0)
    into = _unit(total) if total.any() else presses[0]
    if max(_angle(into, press) for press in presses) > SAME_DIRECTION_RAD:
        text = "the presses had different directions: press at right angles to the pad, at each place"
        raise Doubt(text, _slanted(presses))
    pushes = [touches[step].force - into * (into @ touches[step].force) for step in (PUSH_X, PUSH_Y)]
    if missing := [step for step, push in zip(PUSHES, pushes, strict=True) if np.linalg.norm(push) < LEAST_FORCE_N]:
        raise Doubt("the pushes show no force along the pad: push along +X and along +Y", *missing)
    along_x, along_y = map(_unit, pushes)
    if abs(_angle(along_x, along_y) - math.pi / 2) > SQUARE_RAD:
        raise Doubt(
            f"the pushes along +X and +Y are {math.degrees(_angle(along_x, along_y)):.0f}° apart, not 90°: "
            "push along the longer side of the pad, then across it",
            *PUSHES,
        )
    return np.column_stack((along_x, along_y, -into))


def _depth(loads: Mapping[str, tuple[Array, Array]]) -> float:
    """Return how far the pad is from the origin of the sensor along Z, m: M = q × F at one place."""
    forces, torques = zip(*(loads[step] for step in (CENTRE, PUSH_X, PUSH_Y)), strict=True)
    matrix = np.vstack([-cross_matrix(force) for force in forces])
    return float(np.linalg.lstsq(matrix, np.concatenate(torques), rcond=None)[0][2])


def _lever(force: Array, torque: Array, depth_m: float) -> Array:
    """Return where a press acts, X and Y from the origin of the sensor, m: M = q × F."""
    return np.array(((depth_m * force[0] - torque[1]) / force[2], (depth_m * force[1] + torque[0]) / force[2]))


def _turned(touches: Mapping[str, Touch], sign: int, rotation: Rotation) -> dict[str, tuple[Array, Array]]:
    """Return force and torque of each touch in the axes of the pad, about the origin of the sensor."""
    matrix = sign * rotation.as_matrix()
    return {step: (matrix @ touch.force, matrix @ touch.torque) for step, touch in touches.items()}


def _travels(loads: Mapping[str, tuple[Array, Array]]) -> Array:
    """Return how far the end and the corner are from the centre by torque, shape (2, 2), m."""
    depth_m = _depth(loads)
    centre, end, corner = (_lever(*loads[step], depth_m) for step in PRESSES)
    return np.array((end - centre, corner - centre))


def _image_travels(touches: Mapping[str, Touch]) -> Array | None:
    """Return the same in the scan of the image; None without an image, or if it did not travel."""
    centre, end, corner = (touches[step].scan_m for step in PRESSES)
    if centre is None or end is None or corner is None:
        return None
    travels = np.subtract((end, corner), centre)
    return np.asarray(travels, dtype=np.float64) if np.abs(travels).max() > LEAST_TRAVEL_M else None


def _add_missing_image(touches: Mapping[str, Touch], found: Findings) -> None:
    """Add that the orientation is not known; presses are to blame where others showed an image."""
    missing = [step for step in PRESSES if touches[step].scan_m is None]
    found.add_problem(
        "the pad showed no image at some of the presses, so its orientation is not known; begin again once the "
        "daemon runs what was found of the force sensor",
        *(missing if len(missing) < len(PRESSES) else ()),
    )


def _check_scale(scale: float) -> None:
    """Raise where the travel by torque is another one than that in the image, with what that means."""
    if SCALES[0] <= scale <= SCALES[1]:
        return
    for factor, meaning in WRONG_UNITS.items():
        if 0.5 < scale / factor < 2.0:
            raise Doubt(
                f"the force sensor moves {scale:.3g} times as far as the image: {meaning}; correct it and begin again"
            )
    raise Doubt(
        f"the force sensor moves {scale:.2f} times as far as the image: pitch_m, a gain of the sensor, or the place of "
        "a press is wrong; nothing follows from these presses",
        *PRESSES,
    )


def _check_places(travels: Array) -> None:
    """Raise where the places by torque are not those that were asked for."""
    end, corner = travels
    if np.hypot(*travels.T).max() < LEAST_TRAVEL_M:
        raise Doubt("all presses were at one place: press the middle of the +X end, and the +X +Y corner", END, CORNER)
    if not (goes_to_end(end) and goes_to_corner(corner)):
        raise Doubt(
            f"by the pushes, the end was pressed at {_mm(end)} mm and the corner at {_mm(corner)} mm from the centre: "
            "a press or a push was on the other side",
            *(() if goes_to_end(end) else (END,)),
            CORNER,
            *PUSHES,
        )


def _find_symmetry(images: Array, travels: Array, found: Findings) -> tuple[Symmetry, float]:
    """Return the orientation of the image, and the angle by which the travels by torque must turn to fit it, rad."""
    fits = sorted(
        (*_misfit(np.array([one.place(image) for image in images]), travels), k) for k, one in enumerate(SYMMETRIES)
    )
    (best_m, yaw_rad, best), (second_m, _, _) = fits[:2]
    if second_m < max(CLEAR * best_m, LEAST_TRAVEL_M):
        raise Doubt(
            f"the orientation of the image is open: two of the eight fit to {1e3 * best_m:.1f} and "
            f"{1e3 * second_m:.1f} mm; press further from the centre",
            END,
            CORNER,
        )
    found.notes.append(
        f"image against force: {1e3 * best_m:.1f} mm; the next of the eight orientations {1e3 * second_m:.1f} mm"
    )
    return SYMMETRIES[best], yaw_rad


def _misfit(image: Array, travels: Array) -> tuple[float, float]:
    """Return how far the travels are from those of the image after the best turn of up to YAW_RAD, m, and the turn."""
    cross = float(np.sum(travels[:, 0] * image[:, 1] - travels[:, 1] * image[:, 0]))
    yaw_rad = min(max(math.atan2(cross, float(np.sum(travels * image))), -YAW_RAD), YAW_RAD)
    turn = Rotation.from_euler("z", yaw_rad).as_matrix()[:2, :2]
    return float(np.hypot(*(travels @ turn.T - image).T).max()), yaw_rad


def _slanted(presses: Sequence[Array]) -> str:
    """Return the press whose direction differs most: the other two agree best."""
    others = [np.delete(presses, number, axis=0) for number in range(len(PRESSES))]
    return min(zip(PRESSES, others, strict=True), key=lambda each: _angle(*each[1]))[0]


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _angle(first: Array, second: Array) -> float:
    return math.acos(min(max(float(first @ second), -1.0), 1.0))


def _mm(place_m: Array) -> str:
    return ", ".join(f"{1e3 * part:.1f}" for part in place_m)
