"""Made-up gripper trials with two XELA pads, in the files that ``slipd import grips`` reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

ZERO = np.tile([16000.0, 16500.0, 37000.0], 16)
"""Counts of the unloaded pad, x y z of each taxel."""

NOISE, RATE_HZ = 3.0, 40.0
"""Standard deviation of each count; rows a second."""


def write_trial(folder: Path, normal: ArrayLike, pull: ArrayLike) -> None:
    """Write one trial; both pads carry the same.

    Args:
        folder: New folder.
        normal: Normal load of a pad in each row, counts; all taxels carry the same.
        pull: Tangential load of a pad along y in each row, counts.
    """
    folder.mkdir()
    load = np.stack([np.zeros_like(normal, dtype=float), np.asarray(pull, float), np.asarray(normal, float)], axis=1)
    random = np.random.default_rng(1)
    header = ",".join(f"txl{taxel}_{axis}" for taxel in range(1, 17) for axis in "xyz")
    for sensor in "12":
        counts = (ZERO + np.tile(load / 16, 16) + NOISE * random.standard_normal((len(load), 48))).round()
        rows = "\n".join(",".join(f"{count:.1f}" for count in row) for row in counts)
        (folder / f"xela_sensor{sensor}.csv").write_text(f"{header}\n{rows}\n")
    times = "\n".join(f"{row / RATE_HZ:.6f}" for row in range(len(load)))
    (folder / "robot_state.csv").write_text(f"time\n{times}\n")
