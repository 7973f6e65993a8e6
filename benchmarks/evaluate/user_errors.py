"""Errors of the person who mounts and configures the sensors; the config knows nothing of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from evaluate.finger_sensing import FingerSensing, PadSensing


def pad_off(sensors: FingerSensing) -> FingerSensing:
    """The pad is 1 mm beside its place, along the diagonal."""
    return _with_pad(sensors, lambda pad: replace(pad, off_m=(0.7e-3, 0.7e-3)))


def pad_turned(sensors: FingerSensing) -> FingerSensing:
    """The pad is turned by 5°."""
    return _with_pad(sensors, lambda pad: replace(pad, turn_rad=math.radians(5.0)))


def pad_mirrored(sensors: FingerSensing) -> FingerSensing:
    """The pad is scanned against its x axis."""
    return _with_pad(sensors, lambda pad: replace(pad, mirrored=True))


def drift(sensors: FingerSensing) -> FingerSensing:
    """The zero of the force sensor drifts by 50 mN and 0.5 mN·m a second."""
    rates = (0.05, -0.03, 0.05, 5e-4, -5e-4, 3e-4)
    return replace(sensors, force=replace(sensors.force, drift_per_s=rates))


def sensor_turned(sensors: FingerSensing) -> FingerSensing:
    """The force sensor is turned by 5° about an axis in its plane."""
    return replace(sensors, force=replace(sensors.force, turn_rad=(math.radians(5.0), 0.0, 0.0)))


def _with_pad(sensors: FingerSensing, change: Callable[[PadSensing], PadSensing]) -> FingerSensing:
    return replace(sensors, pad=None if sensors.pad is None else change(sensors.pad))


ERRORS: dict[str, Callable[[FingerSensing], FingerSensing]] = {
    "pad 1 mm off": pad_off,
    "pad turned 5°": pad_turned,
    "pad mirrored": pad_mirrored,
    "sensor turned 5°": sensor_turned,
    "zero drifts": drift,
}
