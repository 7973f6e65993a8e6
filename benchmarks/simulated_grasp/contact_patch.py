"""The shape of a contact and of its pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance
from simulated_grasp.pressure_kernels import (
    DISC,
    EDGE,
    RECTANGLE,
    RING,
    ROUNDED,
    STRIPS,
    Pose,
    Shape,
    electrode_loads,
    map_factors,
    place_cells,
    press,
)

from slipd.tools.sim.scene_parts import Pad, electrode_points
from slipd.types.arrays import Array

KINDS = {
    "disc": DISC,
    "ring": RING,
    "rectangle": RECTANGLE,
    "square": RECTANGLE,
    "two_strips": STRIPS,
    "edge": EDGE,
    "rounded": ROUNDED,
}
"""Shapes by name."""


@dataclass(frozen=True)
class ContactPatch:
    """A contact patch, in the frame of the left pad.

    With u and v the coordinates from its centre over the half lengths, and e the exponent, the relative pressure is

    - disc (an ellipse where the half lengths differ): (1 − u² − v²)^e; e = 1/2 is Hertz's pressure;
    - rectangle, square: ((1 − u⁴)(1 − v⁴))^e;
    - rounded: (1 − u⁴ − v⁴)^e, between the two;
    - ring: between ``inner`` and 1 of the radius, the pressure of a tube, (1 − w²)^e with w from −1 to 1 across it;
    - two_strips: two strips along x, from ``inner`` to 1 of the half width on either side, likewise;
    - edge: a rectangle whose pressure rises linearly from 0 at u = −1 to its most at u = +1.

    With e = 0 the pressure is uniform.

    Attributes:
        kind: One of `KINDS`.
        half_length_m: Half length along x at the reference force.
        half_width_m: Half width along y at the reference force; None takes the half length.
        inner: Inner over outer size of "ring" and "two_strips".
        exponent: e.
        growth: γ: the size is proportional to (f / reference)^γ about the centre; 0 is rigid, 1/3 is Hertz.
        reference_n: Normal force on one pad at which the half lengths hold, N.
        centre_m: Centre; not always the centroid of the pressure.
        moves_with_object: Whether the patch moves over the pad with the object, as that of an edge or of a small
            object does. Otherwise it stays on the pad, as with a crowned pad on a flat box.

    Raises:
        ValueError: A number is out of range, or the kind is unknown.
    """

    kind: str = "rounded"
    half_length_m: float = 0.018
    half_width_m: float | None = 0.009
    inner: float = 0.6
    exponent: float = 0.5
    growth: float = 0.0
    reference_n: float = 10.0
    centre_m: tuple[float, float] = (0.0, 0.0)
    moves_with_object: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if not (0.0 < self.half_length_m < math.inf and 0.0 < self.width_m < math.inf):
            raise ValueError(f"half lengths must be positive, got {self.half_length_m} and {self.half_width_m}")
        if self.kind == "square" and self.width_m != self.half_length_m:
            raise ValueError(f"a square must have one half length, got {self.half_length_m} and {self.half_width_m}")
        if not (0.0 <= self.inner < 1.0 and self.exponent >= 0.0):
            raise ValueError(f"inner must be in [0, 1) and exponent ≥ 0, got {self.inner} and {self.exponent}")
        if not (0.0 <= self.growth <= 1.0 and self.reference_n > 0.0):
            raise ValueError(f"growth must be in [0, 1] and reference_n > 0, got {self.growth} and {self.reference_n}")

    @property
    def width_m(self) -> float:
        """The half width."""
        return self.half_length_m if self.half_width_m is None else self.half_width_m

    def scale(self, normal_n: float) -> float:
        """Return the size of the patch at a normal force over its size at the reference force."""
        if self.growth == 0.0:
            return 1.0
        return float((max(normal_n, 0.0) / self.reference_n) ** self.growth)

    def cells(self, cell_m: float, largest_n: float) -> Array:
        """Divide the patch, as large as it is at the largest normal force, into square cells.

        Returns:
            Centres of the cells, shape (2, n), m. Their area is ``cell_m``².
        """
        halves = max(self.scale(largest_n), 1e-9) * np.array(((self.half_length_m,), (self.width_m,)))
        cells = np.stack(np.meshgrid(*(_middles(half, cell_m) for half in halves[:, 0]))).reshape(2, -1)
        if self.kind in ("disc", "ring"):  # without the corners
            nearest = np.clip(np.abs(cells) - cell_m, 0.0, None) / halves
            cells = cells[:, np.hypot(*nearest) <= 1.0]
        return np.ascontiguousarray(cells + np.array(self.centre_m)[:, None])


def _middles(half_m: float, cell_m: float) -> Array:
    n = 2 * math.ceil(half_m / cell_m - 1e-9)
    return np.asarray((np.arange(n) - (n - 1) / 2) * cell_m, dtype=np.float64)


FIELD = 7
"""Numbers with which `press` describes a pressure."""


CELLS_ACROSS = 2
"""Least number of cells across a patch, or across a strip or ring."""


class PressedPatch:
    """The contact of a grasp, without state. All arrays are in the frame of the left pad.

    Args:
        patch: Shape of the contact.
        held: The object.
        friction: For its map.
        pad: For its size.
        cell_m: Side of a cell, m.
        largest_n: Largest normal force on one pad that the cells must cover, N.

    Attributes:
        cells: Centres of the cells in local coordinates: on the pad, or on the object where the patch moves with it;
            shape (2, n), m.
        on_pad: Where they are on the pad, shape (2, n), m.
        on_object: Likewise on the object before it moved.
        moves: Whether the patch moves with the object.
        stays: Whether the motion of the object changes neither pressure nor friction of a cell.
    """

    def __init__(
        self, patch: ContactPatch, held: GraspedObject, friction: FrictionLaw, pad: PadCompliance, cell_m: float,
        largest_n: float,
    ) -> None:  # fmt: skip
        if not cell_m > 0.0:
            raise ValueError(f"cell_m must be positive, got {cell_m}")
        self._patch, self._held, self._wet = patch, held, friction.wet
        thickness = (1.0 - patch.inner) / 2 if patch.kind in ("ring", "two_strips") else 1.0
        self._least_scale = CELLS_ACROSS * cell_m / (2 * thickness * min(patch.half_length_m, patch.width_m))
        if self._least_scale > patch.scale(largest_n):
            raise ValueError(f"cell_m must resolve the patch with {CELLS_ACROSS} cells across, got {cell_m}")
        self.cells = patch.cells(cell_m, largest_n)
        self.on_pad, self.on_object = self.cells.copy(), self.cells.copy()
        cx, cy = patch.centre_m
        self._shape = Shape(
            KINDS[patch.kind], float(patch.half_length_m), float(patch.width_m), float(patch.inner),
            float(patch.exponent), float(cx), float(cy), float(held.centre_m[0]), float(held.centre_m[1]),
            float(held.half_length_m), float(held.half_width_m), float(pad.half_length_m), float(pad.half_width_m),
            float(cell_m), bool(patch.moves_with_object),
        )  # fmt: skip
        self.moves = self._shape.moves
        bounds = (held.half_length_m, held.half_width_m, pad.half_length_m, pad.half_width_m)
        self.stays = not self.moves and friction.wet is None and all(map(math.isinf, bounds))
        self.cell_m = cell_m

    def _scale(self, normal_n: float) -> float:
        """Return the size of the patch; a growing one begins with the least size that the cells resolve."""
        return max(self._patch.scale(normal_n), self._least_scale)

    def _pose(self, motion: Array) -> Pose:
        """Return the pose of the object whose centre of mass and angle are the first three of ``motion``."""
        x, y, angle = motion.item(0), motion.item(1), motion.item(2)
        x0, y0 = self._held.centre_of_mass_m
        return Pose(float(x0), float(y0), x, y, math.cos(angle), math.sin(angle))

    def place(self, motion: Array) -> None:
        """Move the cells to where the object is, whose centre of mass and angle are the first of ``motion``."""
        place_cells(self._shape, self._pose(motion), self.cells, self.on_pad, self.on_object)

    def press(
        self, normal_n: float, tilt_nm: tuple[float, float], side: int, loads: Array, holds: Array,
        field: Array,
    ) -> None:  # fmt: skip
        """Write the normal force on each cell of a pad; the cells must be placed.

        Args:
            normal_n: Normal force, N.
            tilt_nm: Moments on the object, N·m.
            side: 0 for the left pad, 1 for the right one.
            loads: Gets the loads, shape (n,), N.
            holds: Gets the loads times the map of the friction, shape (n,), N.
            field: Gets the description of the pressure, shape (FIELD,).
        """
        shift_x = shift_y = 0.0
        if normal_n > 0.0 and tilt_nm != (0.0, 0.0):
            sign = -0.5 if side else 0.5
            shift_x, shift_y = sign * tilt_nm[1] / normal_n, -sign * tilt_nm[0] / normal_n
        scale = self._scale(normal_n)
        press(self._shape, scale, normal_n, shift_x, shift_y, self.on_pad, self.on_object, loads, field)
        wet = self._wet
        if wet is None:
            holds[:] = loads
        else:
            map_factors(wet.x0_m, wet.y0_m, wet.cell_m, wet.factor, self.on_object, loads, holds)

    def read(self, taxels: Pad, motion: Array, normal_n: float, field: Array, *, right: bool) -> Array:
        """Return the reading of each taxel, shape (taxels,), N: its mean pressure times its cell's area.

        The sum is only near the normal force, because the gaps between the electrodes sense nothing.

        Args:
            taxels: Their geometry.
            motion: As in `place`.
            normal_n: Normal force, N.
            field: As `press` wrote it for that pad.
            right: Whether the taxels are those of the right pad.
        """
        points = electrode_points(taxels)
        out = np.zeros(points.shape[1])
        if field[0] > 0.0:
            mirror = -1.0 if right else 1.0
            area = taxels.pitch_m**2 / self.cell_m**2
            scale = self._scale(normal_n)
            electrode_loads(self._shape, scale, self._pose(motion), field, points, mirror, area, out)
        return out
