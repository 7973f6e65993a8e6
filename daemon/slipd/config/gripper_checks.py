"""Faults of ``[gripper]``, ``[grasp]`` and ``[reflex]``: limits, tables and places that do not fit each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from slipd.config.bounds import GRIP, MARGIN, PLACE, SPEED, WIDTH, table_fault
from slipd.config.model import Config, Grasp, Gripper, Table
from slipd.devices import DEVICES, Device, GripRange

Fault = tuple[str, str]
#: Cosine of the angle between the pads of parallel jaws: they face each other within 11 degrees.
FACING = -0.98
#: A gripper's own settings are bytes.
MAX_UNITS = 255


def gripper_faults(gripper: Gripper) -> list[Fault]:
    """Find limits and tables that the gripper cannot have."""
    device = DEVICES.get(gripper.device)
    if device is None or device.kind != "gripper":
        return []
    faults = _limits(gripper)
    tables = {"force_table": gripper.force_table, "width_table": gripper.width_table}
    for key, table in tables.items():
        if device.tabled and table is None:
            faults.append((f"gripper.{key}", f"is missing: it maps the device units of {gripper.device} to SI units"))
    for key, table in (tables | {"speed_table": gripper.speed_table}).items():
        if not device.tabled and table is not None:
            faults.append((f"gripper.{key}", f"must be left out: {gripper.device} takes SI units"))
    if gripper.force_table is not None and gripper.width_table is not None and device.tabled:
        faults += _tables(gripper, gripper.force_table, gripper.width_table)
    return faults or _reach(gripper, device)


def _reach(gripper: Gripper, device: Device) -> list[Fault]:
    """Find what is beyond every gripper, or beyond the largest one of this device."""
    faults = [
        (f"gripper.{key}", fault)
        for key, table, bounds in (
            ("force_table", gripper.force_table, GRIP),
            ("width_table", gripper.width_table, WIDTH),
            ("speed_table", gripper.speed_table, SPEED),
        )
        if table is not None and (fault := table_fault(table, None, bounds))
    ]
    if faults or device.grip is None:
        return faults
    for key, what, value, most, unit in _stated(gripper, device.grip):
        if value > most * MARGIN:
            rule = f"must state {what} of at most {most:g} {unit}, the most of any {gripper.device}"
            faults.append((f"gripper.{key}", f"{rule}, got {value:g}"))
    return faults


def _stated(gripper: Gripper, grip: GripRange) -> Iterator[tuple[str, str, float, float, str]]:
    """Yield what the config says the gripper can do: key, quantity, value, the device's maximum, unit."""
    if gripper.max_force_n is not None:
        yield "max_force_n", "a force on one pad", gripper.max_force_n, grip.force_n, "N"
    if gripper.force_table is not None:
        yield "force_table", "forces on one pad", gripper.force_table[-1][1], grip.force_n, "N"
    if gripper.width_table is not None:
        widths = [width for _, width in gripper.width_table]
        yield "width_table", "a stroke", max(widths) - min(widths), grip.stroke_m, "m"
    if gripper.speed_table is not None:
        yield "speed_table", "speeds", gripper.speed_table[-1][1], grip.speed_mps, "m/s"


def _limits(gripper: Gripper) -> list[Fault]:
    low = gripper.min_force_n
    if gripper.max_force_n is not None and low is not None and low >= gripper.max_force_n:
        return [("gripper.max_force_n", f"must be above min_force_n, {low:g} N, got {gripper.max_force_n:g}")]
    return []


def _tables(gripper: Gripper, force_table: Table, width_table: Table) -> list[Fault]:
    faults = []
    _, forces = zip(*force_table, strict=True)
    closures, widths = zip(*width_table, strict=True)
    if not _settings_rise(force_table):
        faults.append(("gripper.force_table", f"device units must rise within 0…{MAX_UNITS}, newtons from 0 or more"))
    if not (_rising(closures) and _rising(widths[::-1]) and closures[0] >= 0.0 and closures[-1] <= 1.0):
        faults.append(("gripper.width_table", "closure must rise within 0…1 while the width falls"))
    if gripper.speed_table is not None and not _settings_rise(gripper.speed_table):
        faults.append(("gripper.speed_table", f"device units must rise within 0…{MAX_UNITS}, m/s from 0 or more"))
    if gripper.max_force_n is None:
        return faults
    if gripper.max_force_n > forces[-1]:
        faults.append(
            (
                "gripper.max_force_n",
                f"must be at most the largest force of force_table, {forces[-1]:g} N, got {gripper.max_force_n:g}",
            )
        )
    if gripper.min_force_n is not None and gripper.min_force_n < forces[0]:
        faults.append(
            (
                "gripper.min_force_n",
                f"must be at least the smallest force of force_table, {forces[0]:g} N, got {gripper.min_force_n:g}",
            )
        )
    if gripper.min_force_n is None and forces[0] >= gripper.max_force_n:
        faults.append(
            (
                "gripper.max_force_n",
                f"must be above the least force of force_table, {forces[0]:g} N, got {gripper.max_force_n:g}",
            )
        )
    return faults


def grasp_faults(config: Config) -> list[Fault]:
    """Find pads that belong to no known finger, or that cannot be placed."""
    if config.grasp is None:
        return []
    faults = []
    for name, place in config.grasp.pads.items():
        path = f"grasp.pads.{name}"
        if name not in config.finger:
            faults.append((path, f"there is no finger {name!r}; known: {', '.join(config.finger)}"))
        if not _rising(tuple(row[0] for row in place.positions)):
            faults.append((f"{path}.positions", "the width, the first value of each row, must rise from row to row"))
        if fault := table_fault(place.positions, WIDTH, PLACE, PLACE, PLACE):
            faults.append((f"{path}.positions", fault))
    return faults or _facing(config.grasp)


def _facing(config: Grasp) -> list[Fault]:
    """Find pads that do not face each other: grip forces would look like an external push."""
    first, second = (_outward(place.quat_xyzw) for place in config.pads.values())
    if sum(a * b for a, b in zip(first, second, strict=True)) <= FACING:
        return []
    one, other = config.pads
    rule = f"must turn the pad's Z axis against that of {one} (they face each other): is its order x, y, z, w?"
    return [(f"grasp.pads.{other}.quat_xyzw", rule)]


def _outward(quat_xyzw: list[float]) -> tuple[float, float, float]:
    """Z axis of a pad in the gripper frame."""
    x, y, z, w = (part / math.hypot(*quat_xyzw) for part in quat_xyzw)
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def reflex_faults(config: Config) -> list[Fault]:
    """Find a reflex that could not act, or that may ask for more than the gripper's limit."""
    reflex, gripper = config.reflex, config.gripper
    if not reflex.enabled:
        return []
    if gripper is None or gripper.max_force_n is None:
        return [("reflex.enabled", "needs [gripper] with max_force_n: without a limit nothing is moved")]
    if config.grasp is None:
        return [("reflex.enabled", "needs [grasp], from which the grip that the object needs is computed")]
    if reflex.ceiling_n is not None and reflex.ceiling_n > gripper.max_force_n:
        return [
            (
                "reflex.ceiling_n",
                f"must be at most gripper.max_force_n, {gripper.max_force_n:g} N, got {reflex.ceiling_n:g}",
            )
        ]
    return []


def _settings_rise(table: list[tuple[float, float]]) -> bool:
    units, values = zip(*table, strict=True)
    return _rising(units) and _rising(values) and units[0] >= 0.0 and units[-1] <= MAX_UNITS and values[0] >= 0.0


def _rising(values: tuple[float, ...]) -> bool:
    return all(a < b for a, b in itertools.pairwise(values))
