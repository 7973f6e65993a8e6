"""Hints of `slipd check` on a valid config that its author may not have meant."""

from __future__ import annotations

from collections.abc import Iterator

from slipd.config.finger_model import Finger
from slipd.config.model import Config
from slipd.config.stream_settings import axes_of

W_FIRST = ([1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0])
"""In the order w, x, y, z this is no rotation; in the order x, y, z, w it turns the sensor upside down."""


def hints(config: Config) -> Iterator[str]:
    """Yield keys that are missing or look wrong, and the consequence."""
    for name, finger in config.finger.items():
        yield from _finger_hints(f"finger.{name}", finger)
    if config.gripper is not None and config.gripper.max_force_n is None:
        yield "gripper: no max_force_n: no request can move the gripper"


def _finger_hints(path: str, finger: Finger) -> Iterator[str]:
    if finger.mu is None:
        yield f"{path}: no mu: it warns of nothing before a slip has shown the friction"
    if finger.slip.armed_at is not None:
        yield f"{path}.slip: armed_at has no effect any more: a slip is told by the course of the load. Remove it"
    if finger.pad is None:
        yield f'{path}: no pad: rotation is not observed, so its level is never "stable"'
    elif finger.wrench is None and axes_of(finger.pad) == 3 and not finger.pad.tare:
        yield f"{path}.pad: no tare: if it does not read about zero unloaded, run `slipctl tare take`"
    if finger.wrench is not None and finger.wrench.pad_from_sensor.quat_xyzw in W_FIRST:
        turned = "turns the sensor by 180 degrees about X; in the order w, x, y, z it would be the identity"
        yield f"{path}.wrench.pad_from_sensor: quat_xyzw {turned}: is its order x, y, z, w?"
