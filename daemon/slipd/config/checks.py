"""Faults of a config that no single value shows: names, ports, endpoints and tables that do not fit each other."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator
from pathlib import Path

from slipd.config.gripper_checks import grasp_faults, gripper_faults, reflex_faults
from slipd.config.model import Config, key_path
from slipd.config.service_tables import Bus
from slipd.config.stream_checks import finger_faults, stream_faults
from slipd.config.stream_tables import Stream
from slipd.config.value_bounds import Fault

_FINGER_NAME = re.compile(r"[a-z0-9]{1,32}")
_PORT_KEYS = ("options", "baud", "hardware_id")
_ENDPOINT = re.compile(r"ipc:///[^\0]+|tcp://(\d{1,3}(\.\d{1,3}){3}|localhost|\*):(\d{1,5}|\*)")
_LOCAL = re.compile(r"tcp://(127\.|localhost:)")


def semantic_faults(config: Config) -> Iterator[Fault]:
    """Yield the faults that no single value shows."""
    yield from _name_faults(config)
    yield from _port_faults(config)
    yield from bus_faults(config.bus)
    for name, finger in config.finger.items():
        yield from finger_faults(f"finger.{name}", finger)
    if config.gripper is not None:
        yield from stream_faults("gripper", config.gripper, "gripper")
        yield from gripper_faults(config.gripper)
    if config.grasp is not None and config.grasp.object is not None:
        yield from stream_faults("grasp.object", config.grasp.object, "object")
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
    if config.realtime.poll and config.realtime.priority:
        rule = "must be false where realtime.priority is set: the kernel stops a real-time program that never sleeps"
        yield "realtime.poll", rule
