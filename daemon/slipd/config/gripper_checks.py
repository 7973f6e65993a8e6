"""Faults of ``[gripper]``, ``[grasp]`` and ``[reflex]``: limits, tables and places that do not fit each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from slipd.config.gripper_model import Grasp, Gripper
from slipd.config.model import Config
from slipd.config.stream_model import Table
from slipd.config.value_bounds import GRIP, MARGIN, PLACE, SPEED, WIDTH, Fault, table_fault
from slipd.devices import DEVICES, Device, GripRange

FACING = -0.98
"""Largest cosine of the angle between the pads of parallel jaws: they face each other within 11 degrees."""

MAX_UNITS = 255
"""The settings of a gripper in its own units are bytes."""


def gripper_faults(gripper: Gripper) -> list[Fault]:
    """Find limits and tables that the gripper cannot have."""
    device = DEVICES.get(gripper.device)
    if device is None or device.kind != "gripper":
        return []
    faults = _limits(gripper)
    tables = {"force_table": gripper.force_table, "width_table": gripper.width_table}
    for key, table in tables.items():
        if device.needs_tables and table is None:
            faults.append((f"gripper.{key}", f"is missing: it maps the device units of {gripper.device} to SI units"))
    for key, table in (tables | {"speed_table": gripper.speed_table}).items():
        if not device.needs_tables and table is not None:
            faults.append((f"gripper.{key}", f"must be left out: {gripper.device} takes SI units"))
    if gripper.force_table is not None and gripper.width_table is not None and device.needs_tables:
        faults += _tables(gripper, gripper.force_table, gripper.width_table)
    return faults or _reach(gripper, device)


def _reach(gripper: Gripper, device: Device) -> list[Fault]:
    """Find values beyond any gripper, or beyond the largest gripper of this device."""
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
            rule = f"must have {what} of at most {most:g} {unit}, the most of any {gripper.device}"
            faults.append((f"gripper.{key}", f"{rule}, got {value:g}"))
    return faults


def _stated(gripper: Gripper, grip: GripRange) -> Iterator[tuple[str, str, float, float, str]]:
    """Yield the abilities that the config states: key, quantity, value, maximum of the device, unit."""
    if gripper.max_force_n is not None:
        yield "max_force_n", "a force on one pad", gripper.max_force_n, grip.force_n, "N"
    if gripper.force_table is not None:
        yield "force_table", "a largest force on one pad", gripper.force_table[-1][1], grip.force_n, "N"
    if gripper.width_table is not None:
        widths = [width for _, width in gripper.width_table]
        yield "width_table", "a stroke", max(widths) - min(widths), grip.stroke_m, "m"
    if gripper.speed_table is not None:
        yield "speed_table", "a largest speed", gripper.speed_table[-1][1], grip.speed_mps, "m/s"


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
        faults.append(
            (
                "gripper.force_table",
                f"device units must rise within 0…{MAX_UNITS}, and newtons must rise from 0 or more",
            )
        )
    if not (_rising(closures) and _rising(widths[::-1]) and closures[0] >= 0.0 and closures[-1] <= 1.0):
        faults.append(("gripper.width_table", "closure must rise within 0…1 while the width falls"))
    if gripper.speed_table is not None and not _settings_rise(gripper.speed_table):
        faults.append(
            ("gripper.speed_table", f"device units must rise within 0…{MAX_UNITS}, and m/s must rise from 0 or more")
        )
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
    """Find pads that belong to no finger, or whose pose is impossible."""
    if config.grasp is None:
        return []
    faults = []
    for name, place in config.grasp.pads.items():
        path = f"grasp.pads.{name}"
        if name not in config.finger:
            faults.append((path, f"must be the name of a finger, got {name!r}; known: {', '.join(config.finger)}"))
        if not _rising(tuple(row[0] for row in place.positions)):
            faults.append(
                (f"{path}.positions", "the width, which is the first value of each row, must rise from row to row")
            )
        if fault := table_fault(place.positions, WIDTH, PLACE, PLACE, PLACE):
            faults.append((f"{path}.positions", fault))
    return faults or _facing(config.grasp)


def _facing(config: Grasp) -> list[Fault]:
    """Find pads that do not face each other; their grip forces would look like an external push."""
    first, second = (_outward(place.quat_xyzw) for place in config.pads.values())
    if sum(a * b for a, b in zip(first, second, strict=True)) <= FACING:
        return []
    one, other = config.pads
    rule = f"must turn the Z axis of the pad towards that of {one}, because the pads face each other: is it x, y, z, w?"
    return [(f"grasp.pads.{other}.quat_xyzw", rule)]


def _outward(quat_xyzw: list[float]) -> tuple[float, float, float]:
    """Return the Z axis of a pad in the gripper frame."""
    x, y, z, w = (part / math.hypot(*quat_xyzw) for part in quat_xyzw)
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def reflex_faults(config: Config) -> list[Fault]:
    """Find a reflex that could not act, or that could exceed the limit of the gripper."""
    reflex, gripper = config.reflex, config.gripper
    if not reflex.enabled:
        return []
    if gripper is None or gripper.max_force_n is None:
        return [("reflex.enabled", "needs [gripper] with max_force_n: nothing is moved without a limit")]
    if config.grasp is None:
        return [("reflex.enabled", "needs [grasp], from which the necessary grip force is computed")]
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
