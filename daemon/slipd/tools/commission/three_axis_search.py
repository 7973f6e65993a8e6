"""Find the orientation of a pad whose taxels measure three axes, without a force sensor. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from slipd.tools.commission.touches import (
    CENTRE,
    CORNER,
    END,
    PUSH_X,
    PUSH_Y,
    PUSHES,
    STEPS,
    SYMMETRIES,
    Findings,
    Touch,
    goes_to_corner,
    goes_to_end,
)


def find_three_axis(touches: Mapping[str, Touch]) -> tuple[Findings, tuple[int, int, int] | None]:
    """Find the orientation of a pad whose taxels measure three axes, and the signs of its axes.

    Args:
        touches: By step; the force is the sum of the readings of the taxels, unsigned and in the order of the scan.

    Returns:
        The findings, and the signs of ``axis_scale`` in the order X, Y, Z of the pad; None where they do not follow.
    """
    found = Findings()
    places = {step: np.array(touch.scan_m) for step, touch in touches.items() if touch.scan_m is not None}
    missing = [step for step in STEPS if step not in places or not touches[step].force.any()]
    if missing:
        found.add_problem(f"the pad showed nothing at: {', '.join(missing)}", *missing)
        return found, None
    end, corner = ((places[step] - places[CENTRE]).tolist() for step in (END, CORNER))
    fits = [one for one in SYMMETRIES if goes_to_end(one.place(end)) and goes_to_corner(one.place(corner))]
    if len(fits) != 1:
        found.add_problem(
            "the presses do not show the orientation of the image: press the middle of the +X end, and the +X +Y "
            "corner",
            END,
            CORNER,
        )
        return found, None
    found.symmetry = fits[0]
    order = [1, 0, 2] if fits[0].swap_xy else [0, 1, 2]
    push_x, push_y, press = (touches[step].force[order] for step in (PUSH_X, PUSH_Y, CENTRE))
    share = push_x[2] / press[2], push_y[2] / press[2]
    push_x, push_y = push_x - share[0] * press, push_y - share[1] * press
    if abs(push_x[0]) < 2.0 * abs(push_x[1]) or abs(push_y[1]) < 2.0 * abs(push_y[0]):
        text = "the pushes do not fit the presses: push along +X and along +Y, as the taxels lie"
        found.add_problem(text, *PUSHES)
        return found, None
    signs = (int(math.copysign(1, push_x[0])), int(math.copysign(1, push_y[1])), -int(math.copysign(1, press[2])))
    axes = [axis if sign > 0 else f"-{axis}" for axis, sign in zip("XYZ", signs, strict=True)]
    found.notes.append(f"axes of the taxels: {', '.join(axes)}")
    return found, signs
