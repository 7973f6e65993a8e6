"""Faults that only several values of a config show: names, ports, endpoints and tables that do not fit each other."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from slipd.config.model import Config, Grasp, Gripper, key_path
from slipd.config.service_tables import Bus
from slipd.config.stream_checks import finger_faults, stream_faults
from slipd.config.stream_tables import Stream, Table
from slipd.config.value_bounds import GRIP, MARGIN, PLACE, SPEED, WIDTH, Fault, table_fault
from slipd.devices import DEVICES, GripRange
from slipd_client.quaternions import rotated

_FINGER_NAME = re.compile(r"[a-z0-9]{1,32}")
_PORT_KEYS = ("options", "baud", "hardware_id")
_ENDPOINT = re.compile(r"ipc:///[^\0]+|tcp://(\d{1,3}(\.\d{1,3}){3}|localhost|\*):(\d{1,5}|\*)")
_LOCAL = re.compile(r"tcp://(127\.|localhost:)")
FACING = -0.98
"""Largest cosine of the angle between the pads of parallel jaws: they face each other within 11 degrees."""
MAX_UNITS = 255
"""The settings of a gripper in its own units are bytes."""


def semantic_faults(config: Config) -> Iterator[Fault]:
    """Yield the faults that only several values show."""
    yield from _name_faults(config)
    yield from _port_faults(config)
    yield from bus_faults(config.bus)
    for name, finger in config.finger.items():
        yield from finger_faults(f"finger.{name}", finger)
    if config.gripper is not None:
        yield from stream_faults("gripper", config.gripper, "gripper")
        yield from gripper_faults(config.gripper)
    for kind in ("object", "arm"):
        if (stream := config.streams().get(kind)) is not None:
            yield from stream_faults(f"grasp.{kind}", stream, kind)
    yield from grasp_faults(config)
    yield from reflex_faults(config)
    yield from _service_faults(config)


def _name_faults(config: Config) -> Iterator[Fault]:
    for name in config.finger:
        if not _FINGER_NAME.fullmatch(name):
            yield f"finger.{name}", f"a finger name must consist of 1 to 32 characters a-z and 0-9, got {name!r}"
    for a, b in itertools.permutations(config.finger, 2):
        if b.startswith(a):
            rule = f"must not begin with the name of finger {a!r}: a subscription to that finger would match both"
            yield f"finger.{b}", rule


def _port_faults(config: Config) -> Iterator[Fault]:
    """Find streams that use the same port but cannot share it."""
    seen: dict[str, list[tuple[str, Stream]]] = {}
    for name, stream in config.streams().items():
        seen.setdefault(stream.port, []).append((name, stream))
    for port, users in seen.items():
        first_name, first = users[0]
        sensors = [(stream.device, stream.sensor) for _, stream in users]
        shared = len({device for device, _ in sensors}) == 1 and all(sensor for _, sensor in sensors)
        if len(users) > 1 and not (shared and len(set(sensors)) == len(sensors)):
            rule = f"must differ from the port of {first_name}, or each needs a 'sensor' of its own; both are {port}"
            yield f"{key_path(users[1][0])}.port", rule
        for name, stream in users[1:]:
            for key in _PORT_KEYS:
                if shared and getattr(stream, key) != getattr(first, key):
                    yield f"{key_path(name)}.{key}", f"must be the same as for {first_name}, which is on the same port"


def bus_faults(bus: Bus) -> Iterator[Fault]:
    """Yield endpoints that cannot be served or would admit anybody; binding finds the rest."""
    for name, keys in (("publish", "readers"), ("requests", "requesters")):
        endpoint = getattr(bus, name)
        if endpoint is None:
            continue
        local = bool(_LOCAL.match(endpoint))
        if not _ENDPOINT.fullmatch(endpoint):
            yield f"bus.{name}", f"must be ipc:///PATH or tcp://ADDRESS:PORT, got {endpoint!r}"
        elif endpoint.startswith("tcp:") and getattr(bus, keys) is None and not (local and bus.allow_local_tcp):
            who = "every user of this machine" if local else "other machines"
            also = " or bus.allow_local_tcp = true," if local else ""
            fault = f"{who} could connect without a key: set bus.secret_key and bus.{keys},{also} or use ipc:///PATH"
            yield f"bus.{name}", fault
    lists = [name for name in ("readers", "requesters") if getattr(bus, name) is not None]
    if bus.secret_key is None:
        for name in lists:
            yield f"bus.{name}", "needs bus.secret_key, the key of the daemon itself"
    elif not lists:
        rule = "needs bus.readers, bus.requesters or both: without a list no client has to show a key"
        yield "bus.secret_key", rule


def missing_keys(bus: Bus) -> Iterator[Fault]:
    """Yield the key path and the text of each file of keys that does not exist, with the command that creates it."""
    for name in ("secret_key", "readers", "requesters"):
        place = getattr(bus, name)
        if place is None or os.path.lexists(place) or not _is_visible(Path(place).parent):
            continue
        mend = f"mkdir -m 755 {place}, and copy the .key of each client there (slipctl keys new NAME)"
        if name == "secret_key":
            create = f"slipctl keys new {Path(place).stem} --dir {Path(place).parent}"
            mend = f"{create}. For clients of this machine alone, leave [bus] out"
        yield f"bus.{name}", f"{place} does not exist, so the daemon cannot start: {mend}"


def _is_visible(folder: Path) -> bool:
    """Return whether this user can see what a folder holds, or that it does not exist."""
    return os.access(folder, os.X_OK) or not os.path.lexists(folder)


def _service_faults(config: Config) -> Iterator[Fault]:
    levels, limits = config.levels, config.recording.continuous
    if levels.caution >= levels.warning:
        yield "levels.caution", f"must be below levels.warning, {levels.warning:g}, got {levels.caution:g}"
    if levels.hysteresis >= levels.caution:
        yield "levels.hysteresis", f"must be below levels.caution, {levels.caution:g}, got {levels.hysteresis:g}"
    if limits.keep_bytes < 2 * limits.file_bytes:
        rule = f"must be at least twice recording.continuous.file_bytes, {limits.file_bytes}, got {limits.keep_bytes}"
        yield "recording.continuous.keep_bytes", rule


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
    first, second = (rotated(place.quat_xyzw, (0.0, 0.0, 1.0)) for place in config.pads.values())
    if sum(a * b for a, b in zip(first, second, strict=True)) > FACING:
        one, other = config.pads
        rule = f"must turn the Z axis of the pad towards that of {one}, because the pads face each other"
        yield f"grasp.pads.{other}.quat_xyzw", f"{rule}: is it x, y, z, w?"


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
