"""Faults of a config that no single value shows: names, ports, devices and tables that do not fit each other."""

from __future__ import annotations

import itertools
import re

from slipd.config.bus_checks import bus_faults
from slipd.config.finger_checks import finger_faults
from slipd.config.gripper_checks import grasp_faults, gripper_faults, reflex_faults
from slipd.config.model import Config
from slipd.config.stream_checks import stream_faults
from slipd.config.stream_model import Stream
from slipd.config.stream_settings import key_path
from slipd.config.value_bounds import Fault

_FINGER_NAME = re.compile(r"[a-z0-9]{1,32}")
_PORT_KEYS = ("options", "baud", "hardware_id")


def semantic_faults(config: Config) -> list[Fault]:
    """Find the faults that no single value shows."""
    faults = [*_name_faults(config), *_port_faults(config), *bus_faults(config)]
    for name, finger in config.finger.items():
        faults += finger_faults(f"finger.{name}", finger)
    if config.gripper is not None:
        faults += stream_faults("gripper", config.gripper, "gripper") + gripper_faults(config.gripper)
    if config.grasp is not None and config.grasp.object is not None:
        faults += stream_faults("grasp.object", config.grasp.object, "object")
    faults += grasp_faults(config) + reflex_faults(config) + _level_faults(config) + _recording_faults(config)
    return faults + _realtime_faults(config)


def _name_faults(config: Config) -> list[Fault]:
    faults = [
        (f"finger.{name}", f"a finger name must consist of 1 to 32 characters a-z and 0-9, got {name!r}")
        for name in config.finger
        if not _FINGER_NAME.fullmatch(name)
    ]
    for a, b in itertools.permutations(config.finger, 2):
        if b.startswith(a):
            rule = f"must not begin with the name of finger {a!r}: a subscription to that finger would match both"
            faults.append((f"finger.{b}", rule))
    return faults


def _realtime_faults(config: Config) -> list[Fault]:
    if not (config.realtime.poll and config.realtime.priority):
        return []
    rule = "must be false where realtime.priority is set: the kernel stops a real-time program that never sleeps"
    return [("realtime.poll", rule)]


def _level_faults(config: Config) -> list[Fault]:
    levels, faults = config.levels, []
    if levels.caution >= levels.warning:
        faults.append(("levels.caution", f"must be below levels.warning, {levels.warning:g}, got {levels.caution:g}"))
    if levels.hysteresis >= levels.caution:
        rule = f"must be below levels.caution, {levels.caution:g}, got {levels.hysteresis:g}"
        faults.append(("levels.hysteresis", rule))
    return faults


def _recording_faults(config: Config) -> list[Fault]:
    limits = config.recording.continuous
    if limits.keep_bytes >= 2 * limits.file_bytes:
        return []
    rule = f"must be at least twice recording.continuous.file_bytes, {limits.file_bytes}, got {limits.keep_bytes}"
    return [("recording.continuous.keep_bytes", rule)]


def _port_faults(config: Config) -> list[Fault]:
    """Find streams that use the same port but cannot share it."""
    faults = []
    seen: dict[str, list[tuple[str, Stream]]] = {}
    for name, stream in config.streams().items():
        seen.setdefault(stream.port, []).append((name, stream))
    for port, users in seen.items():
        first_name, first = users[0]
        sensors = [(stream.device, stream.sensor) for _, stream in users]
        shared = len({device for device, _ in sensors}) == 1 and all(sensor for _, sensor in sensors)
        if len(users) > 1 and not (shared and len(set(sensors)) == len(sensors)):
            rule = f"must differ from the port of {first_name}, or each needs a 'sensor' of its own; both are {port}"
            faults.append((f"{key_path(users[1][0])}.port", rule))
        for name, stream in users[1:]:
            different = [key for key in _PORT_KEYS if shared and getattr(stream, key) != getattr(first, key)]
            rule = f"must be the same as for {first_name}, which is on the same port"
            faults += [(f"{key_path(name)}.{key}", rule) for key in different]
    return faults
