"""Faults of ``[finger.X]``: values of a finger and its pad that do not fit each other."""

from __future__ import annotations

from slipd.config.finger_model import Finger, Pad, Wrench
from slipd.config.stream_checks import stream_faults
from slipd.config.stream_settings import axes_of
from slipd.config.value_bounds import LONGEST_PAD_M, MOST_MIN_NORMAL_N, Fault
from slipd.devices import DEVICES


def finger_faults(path: str, finger: Finger) -> list[Fault]:
    """Find the faults of a finger and its streams.

    Args:
        path: Key path of the finger.
        finger: The finger.
    """
    if finger.wrench is None and finger.pad is None:
        return [(path, "must have [wrench], [pad] or both, got neither")]
    faults = []
    if finger.mu_max is not None and finger.mu is not None and finger.mu_max < finger.mu:
        faults.append((f"{path}.mu_max", f"must be at least mu, {finger.mu:g}, got {finger.mu_max:g}"))
    if finger.wrench is not None:
        faults += stream_faults(f"{path}.wrench", finger.wrench, "wrench")
        faults += _threshold_faults(path, finger, finger.wrench)
    pad = finger.pad
    if pad is None:
        return faults
    device_faults = stream_faults(f"{path}.pad", pad, "tactile")
    if device_faults:
        return faults + device_faults
    faults += _pad_faults(f"{path}.pad", pad)
    if axes_of(pad) == 1 and finger.wrench is None:
        faults.append((f"{path}.wrench", f"is missing: {pad.device} measures no shear, so a force sensor is needed"))
    return faults


def _threshold_faults(path: str, finger: Finger, wrench: Wrench) -> list[Fault]:
    """Find a contact threshold that the force sensor never reaches, or that would hide a grip."""
    least_n = finger.min_normal_n
    if least_n > MOST_MIN_NORMAL_N:
        return [(f"{path}.min_normal_n", f"must be at most {MOST_MIN_NORMAL_N:g} N, got {least_n:g}")]
    if wrench.range_n is not None and least_n >= wrench.range_n:
        return [(f"{path}.min_normal_n", f"must be below wrench.range_n, {wrench.range_n:g} N, got {least_n:g}")]
    return []


def _pad_faults(path: str, pad: Pad) -> list[Fault]:
    faults = _scale_faults(f"{path}.axis_scale", pad)
    axes, taxels = axes_of(pad), DEVICES[pad.device].taxels
    if taxels not in (None, pad.rows * pad.cols):
        rule = f"rows x cols must be {taxels}, the taxels of one {pad.device} sensor, got {pad.rows} x {pad.cols}"
        faults.append((f"{path}.rows", rule))
    if axes == 3 and pad.charge_tau_s is not None:
        faults.append((f"{path}.charge_tau_s", f"must be left out: {pad.device} measures force, not charge"))
    if pad.tare and len(pad.tare) != axes * pad.rows * pad.cols:
        faults.append((f"{path}.tare", f"must have {axes * pad.rows * pad.cols} values, got {len(pad.tare)}"))
    return faults + _size_faults(path, pad)


def _scale_faults(path: str, pad: Pad) -> list[Fault]:
    axes, scales = axes_of(pad), len(pad.axis_scale)
    if axes not in (1, 3):
        return [(path, f"must have 1 value for taxels that measure pressure, 3 if they measure shear too, got {axes}")]
    if 0.0 in pad.axis_scale:
        return [(path, "must not contain 0, which discards an axis: give newtons per count, or 1")]
    if scales != axes:
        return [(path, f"must have {axes} value(s), one for each axis of a {pad.device} taxel, got {scales}")]
    return []


def _size_faults(path: str, pad: Pad) -> list[Fault]:
    """Find taxels that overlap, and a pad that fits no gripper."""
    if pad.electrode_m > pad.pitch_m:
        return [(f"{path}.electrode_m", f"must be at most pitch_m, {pad.pitch_m:g} m, got {pad.electrode_m:g}")]
    longest_m = max(pad.rows, pad.cols) * pad.pitch_m
    if longest_m <= LONGEST_PAD_M:
        return []
    rule = f"the pad must be at most {LONGEST_PAD_M:g} m long, got {longest_m:g} m"
    return [(f"{path}.pitch_m", f"{rule} ({pad.rows} x {pad.cols} taxels, {pad.pitch_m:g} m apart)")]
