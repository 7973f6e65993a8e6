"""Take the zero of the pads from the first rows of a trial, in which the fingers are still open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from slipd import config
from slipd.config.toml_edit import with_numbers
from slipd.errors import RecordingError
from slipd.types.arrays import Array

FEWEST_ROWS = 5
"""Fewest rows of a tare: fewer do not show whether the pad is at rest."""

REST = 0.5
"""The force on a pad at rest stays within this share of ``min_normal_n`` of its mean, so that the zero is known better
than what counts as a contact."""

DIGITS = 1
"""Decimals of a count in the config: the noise of the mean of 40 readings of some counts."""

Counts = NDArray[np.uint16]


def tared_config(config_text: str, file_name: str, pads: Mapping[str, list[Counts]], rows: int) -> str:
    """Return a config whose XELA pads have the mean of the first rows of a trial as their ``tare``.

    Args:
        config_text: The config, TOML; other values and comments stay.
        file_name: Its name, for errors.
        pads: Counts of each sensor, one array of shape (taxels, 3) per row of the trial.
        rows: Number of first rows without load.

    Raises:
        ConfigError: The config has faults.
        RecordingError: There are too few or too many rows, a pad is not at rest in them, it was pressed in them as it
            reads a clear pull later, or the config cannot hold the key ``tare``.
    """
    count = len(next(iter(pads.values())))
    if not FEWEST_ROWS <= rows <= count:
        raise RecordingError(f"tare-rows must be from {FEWEST_ROWS} to {count}, the rows of the trial, got {rows}")
    text = config_text
    for name, finger in config.parse(config_text, file_name).finger.items():
        if finger.pad is None or finger.pad.device != "xela":
            continue
        pad = finger.pad
        counts = np.array(pads[pad.sensor], dtype=np.float64)
        zero = counts[:rows].mean(axis=0)
        forces = (counts - zero).sum(axis=1) * np.array(pad.axis_scale)
        _check_rest(f"finger {name}, sensor {pad.sensor}", forces, rows, finger.min_normal_n)
        comment = f"Unloaded counts, x y z of each taxel: mean of the first {rows} rows of the trial."
        try:
            text = with_numbers(text, ("finger", name, "pad", "tare"), zero.ravel().round(DIGITS).tolist(), comment)
        except ValueError as error:
            raise RecordingError(f"{file_name}: {error}") from error
    config.parse(text, f"{file_name} with the tare of {rows} rows")
    return text


def _check_rest(pad: str, forces: Array, rows: int, min_normal: float) -> None:
    """Refuse rows in which a pad moves or is pressed.

    Args:
        pad: What to call it in an error.
        forces: Force on the pad above the zero, shape (rows of the trial, 3), in the unit of its ``axis_scale``.
        rows: Number of rows without load.
        min_normal: Least normal force of a contact, in the same unit.
    """
    away = np.linalg.norm(forces[:rows], axis=1)
    limit = REST * min_normal
    if away.max() > limit:
        raise RecordingError(
            f"{pad}: must be at rest in the first {rows} rows, within {limit:g} of their mean "
            f"({REST:g} · min_normal_n), got {away.max():.4g} in row {away.argmax() + 1}: give fewer rows"
        )
    pull = forces[:, 2]  # the force on the finger points into the pad, so a pull is positive
    if pull.max() > min_normal:
        raise RecordingError(
            f"{pad}: must be unloaded in the first {rows} rows, but reads a pull of {pull.max():.4g} in row "
            f"{pull.argmax() + 1}: it was pressed at first, or axis_scale has a wrong sign"
        )
