"""Hints of `slipd check` about a valid config that may not be what its author meant."""

from __future__ import annotations

from collections.abc import Iterator

from slipd.config.checks import axes_of
from slipd.config.model import Config, Finger

#: In the order w, x, y, z this is no rotation; in the order x, y, z, w it turns the sensor upside down.
W_FIRST = ([1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0])


def hints(config: Config) -> Iterator[str]:
    """Yield the keys that are missing or look wrong, and the consequence."""
    for name, finger in config.finger.items():
        yield from _of_finger(f"finger.{name}", finger)
    if config.gripper is not None and config.gripper.max_force_n is None:
        yield "gripper: no max_force_n: nothing will be moved"


def _of_finger(path: str, finger: Finger) -> Iterator[str]:
    if finger.mu is None:
        yield f'{path}: no mu: its level will be "unknown"'
    if finger.pad is None:
        yield f'{path}: no pad: rotation is not observed, its level will never be "stable"'
    elif finger.wrench is None and axes_of(finger.pad) == 3 and not finger.pad.tare:
        yield f'{path}.pad: no tare: unless it reads about zero unloaded, it is "unknown" until `slipctl tare take`'
    if finger.wrench is not None and finger.wrench.pad_from_sensor.quat_xyzw in W_FIRST:
        turned = "turns the sensor by 180 degrees about X, but in the order w, x, y, z it would be the identity"
        yield f"{path}.wrench.pad_from_sensor: quat_xyzw {turned}: is its order x, y, z, w?"
