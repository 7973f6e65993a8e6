"""Compiles every kernel before the first reading needs it."""

from __future__ import annotations

import numpy as np

from slipd.fusion import (
    SlipDetector,
    SlipSettings,
    contact_shape,
    grip_needed_n,
    matched_loads,
    tipping_margin,
    torque_limit,
    utilisation,
)


def warm_up() -> None:
    """Calls each kernel once with arrays of the kinds that a run has; from a warm cache this takes some 10 ms."""
    x, y = np.array((0.0, 0.01, 0.0, 0.01)), np.array((0.0, 0.0, 0.01, 0.01))
    centre, force = np.array((0.005, 0.005)), np.array((0.1, 0.0))
    loads = matched_loads(x, y, np.ones(4), 1.0, centre).loads
    torque_limit(x, y, loads, 0.5, force, centre)
    utilisation(x, y, loads, 0.5, force, 0.001, centre)
    grip_needed_n(x, y, loads, 0.5, force, 0.001, centre, growth=0.3)
    tipping_margin(x, y, centre)
    contact_shape(x.reshape(2, 2), y.reshape(2, 2), np.ones((2, 2)), 0.01)
    SlipDetector(SlipSettings()).update(0.0, 0.1, 1.0, 0.5)
