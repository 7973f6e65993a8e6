"""Places of the pads in the gripper's frame, from the config of the rig: what ``/tf`` needs and no message carries."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

PARENT = "gripper"


class PadFrames:
    """Frame of each pad at each width.

    Args:
        pads: The tables ``[grasp.pads.FINGER]`` of a config: ``positions``, rows of (width, x, y, z) in m with rising
            width, and ``quat_xyzw``.

    Raises:
        KeyError, TypeError, ValueError: They are no such tables.
    """

    def __init__(self, pads: Mapping[str, Mapping[str, Any]]) -> None:
        self._pads = {
            finger: ([tuple(map(float, row)) for row in pad["positions"]], _unit(tuple(map(float, pad["quat_xyzw"]))))
            for finger, pad in pads.items()
        }

    @property
    def orientations(self) -> dict[str, tuple[float, ...]]:
        """Orientation of each pad in the gripper's frame, unit quaternion x, y, z, w."""
        return {finger: quaternion for finger, (_, quaternion) in self._pads.items()}

    def transforms(self, header: Mapping[str, Any], width_m: float | None) -> list[dict[str, Any]]:
        """Return a ``geometry_msgs/TransformStamped`` for each pad whose position at this width is known."""
        found = []
        for finger, (rows, quaternion) in self._pads.items():
            position = None if width_m is None else _at(rows, width_m)
            if position is not None:
                found.append(
                    {
                        "header": {**header, "frame_id": PARENT},
                        "child_frame_id": f"{finger}_pad",
                        "transform": {
                            "translation": dict(zip("xyz", position, strict=True)),
                            "rotation": dict(zip("xyzw", quaternion, strict=True)),
                        },
                    }
                )
        return found


def _at(rows: list[tuple[float, ...]], width_m: float) -> list[float] | None:
    """Return the position at a width, linear between rows; None outside of them."""
    for (low, *below), (high, *above) in pairwise(rows):
        if low <= width_m <= high:
            share = (width_m - low) / (high - low)
            return [one + share * (other - one) for one, other in zip(below, above, strict=True)]
    return None


def _unit(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*quaternion)
    return tuple(each / norm for each in quaternion)
