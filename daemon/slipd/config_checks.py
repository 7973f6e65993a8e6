"""Faults of a config that no single value shows: names, ports, devices and tables that do not fit each other."""

from __future__ import annotations

import itertools
import math
import re
from typing import Any
from urllib.parse import urlsplit

from slipd.config_model import Bus, Config, Finger, Grasp, Gripper, Pad, Stream, Table
from slipd.devices import DEVICES

Fault = tuple[str, str]
_FINGER_NAME = re.compile(r"[a-z0-9]{1,32}")
_ENDPOINT = re.compile(r"ipc:///[^\0]+|tcp://(\d{1,3}(\.\d{1,3}){3}|localhost|\*):(\d{1,5}|\*)")
_LOCAL = re.compile(r"tcp://(127\.|localhost:)")
_KINDS = {"wrench": ("wrench",), "tactile": ("tactile",), "gripper": ("gripper",), "any": ("wrench", "tactile")}
_TRANSPORTS = {"ws": "websocket", "wss": "websocket", "tcp": "tcp", "udp": "udp", "ipc": "external", "unix": "local"}
_ADDRESSES = {
    "serial": "the path of a serial port",
    "tcp": "tcp://HOST:PORT",
    "udp": "udp://HOST:PORT",
    "websocket": "ws://HOST:PORT",
    "external": "ipc:///PATH",
    "local": "unix:///PATH",
}
#: A quaternion written with four digits is still a unit quaternion.
QUATERNION_TOLERANCE = 1e-3
#: A stream is stale after so many periods without a reading, and no sooner than after the least.
STALE_PERIODS = 3.0
STALE_LEAST_NS = 20_000_000
#: Cosine of the angle between the pads of parallel jaws: they face each other within 11 degrees.
FACING = -0.98
#: A gripper's own settings are bytes.
MAX_UNITS = 255


def meaning_faults(config: Config) -> list[Fault]:
    """Faults that no single value shows."""
    faults = [*_finger_names(config), *_ports(config), *_endpoints(config)]
    for name, finger in config.finger.items():
        faults += _finger(f"finger.{name}", finger)
    if config.gripper is not None:
        faults += _stream("gripper", config.gripper, "gripper") + _gripper(config.gripper)
    faults += _grasp(config) + _reflex(config)
    if config.levels.caution >= config.levels.warning:
        faults.append(("levels.caution", f"must be below levels.warning, {config.levels.warning}"))
    if config.levels.hysteresis >= config.levels.caution:
        faults.append(("levels.hysteresis", f"must be below levels.caution, {config.levels.caution}"))
    return faults


def _endpoints(config: Config) -> list[Fault]:
    """Endpoints that no daemon could serve, or that would let in anybody; what only binding shows is judged then."""
    bus = config.bus
    faults = _endpoint("publish", bus.publish, "readers", bus) + _endpoint("requests", bus.requests, "requesters", bus)
    lists = [name for name in ("readers", "requesters") if getattr(bus, name) is not None]
    if bus.secret_key is None:
        faults += [(f"bus.{name}", "needs bus.secret_key, the daemon's own key") for name in lists]
    elif not lists:
        faults.append(("bus.secret_key", "asks nobody for a key; set bus.readers, bus.requesters or both as well"))
    return faults


def _endpoint(name: str, endpoint: str | None, keys: str, bus: Bus) -> list[Fault]:
    if endpoint is None:
        return []
    if not _ENDPOINT.fullmatch(endpoint):
        return [(f"bus.{name}", f"{endpoint!r} is no endpoint that is served: ipc:///PATH, or tcp://ADDRESS:PORT")]
    local = bool(_LOCAL.match(endpoint))
    if endpoint.startswith("ipc:") or getattr(bus, keys) is not None or (local and bus.allow_local_tcp):
        return []
    who = "every user of this machine" if local else "other machines"
    also = " or bus.allow_local_tcp = true," if local else ""
    fault = f"{who} would get in without a key; set bus.secret_key and bus.{keys},{also} or use ipc:///PATH"
    return [(f"bus.{name}", fault)]


def _finger_names(config: Config) -> list[Fault]:
    faults = [
        (f"finger.{name}", "a finger's name is made of a-z and 0-9, 32 of them at most")
        for name in config.finger
        if not _FINGER_NAME.fullmatch(name)
    ]
    for a, b in itertools.permutations(config.finger, 2):
        if b.startswith(a):
            faults.append(
                (f"finger.{b}", f"begins with the name of finger {a!r}; subscribers could not tell them apart")
            )
    return faults


def _finger(path: str, finger: Finger) -> list[Fault]:
    if finger.wrench is None and finger.pad is None:
        return [(path, "has neither [wrench] nor [pad]: nothing to read")]
    faults = []
    if finger.wrench is not None:
        faults += _stream(f"{path}.wrench", finger.wrench, "wrench")
        length = math.hypot(*finger.wrench.pad_from_sensor.quat_xyzw)
        if abs(length - 1.0) > QUATERNION_TOLERANCE:
            message = f"quat_xyzw must be a unit quaternion x, y, z, w; this one has length {length:.4g}"
            faults.append((f"{path}.wrench.pad_from_sensor", message))
    pad = finger.pad
    if pad is None:
        return faults
    device_faults = _stream(f"{path}.pad", pad, "tactile")
    if device_faults:
        return faults + device_faults
    axes = axes_of(pad)
    if axes not in (1, 3):
        faults.append(
            (f"{path}.pad.axis_scale", "give 1 for taxels that feel pressure, 3 for those that feel shear too")
        )
    elif 0.0 in pad.axis_scale:
        faults.append((f"{path}.pad.axis_scale", "a 0 leaves nothing of what is felt: give newtons a count, or 1"))
    elif len(pad.axis_scale) != axes:
        faults.append((f"{path}.pad.axis_scale", f"{pad.device} measures {axes} component(s) a taxel: give {axes}"))
    taxels = DEVICES[pad.device].taxels
    if taxels not in (None, pad.rows * pad.cols):
        message = f"{pad.rows} rows of {pad.cols} taxels: {pad.device} has {taxels} a sensor"
        faults.append((f"{path}.pad.rows", message))
    if axes == 3 and pad.charge_tau_s is not None:
        faults.append((f"{path}.pad.charge_tau_s", f"{pad.device} measures force itself, no charge: leave it out"))
    if pad.tare and len(pad.tare) != axes * pad.rows * pad.cols:
        faults.append((f"{path}.pad.tare", f"needs {axes * pad.rows * pad.cols} values, not {len(pad.tare)}"))
    if axes == 1 and finger.wrench is None:
        faults.append((f"{path}.wrench", f"is missing: {pad.device} measures no shear, so a force sensor is needed"))
    return faults


def _stream(path: str, stream: Stream, kind: str) -> list[Fault]:
    device = DEVICES.get(stream.device)
    fitting = {name: known for name, known in DEVICES.items() if kind in _KINDS[known.kind]}
    if device is None or stream.device not in fitting:
        return [(f"{path}.device", f"{stream.device!r} is no {kind} device; known: {', '.join(sorted(fitting))}")]
    if transport_of(stream.port) not in device.transports:
        right = " or ".join(_ADDRESSES[transport] for transport in device.transports)
        return [(f"{path}.port", f"{stream.device} is not read at {stream.port!r}: give {right}")]
    wrong = _wrong_address(stream.port)
    if wrong:
        return [(f"{path}.port", f"{stream.port!r} {wrong}: give {_ADDRESSES[transport_of(stream.port)]}")]
    if device.shared != bool(stream.sensor):
        right = (
            'say which sensor of the port, e.g. "1"' if device.shared else "leave it out: the port carries one sensor"
        )
        return [(f"{path}.sensor", right)]
    if device.sensors and stream.sensor not in device.sensors:
        known = " and ".join(f'"{sensor}"' for sensor in device.sensors)
        return [(f"{path}.sensor", f"{stream.device} has no sensor {stream.sensor!r}: it has {known}")]
    stale_s = stale_after_ns(stream) * 1e-9
    if stream.delay_s >= stale_s:
        message = f"every reading would be stale on arrival: less than {stale_s:g} s, as rate_hz is, can be used"
        return [(f"{path}.delay_s", message)]
    own = sorted({"rows", "cols"} & stream.options.keys())
    if own:
        return [(f"{path}.options", f"{' and '.join(own)} stand beside options, as keys of the pad itself")]
    if device.wired and "wiring" in stream.options:
        return [(f"{path}.options.wiring", "leave it out: the port's address says it")]
    try:
        (device.session or device.decoder)(**device_options(stream))
    except (TypeError, ValueError, OverflowError) as error:
        return [(f"{path}.options", str(error))]
    return []


def transport_of(port: str) -> str:
    """How the bytes of a port travel, told by its address."""
    scheme, separator, _ = port.partition("://")
    return _TRANSPORTS.get(scheme, "serial") if separator else "serial"


def _wrong_address(port: str) -> str:
    """What is wrong with the address of a server, "" where nothing is; paths and endpoints are judged when opened."""
    transport = transport_of(port)
    if transport in ("serial", "external", "local"):
        return ""
    try:
        parts = urlsplit(port)
        host, number = parts.hostname, parts.port
        (host or "").encode("idna")
    except ValueError as error:
        return f"is no address ({error})"
    if not host:
        return "names no host"
    if number == 0 or (number is None and transport != "websocket"):
        return "names no port from 1 to 65535"
    return ""


def stale_after_ns(stream: Stream) -> int:
    """Age at which a stream is stale for the verdict."""
    return max(round(STALE_PERIODS * 1e9 / stream.rate_hz), STALE_LEAST_NS)


def axes_of(pad: Pad) -> int:
    """Components that a taxel of the pad measures; where the device leaves it open, as many as have a scale."""
    return DEVICES[pad.device].axes or len(pad.axis_scale)


def device_options(stream: Stream) -> dict[str, Any]:
    """Options for the device's decoder or session: those of the file, and what other keys of the stream say."""
    device = DEVICES[stream.device]
    options: dict[str, Any] = dict(stream.options)
    if isinstance(stream, Pad) and device.sized:
        options |= {"rows": stream.rows, "cols": stream.cols}
    if device.wired:
        options["wiring"] = transport_of(stream.port)
    if isinstance(stream, Gripper) and device.tabled and stream.force_table and stream.width_table:
        options |= {"force_table": stream.force_table, "width_table": stream.width_table}
        options["speed_table"] = stream.speed_table
    return options


def _ports(config: Config) -> list[Fault]:
    faults = []
    seen: dict[str, list[tuple[str, Stream]]] = {}
    for name, stream in config.streams().items():
        seen.setdefault(stream.port, []).append((name, stream))
    for port, users in seen.items():
        sensors = [(stream.device, stream.sensor) for _, stream in users]
        shared = len({device for device, _ in sensors}) == 1 and all(sensor for _, sensor in sensors)
        if len(users) > 1 and not (shared and len(set(sensors)) == len(sensors)):
            name = users[1][0]
            path = name if name == "gripper" else f"finger.{name}"
            faults.append(
                (f"{path}.port", f"{port} is used by {users[0][0]} too; give each its own, or its own 'sensor'")
            )
        for name, stream in users[1:]:
            for key in ("options", "baud", "hardware_id"):
                if shared and getattr(stream, key) != getattr(users[0][1], key):
                    message = f"differs from {users[0][0]} on the same port, which is read in one way: give both alike"
                    faults.append((f"finger.{name}.{key}", message))
    return faults


def _gripper(gripper: Gripper) -> list[Fault]:
    if gripper.device not in DEVICES or DEVICES[gripper.device].kind != "gripper":
        return []
    faults = _limits(gripper)
    tables = {"force_table": gripper.force_table, "width_table": gripper.width_table}
    tabled = DEVICES[gripper.device].tabled
    for key, table in tables.items():
        if tabled and table is None:
            faults.append((f"gripper.{key}", f"is missing: {gripper.device} knows only units of its own"))
    for key, table in (tables | {"speed_table": gripper.speed_table}).items():
        if not tabled and table is not None:
            faults.append((f"gripper.{key}", f"leave it out: {gripper.device} is told metres and newtons"))
    if gripper.force_table is None or gripper.width_table is None or not tabled:
        return faults
    return faults + _tables(gripper, gripper.force_table, gripper.width_table)


def _limits(gripper: Gripper) -> list[Fault]:
    low = gripper.min_force_n
    if gripper.max_force_n is not None and low is not None and low >= gripper.max_force_n:
        return [("gripper.max_force_n", f"must be above the least force, {low} N")]
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
        faults.append(("gripper.max_force_n", f"is above the gripper's own {forces[-1]} N of force_table"))
    if gripper.min_force_n is not None and gripper.min_force_n < forces[0]:
        faults.append(("gripper.min_force_n", f"is below the gripper's own {forces[0]} N of force_table"))
    if gripper.min_force_n is None and forces[0] >= gripper.max_force_n:
        faults.append(("gripper.max_force_n", f"must be above the least force, {forces[0]} N"))
    return faults


def _grasp(config: Config) -> list[Fault]:
    """Pads that are not two known fingers, or cannot be placed."""
    if config.grasp is None:
        return []
    faults = []
    for name, place in config.grasp.pads.items():
        path = f"grasp.pads.{name}"
        if name not in config.finger:
            faults.append((path, f"there is no finger {name!r}; known: {', '.join(config.finger)}"))
        if not _rising(tuple(row[0] for row in place.positions)):
            faults.append((f"{path}.positions", "the widths, first of each row, must rise"))
        length = math.hypot(*place.quat_xyzw)
        if abs(length - 1.0) > QUATERNION_TOLERANCE:
            message = f"must be a unit quaternion x, y, z, w; this one has length {length:.4g}"
            faults.append((f"{path}.quat_xyzw", message))
    return faults or _facing(config.grasp)


def _facing(config: Grasp) -> list[Fault]:
    """Pads that do not face each other: the forces of one would be taken for a push of the world on the other."""
    first, second = (_outward(place.quat_xyzw) for place in config.pads.values())
    if sum(a * b for a, b in zip(first, second, strict=True)) <= FACING:
        return []
    right = "quat_xyzw must turn their Z axes against each other"
    return [("grasp.pads", f"the pads {' and '.join(config.pads)} do not face each other: {right}")]


def _outward(quat_xyzw: list[float]) -> tuple[float, float, float]:
    """Z axis of a pad in the gripper frame."""
    x, y, z, w = (part / math.hypot(*quat_xyzw) for part in quat_xyzw)
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def _reflex(config: Config) -> list[Fault]:
    """A reflex that could not act, or that would be asked for more than the gripper may."""
    reflex, gripper = config.reflex, config.gripper
    if not reflex.enabled:
        return []
    if gripper is None or gripper.max_force_n is None:
        return [("reflex.enabled", "needs [gripper] with max_force_n: without a limit nothing is moved")]
    if config.grasp is None:
        return [("reflex.enabled", "needs [grasp], which tells what grip the object needs")]
    if reflex.ceiling_n is not None and reflex.ceiling_n > gripper.max_force_n:
        return [("reflex.ceiling_n", f"is above gripper.max_force_n, {gripper.max_force_n} N")]
    return []


def _settings_rise(table: list[tuple[float, float]]) -> bool:
    units, values = zip(*table, strict=True)
    return _rising(units) and _rising(values) and units[0] >= 0.0 and units[-1] <= MAX_UNITS and values[0] >= 0.0


def _rising(values: tuple[float, ...]) -> bool:
    return all(a < b for a, b in itertools.pairwise(values))
