"""Warnings of `slipd check`: values of a valid config that its author may not have meant."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from slipd.config.checks import missing_keys
from slipd.config.config_file import key_lines, line_of, marked_keys
from slipd.config.model import Config, axes_of, device_options, key_path, transport_of
from slipd.config.stream_tables import Finger, Pad, Stream, Wrench
from slipd.config.value_bounds import MARGIN, USUAL_FRICTION, meant_friction
from slipd.devices import DEVICES, Device, Need

NUMBERED_PORT = re.compile(r"/dev/tty(USB|ACM)\d+")
STABLE_NAMES = (Path("/dev/serial/by-id"), Path("/dev/serial/by-path"))

OPTIONS = "options."

W_FIRST = ([1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0])
"""In the order w, x, y, z this is no rotation; in the order x, y, z, w it turns the sensor upside down."""

USUAL_PLACE_M = 0.3
"""A sensor at the wrist is rarely further from the pad."""

USUAL_MASS_KG = 2.0
"""All that is beyond a sensor at the wrist, with a large gripper."""

USUAL_PAD_M = 0.12
"""The longer side of the largest pads of fingers."""

LEAST_WRENCH_HZ = 100.0
"""A slip shows as a fall of the load only in readings at most 12 ms apart."""

MOST_WARNING = 0.95
"""Above this level, the error of the friction coefficient is larger than what is left."""


def hints(config: Config, file: str) -> Iterator[str]:
    """Yield the warnings of a config, one line each, with file, line and key.

    Args:
        config: The config.
        file: Name of the file, for the lines.
    """
    lines = key_lines(config.text)
    for path, text in _hints(config):
        line = line_of(lines, tuple(path.split(".")))
        place = file if line is None else f"{file}:{line}"
        yield f"{place}: warning: {path}: {text}"
    marked = marked_keys(config.text)
    for table, paths in itertools.groupby(marked, key=lambda path: path[:-1]):
        keys = list(paths)
        names = ", ".join(path[-1] for path in keys)
        yield f"{file}:{marked[keys[0]]}: warning: {'.'.join(table)}: still marked MEASURE: {names}"


def _hints(config: Config) -> Iterator[tuple[str, str]]:
    """Yield the key path and the text of each warning."""
    for name, finger in config.finger.items():
        yield from _finger_hints(f"finger.{name}", finger)
    for stream_name, stream in config.streams().items():
        yield from stream_hints(key_path(stream_name), stream)
    if config.gripper is not None and config.gripper.max_force_n is None:
        yield "gripper", "no max_force_n: no request can move the gripper"
    if config.levels.warning > MOST_WARNING:
        yield "levels.warning", f"{config.levels.warning:g} leaves no time to act; 0.85 is usual"
    yield from missing_keys(config.bus)
    if config.bus.allow_local_tcp:
        yield "bus.allow_local_tcp", "every user of this machine can move the gripper over its TCP port"


def _finger_hints(path: str, finger: Finger) -> Iterator[tuple[str, str]]:
    if finger.mu is None:
        yield path, "no mu: it warns of nothing before a slip has shown the friction"
    elif finger.mu > USUAL_FRICTION:
        late = f"{finger.mu:g} is more than rubber usually has: warnings would come too late"
        yield f"{path}.mu", "; ".join(filter(None, (late, meant_friction(finger.mu))))
    if finger.pad is None:
        yield path, 'no pad: rotation is not observed, so its level is never "stable"'
    else:
        yield from _pad_hints(f"{path}.pad", finger.pad, alone=finger.wrench is None)
    if finger.wrench is not None:
        yield from _wrench_hints(f"{path}.wrench", finger.wrench)


def _pad_hints(path: str, pad: Pad, *, alone: bool) -> Iterator[tuple[str, str]]:
    if alone and axes_of(pad) == 3 and not pad.tare:
        yield path, "no tare: if it does not read about zero unloaded, run `slipctl tare take`"
    longest_m = max(pad.rows, pad.cols) * pad.pitch_m
    if longest_m > USUAL_PAD_M:
        size = f"{pad.rows} x {pad.cols} taxels make a pad {longest_m:g} m long"
        yield f"{path}.pitch_m", f"{size}: is {pad.pitch_m:g} m the distance between two taxels?"


def _wrench_hints(path: str, wrench: Wrench) -> Iterator[tuple[str, str]]:
    mounting = wrench.pad_from_sensor
    if mounting.quat_xyzw in W_FIRST:
        turned = "turns the sensor by 180 degrees about X; in the order w, x, y, z it would be the identity"
        yield f"{path}.pad_from_sensor", f"quat_xyzw {turned}: is its order x, y, z, w?"
    for key, place in (("pad_from_sensor.xyz_m", mounting.xyz_m), ("com_m", wrench.com_m)):
        farthest_m = max(map(abs, place))
        if farthest_m > USUAL_PLACE_M:
            yield f"{path}.{key}", f"{farthest_m:g} m from the pad is far for a finger: is it in metres?"
    if wrench.mass_kg > USUAL_MASS_KG:
        yield f"{path}.mass_kg", f"{wrench.mass_kg:g} kg beyond the sensor is much for a finger: is it in kg?"
    if wrench.rate_hz < LEAST_WRENCH_HZ:
        late = f"at {wrench.rate_hz:g} Hz the force shows slips late or not at all"
        yield f"{path}.rate_hz", f"{late}, as readings must be at most 12 ms apart: choose the sensor's fastest rate"


def stream_hints(path: str, stream: Stream) -> Iterator[tuple[str, str]]:
    """Yield the key path and the text of each warning about a stream.

    Args:
        path: Key path of the stream.
        stream: The stream.
    """
    device = DEVICES[stream.device]
    if NUMBERED_PORT.fullmatch(stream.port):
        stable = _stable_name(Path(stream.port))
        better = f"write {stable}" if stable else f"use a path below {STABLE_NAMES[0]}"
        yield f"{path}.port", f"{stream.port} is whichever device is plugged in first: {better}"
    for need in needs_of(stream):
        if not _states(stream, need.key):
            yield path, f"no {need.key}, which {stream.device} does not report: {need.how}"
    if transport_of(stream.port) == "serial" and stream.baud not in (None, device.baud):
        usual = f"{stream.device} has {device.baud} bit/s by default, got {stream.baud}"
        yield f"{path}.baud", f"{usual}: no reading arrives unless the device itself was set to that"
    yield from _rate_hints(path, stream, device)


def needs_of(stream: Stream) -> list[Need]:
    """Return what the config must state for the device of a stream, because the device does not report it."""
    needs = DEVICES[stream.device].needs
    return [need for need in needs if not need.transports or transport_of(stream.port) in need.transports]


def default_rate_hz(device: Device) -> float | None:
    """Return the rate that slipd sets on a device whose options are left out, Hz; None if it sets none."""
    value = _option(device, {})
    return None if device.rate_option is None or value is None else device.rate_option.convert(value) or None


def _rate_hints(path: str, stream: Stream, device: Device) -> Iterator[tuple[str, str]]:
    """Yield that ``rate_hz`` is not the rate that slipd sets on the device by one of its options."""
    option, value = device.rate_option, _option(device, stream.options)
    if option is None or value is None:
        return
    set_hz = option.convert(value)
    if stream.rate_hz / MARGIN <= set_hz <= stream.rate_hz * MARGIN or set_hz in (0.0, math.inf):
        return
    default = "" if option.name in stream.options else ", its default,"
    rule = f"{stream.rate_hz:g} Hz, but {OPTIONS}{option.name} = {value:g}{default} sets {set_hz:g} Hz"
    right = option.convert(stream.rate_hz)
    other = f", or {OPTIONS}{option.name} = {right:g}" if _accepts(device, stream, option.name, right) else ""
    yield f"{path}.rate_hz", f"{rule}: write rate_hz = {set_hz:g}{other}"


def _option(device: Device, options: Mapping[str, Any]) -> float | None:
    """Return the value of the option that sets the rate, or its default; None if there is no such option."""
    if device.rate_option is None:
        return None
    name = device.rate_option.name
    return float(options.get(name, device.parameters()[name].default))


def _accepts(device: Device, stream: Stream, name: str, value: float) -> bool:
    """Return whether the device takes a value of an option beside the others."""
    exact = int(value) if value == int(value) else value
    try:
        (device.session or device.decoder)(**{**device_options(stream), name: exact})
    except (TypeError, ValueError):
        return False
    return True


def _states(stream: Stream, key: str) -> bool:
    """Return whether a config states a key of a stream."""
    option = key.removeprefix(OPTIONS)
    return option in stream.options if option != key else getattr(stream, key) is not None


def _stable_name(port: Path) -> Path | None:
    """Return the name of a port that stays with its adapter, or with its socket; None if it is not plugged in."""
    names = (name for folder in STABLE_NAMES if folder.is_dir() for name in sorted(folder.iterdir()))
    return next((name for name in names if name.resolve() == port.resolve()), None)
