"""What a person's touches read and show, and the orientation of a pad whose taxels measure three axes. Pure."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import center_of_mass

from slipd.config import Pad, Wrench
from slipd.signals.mounting import mounting_matrix
from slipd.types.arrays import Array

CENTRE, END, CORNER, PUSH_X, PUSH_Y = "centre", "end", "corner", "push_x", "push_y"
STEPS = (CENTRE, PUSH_X, PUSH_Y, END, CORNER)
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
    PUSH_X: "Press the centre of the {finger} pad again, and push along +X (towards the fingertip) without sliding.",
    PUSH_Y: "Press the centre of the {finger} pad again, and push along +Y without sliding.",
    END: "Press the middle of the +X end of the {finger} pad (the end towards the fingertip).",
    CORNER: "Press the corner of the {finger} pad at +X and +Y.",
}
"""What the guide asks a person to do for each touch, in the order in which it asks.

All at the centre come first: a charge pad keeps some of a touch for seconds where the machine is busy, which moves the
image of the next, and the pushes are a short lever for the depth of the sensor.
"""

LEAST_TRAVEL_M = 0.003
"""Presses must be this far apart to show the orientation of the image, m."""


LEAST_FORCE_N = 1e-3
"""A smaller force shows no direction, N."""


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

    @property
    def felt(self) -> bool:
        """Whether the force shows a direction."""
        return bool(np.linalg.norm(self.force) >= LEAST_FORCE_N)


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
        return mounting_matrix(self.xyz_m, self.quat_xyzw, self.sign)


def mount_of(sensor: Wrench) -> Mount:
    """Return the mounting that a config states."""
    x, y, z = sensor.pad_from_sensor.xyz_m
    qx, qy, qz, qw = sensor.pad_from_sensor.quat_xyzw
    return Mount(sensor.sign, (x, y, z), (qx, qy, qz, qw))


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise at rest.

    Attributes:
        force_std_n: Standard deviation of the noisiest force component, N.
        torque_std_nm: The same of the torque about the origin of the pad, N·m.
        threshold: Threshold of a taxel that follows from the images, in their unit; None where they show no noise.
    """

    force_std_n: float
    torque_std_nm: float
    threshold: float | None


class Doubt(Exception):  # noqa: N818 - it names what there is
    """What is looked for does not follow. Arguments: why and what to do, then the touches that may be to blame."""


@dataclass(slots=True)
class Findings:
    """What the touches of one finger show.

    Attributes:
        mount: Mounting of the force sensor; None where it does not follow.
        symmetry: Orientation of the image; None where it does not follow.
        axes: Signs of the axes of the taxels, likewise; X, Y, Z of the pad.
        streams: By "wrench" and "pad": name of the finger whose tables the sensors of this finger are in now.
        noise: Noise of its sensors at rest; None where it is not known.
        touches: By step, in the frame of the sensor: they hold whatever the config states.
        wrong_scale: The forces cannot be newtons, so nothing was found.
        notes: What was found, for people, with residuals.
        problems: What does not follow or contradicts, and what to do; a value is None because of one of them.
        doubtful: Touches that may be to blame for the problems, and are worth making again.
    """

    mount: Mount | None = None
    symmetry: Symmetry | None = None
    axes: tuple[int, int, int] | None = None
    streams: Mapping[str, str] = field(default_factory=dict)
    noise: Noise | None = None
    touches: Mapping[str, Touch] = field(default_factory=dict)
    wrong_scale: bool = False
    notes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    doubtful: tuple[str, ...] = ()

    @contextlib.contextmanager
    def searching(self) -> Iterator[None]:
        """Add a doubt that ends the search as a problem."""
        try:
            yield
        except Doubt as doubt:
            self.add_problem(*doubt.args)

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
    if image.sum() <= 0.0:
        return None
    row, col = center_of_mass(image.reshape(pad.rows, pad.cols))
    return (col - 0.5 * (pad.cols - 1)) * pad.pitch_m, (row - 0.5 * (pad.rows - 1)) * pad.pitch_m


def find_three_axis(touches: Mapping[str, Touch]) -> Findings:
    """Find the orientation of a pad whose taxels measure three axes, and the signs of its axes.

    Args:
        touches: By step; the force is the sum of the readings of the taxels, unsigned and in the order of the scan.
    """
    found = Findings()
    with found.searching():
        places = {step: np.array(touch.scan_m) for step, touch in touches.items() if touch.scan_m is not None}
        if missing := [step for step in STEPS if step not in places or not touches[step].felt]:
            raise Doubt(f"the pad showed nothing at: {', '.join(missing)}", *missing)
        end, corner = ((places[step] - places[CENTRE]).tolist() for step in (END, CORNER))
        fits = [one for one in SYMMETRIES if goes_to_end(one.place(end)) and goes_to_corner(one.place(corner))]
        if len(fits) != 1:
            raise Doubt(
                "the presses do not show the orientation of the image: press the middle of the +X end, and the +X +Y "
                "corner",
                END,
                CORNER,
            )
        found.symmetry = fits[0]
        found.axes = _axes(touches, fits[0])
        axes = [axis if sign > 0 else f"-{axis}" for axis, sign in zip("XYZ", found.axes, strict=True)]
        found.notes.append(f"axes of the taxels: {', '.join(axes)}")
    return found


def _axes(touches: Mapping[str, Touch], symmetry: Symmetry) -> tuple[int, int, int]:
    """Return the signs of the axes of the taxels, in the order X, Y, Z of the pad."""
    order = [1, 0, 2] if symmetry.swap_xy else [0, 1, 2]
    push_x, push_y, press = (touches[step].force[order] for step in (PUSH_X, PUSH_Y, CENTRE))
    if abs(press[2]) < 0.5 * np.linalg.norm(press):
        raise Doubt("the press at the centre was not at right angles to the pad", CENTRE)
    share = push_x[2] / press[2], push_y[2] / press[2]
    push_x, push_y = push_x - share[0] * press, push_y - share[1] * press
    if abs(push_x[0]) < 2.0 * abs(push_x[1]) or abs(push_y[1]) < 2.0 * abs(push_y[0]):
        raise Doubt("the pushes do not fit the presses: push along +X and along +Y, as the taxels lie", *PUSHES)
    return int(math.copysign(1, push_x[0])), int(math.copysign(1, push_y[1])), -int(math.copysign(1, press[2]))
