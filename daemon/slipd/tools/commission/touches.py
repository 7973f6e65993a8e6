"""What a person's touches read, and what they show."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from slipd.config import Pad, Wrench
from slipd.signals.mounting import Mounting
from slipd.types.arrays import Array

CENTRE, END, CORNER, PUSH_X, PUSH_Y = "centre", "end", "corner", "push_x", "push_y"
STEPS = (CENTRE, END, CORNER, PUSH_X, PUSH_Y)
PRESSES = (CENTRE, END, CORNER)
PUSHES = (PUSH_X, PUSH_Y)

NAMES = {
    CENTRE: "the press at the centre",
    END: "the press at the +X end",
    CORNER: "the press at the +X +Y corner",
    PUSH_X: "the push along +X",
    PUSH_Y: "the push along +Y",
}
"""What each touch is, for people."""

TEXTS = {
    CENTRE: "Press the centre of the {finger} pad with a fingertip, at right angles, with about 5 N, and hold still.",
    END: "Press the middle of the +X end of the {finger} pad (the end towards the fingertip).",
    CORNER: "Press the corner of the {finger} pad at +X and +Y.",
    PUSH_X: "Press the centre of the {finger} pad again, and push along +X (towards the fingertip) without sliding.",
    PUSH_Y: "Press the centre of the {finger} pad again, and push along +Y without sliding.",
}
"""What the guide asks a person to do for each touch, in the order in which it asks."""

LEAST_TRAVEL_M = 0.003
"""Presses must be this far apart to show the orientation of the image, m."""


@dataclass(frozen=True, slots=True)
class Touch:
    """Mean readings while a finger was touched, less those before.

    Attributes:
        force: Force in the frame of the sensor, without sign, shape (3,), N.
        torque: Torque about the origin of the sensor, likewise, shape (3,), N·m.
        scan_m: Centre of pressure along the columns and rows of the scan, from its middle, m; None without an image.
    """

    force: Array
    torque: Array
    scan_m: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Symmetry:
    """Orientation of an image: the keys ``swap_xy``, ``flip_x`` and ``flip_y`` of a pad."""

    swap_xy: bool = False
    flip_x: bool = False
    flip_y: bool = False

    def place(self, scan_m: Sequence[float]) -> Array:
        """Return a place of the scan (along columns, along rows) in the pad frame, shape (2,), m."""
        x, y = reversed(scan_m) if self.swap_xy else scan_m
        return np.array((-x if self.flip_x else x, -y if self.flip_y else y))


SYMMETRIES = tuple(Symmetry(*flags) for flags in itertools.product((False, True), repeat=3))


@dataclass(frozen=True, slots=True)
class Mount:
    """Mounting of a force sensor: the keys ``sign`` and ``pad_from_sensor``."""

    sign: int
    xyz_m: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]

    @property
    def matrix(self) -> Array:
        """What turns a reading of the sensor (force, torque) into the wrench in the pad frame, shape (6, 6)."""
        return Mounting(self.xyz_m, self.quat_xyzw, self.sign).matrix


def mount_of(sensor: Wrench) -> Mount:
    """Return the mounting that a config states."""
    x, y, z = sensor.pad_from_sensor.xyz_m
    qx, qy, qz, qw = sensor.pad_from_sensor.quat_xyzw
    return Mount(sensor.sign, (x, y, z), (qx, qy, qz, qw))


@dataclass(slots=True)
class Findings:
    """What the touches show.

    Attributes:
        mount: Mounting of the force sensor; None where it does not follow.
        symmetry: Orientation of the image; None where it does not follow.
        notes: What was found, for people, with residuals.
        problems: What does not follow or contradicts, and what to do; a value is None because of one of them.
        doubtful: Touches that may be to blame for the problems, and are worth making again.
    """

    mount: Mount | None = None
    symmetry: Symmetry | None = None
    notes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    doubtful: tuple[str, ...] = ()

    def add_problem(self, text: str, *doubtful: str) -> None:
        """Add a problem, and the touches that may be to blame for it."""
        self.problems.append(text)
        self.doubtful += doubtful


def goes_to_end(travel: Array) -> bool:
    """Return whether a travel from the centre leads to the +X end."""
    return bool(travel[0] >= LEAST_TRAVEL_M and abs(travel[1]) < 0.5 * travel[0])


def goes_to_corner(travel: Array) -> bool:
    """Return whether a travel from the centre leads to the +X +Y corner."""
    return bool(travel[0] >= LEAST_TRAVEL_M and travel[1] >= min(LEAST_TRAVEL_M, 0.2 * travel[0]))


def scan_centroid(pad: Pad, image: Array) -> tuple[float, float] | None:
    """Return the centre of pressure along the columns and the rows of the scan, from its middle, m."""
    total = float(image.sum())
    if total <= 0.0:
        return None
    row, col = np.divmod(np.arange(image.size), pad.cols)
    along_cols = float(image @ (col - 0.5 * (pad.cols - 1))) * pad.pitch_m / total
    along_rows = float(image @ (row - 0.5 * (pad.rows - 1))) * pad.pitch_m / total
    return along_cols, along_rows
