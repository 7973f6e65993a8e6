"""A patch between an object and a pad: where its cells are, what presses on them, and what the taxels read."""

from __future__ import annotations

import functools
import math
from collections.abc import Hashable
from typing import Protocol

import numpy as np

from slipd.tools.sim.stickslip.contact_patch import KINDS, ContactPatch
from slipd.tools.sim.stickslip.friction_law import FrictionLaw
from slipd.tools.sim.stickslip.grasp_parts import GraspedObject, PadCompliance
from slipd.tools.sim.stickslip.pressure_kernels import Pose, Shape, electrode_loads, map_factors, place_cells, press
from slipd.types.arrays import Array

ELECTRODE_SAMPLES = 7
"""Points across an electrode for its mean pressure; 7 by 7 are within 0.5 % of the integral."""

FIELD = 7
"""Numbers with which `press` describes a pressure."""


CELLS_ACROSS = 2
"""Least number of cells across a patch, or across a strip or ring."""


class Taxels(Hashable, Protocol):
    """The geometry of a pad's taxels, as `slipd.tools.sim.true_contact.Pad` has it."""

    @property
    def pitch_m(self) -> float:
        """Distance between neighbouring centres."""

    @property
    def electrode_m(self) -> float:
        """Diameter of the round electrode of a taxel."""

    def centres(self) -> tuple[Array, Array]:
        """Return the centres in the pad frame, x and y, shapes (taxels,), m."""


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

    def read(self, taxels: Taxels, motion: Array, normal_n: float, field: Array, *, right: bool) -> Array:
        """Return the reading of each taxel, shape (taxels,), N: its mean pressure times its cell's area.

        The sum is only near the normal force, because the gaps between the electrodes sense nothing.

        Args:
            taxels: Their geometry; hashable.
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


@functools.lru_cache(maxsize=8)
def electrode_points(taxels: Taxels) -> Array:
    """Return points across the electrode of every taxel, shape (2, taxels, points), m, in the frame of their pad."""
    offset = (np.arange(ELECTRODE_SAMPLES) - (ELECTRODE_SAMPLES - 1) / 2) / ELECTRODE_SAMPLES * taxels.electrode_m
    dx, dy = (grid.ravel() for grid in np.meshgrid(offset, offset))
    round_ = np.hypot(dx, dy) <= taxels.electrode_m / 2
    x, y = taxels.centres()
    return np.ascontiguousarray(np.stack((x[:, None] + dx[round_], y[:, None] + dy[round_])))
