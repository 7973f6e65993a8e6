"""Faults of ``[gripper]``, ``[grasp]`` and ``[reflex]``: limits, tables and places that do not fit each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

from slipd.config.gripper_tables import Grasp, Gripper
from slipd.config.model import Config
from slipd.config.stream_tables import Table
from slipd.config.value_bounds import GRIP, MARGIN, PLACE, SPEED, WIDTH, Fault, table_fault
from slipd.devices import DEVICES, GripRange

FACING = -0.98
"""Largest cosine of the angle between the pads of parallel jaws: they face each other within 11 degrees."""

MAX_UNITS = 255
"""The settings of a gripper in its own units are bytes."""


def gripper_faults(gripper: Gripper) -> Iterator[Fault]:
    """Yield limits and tables that the gripper cannot have."""
    device = DEVICES.get(gripper.device)
    if device is None or device.kind != "gripper":
        return
    faults = [*_limit_faults(gripper), *_table_faults(gripper, needs_tables=device.needs_tables)]
    faults = faults or list(_bounds_faults(gripper))
    if not faults and device.grip is not None:
        faults += _reach_faults(gripper, device.grip)
    yield from faults


def _limit_faults(gripper: Gripper) -> Iterator[Fault]:
    most, low, table = gripper.max_force_n, gripper.min_force_n, gripper.force_table
    if most is None:
        return
    if low is not None and low >= most:
        yield "gripper.max_force_n", f"must be above min_force_n, {low:g} N, got {most:g}"
    if table is None:
        return
    least_n, largest_n = table[0][1], table[-1][1]
    if most > largest_n:
        yield "gripper.max_force_n", f"must be at most the largest force of force_table, {largest_n:g} N, got {most:g}"
    if low is not None and low < least_n:
        yield "gripper.min_force_n", f"must be at least the smallest force of force_table, {least_n:g} N, got {low:g}"
    if low is None and least_n >= most:
        yield "gripper.max_force_n", f"must be above the least force of force_table, {least_n:g} N, got {most:g}"


def _table_faults(gripper: Gripper, *, needs_tables: bool) -> Iterator[Fault]:
    """Find tables that are missing, superfluous, or do not rise."""
    tables = {key: getattr(gripper, key) for key in ("force_table", "width_table", "speed_table")}
    for key, table in tables.items():
        if needs_tables and table is None and key != "speed_table":
            yield f"gripper.{key}", f"is missing: it maps the device units of {gripper.device} to SI units"
        elif not needs_tables and table is not None:
            yield f"gripper.{key}", f"must be left out: {gripper.device} takes SI units"
    if not needs_tables or gripper.force_table is None or gripper.width_table is None:
        return
    for key, unit in (("force_table", "newtons"), ("speed_table", "m/s")):
        if tables[key] is not None and not _settings_rise(tables[key]):
            rule = f"device units must rise within 0…{MAX_UNITS}, and {unit} must rise from 0 or more"
            yield f"gripper.{key}", rule
    closures, widths = zip(*gripper.width_table, strict=True)
    if not (_rising(closures) and _rising(widths[::-1]) and closures[0] >= 0.0 and closures[-1] <= 1.0):
        yield "gripper.width_table", "closure must rise within 0…1 while the width falls"


def _bounds_faults(gripper: Gripper) -> Iterator[Fault]:
    """Find values beyond any gripper."""
    for key, bounds in (("force_table", GRIP), ("width_table", WIDTH), ("speed_table", SPEED)):
        if fault := table_fault(getattr(gripper, key) or (), None, bounds):
            yield f"gripper.{key}", fault


def _reach_faults(gripper: Gripper, grip: GripRange) -> Iterator[Fault]:
    """Find abilities beyond the largest gripper of this device."""
    widths = [width for _, width in gripper.width_table or ()]
    for key, what, value, most, unit in (
        ("max_force_n", "a force on one pad", gripper.max_force_n, grip.force_n, "N"),
        ("force_table", "a largest force on one pad", _last(gripper.force_table), grip.force_n, "N"),
        ("width_table", "a stroke", max(widths) - min(widths) if widths else None, grip.stroke_m, "m"),
        ("speed_table", "a largest speed", _last(gripper.speed_table), grip.speed_mps, "m/s"),
    ):
        if value is not None and value > most * MARGIN:
            rule = f"must have {what} of at most {most:g} {unit}, the most of any {gripper.device}"
            yield f"gripper.{key}", f"{rule}, got {value:g}"


def _last(table: Table | None) -> float | None:
    return table[-1][1] if table else None


def grasp_faults(config: Config) -> Iterator[Fault]:
    """Yield pads that belong to no finger, or whose pose is impossible."""
    if config.grasp is None:
        return
    faults: list[Fault] = []
    for name, place in config.grasp.pads.items():
        path = f"grasp.pads.{name}"
        if name not in config.finger:
            faults.append((path, f"must be the name of a finger, got {name!r}; known: {', '.join(config.finger)}"))
        if not _rising([row[0] for row in place.positions]):
            rule = "the width, which is the first value of each row, must rise from row to row"
            faults.append((f"{path}.positions", rule))
        if fault := table_fault(place.positions, WIDTH, PLACE, PLACE, PLACE):
            faults.append((f"{path}.positions", fault))
    yield from faults or _facing(config.grasp)


def _facing(config: Grasp) -> Iterator[Fault]:
    """Find pads that do not face each other; their grip forces would look like an external push."""
    first, second = (_outward(place.quat_xyzw) for place in config.pads.values())
    if sum(a * b for a, b in zip(first, second, strict=True)) > FACING:
        one, other = config.pads
        rule = f"must turn the Z axis of the pad towards that of {one}, because the pads face each other"
        yield f"grasp.pads.{other}.quat_xyzw", f"{rule}: is it x, y, z, w?"


def _outward(quat_xyzw: list[float]) -> tuple[float, float, float]:
    """Return the Z axis of a pad in the gripper frame."""
    x, y, z, w = (part / math.hypot(*quat_xyzw) for part in quat_xyzw)
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def reflex_faults(config: Config) -> Iterator[Fault]:
    """Yield a reflex that could not act, or that could exceed the limit of the gripper."""
    reflex, gripper = config.reflex, config.gripper
    if not reflex.enabled:
        return
    most_n = None if gripper is None else gripper.max_force_n
    if most_n is None:
        yield "reflex.enabled", "needs [gripper] with max_force_n: nothing is moved without a limit"
    elif config.grasp is None:
        yield "reflex.enabled", "needs [grasp], from which the necessary grip force is computed"
    elif reflex.ceiling_n is not None and reflex.ceiling_n > most_n:
        yield "reflex.ceiling_n", f"must be at most gripper.max_force_n, {most_n:g} N, got {reflex.ceiling_n:g}"


def _settings_rise(table: Table) -> bool:
    units, values = zip(*table, strict=True)
    return _rising(units) and _rising(values) and units[0] >= 0.0 and units[-1] <= MAX_UNITS and values[0] >= 0.0


def _rising(values: Sequence[float]) -> bool:
    return all(a < b for a, b in itertools.pairwise(values))
