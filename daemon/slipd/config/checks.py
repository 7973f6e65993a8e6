"""Faults of a config that no single value shows: names, ports, devices and tables that do not fit each other."""

from __future__ import annotations

import itertools
import re
from typing import Any
from urllib.parse import urlsplit

from slipd.config.bounds import LONGEST_PAD_M, MARGIN, MOST_MIN_NORMAL_N
from slipd.config.bus_checks import bus_faults
from slipd.config.gripper_checks import grasp_faults, gripper_faults, reflex_faults
from slipd.config.model import Config, Finger, Gripper, Pad, Stream, Wrench
from slipd.devices import DEVICES, Device

Fault = tuple[str, str]
_FINGER_NAME = re.compile(r"[a-z0-9]{1,32}")
_KINDS = {"wrench": ("wrench",), "tactile": ("tactile",), "gripper": ("gripper",), "any": ("wrench", "tactile")}
_TRANSPORTS = {"ws": "websocket", "tcp": "tcp", "udp": "udp", "ipc": "external", "unix": "local"}
_ADDRESSES = {
    "serial": "the path of a serial port",
    "tcp": "tcp://HOST:PORT",
    "udp": "udp://HOST:PORT",
    "websocket": "ws://HOST:PORT",
    "external": "ipc:///PATH",
    "local": "unix:///PATH",
}
#: Bits of a byte on a line of 8N1.
BITS_A_BYTE = 10
#: By default a stream is stale after this many periods without a reading, but not before ``STALE_LEAST_NS``.
STALE_PERIODS = 3.0
STALE_LEAST_NS = 20_000_000
#: Least ``stale_s``, s and in periods: silence is checked every 5 ms, and a reading may be missed.
STALE_S, STALE_S_PERIODS = 0.01, 1.5
#: Most ``stale_s``, s or in periods, the longer: a verdict must not rest on a dead sensor.
STALE_MOST_S, STALE_MOST_PERIODS = 0.5, 10.0


def meaning_faults(config: Config) -> list[Fault]:
    """Find the faults that no single value shows."""
    faults = [*_finger_names(config), *_ports(config), *bus_faults(config)]
    for name, finger in config.finger.items():
        faults += _finger(f"finger.{name}", finger)
    if config.gripper is not None:
        faults += _stream("gripper", config.gripper, "gripper") + gripper_faults(config.gripper)
    faults += grasp_faults(config) + reflex_faults(config)
    if config.levels.caution >= config.levels.warning:
        faults.append(("levels.caution", f"must be below levels.warning, {config.levels.warning}"))
    if config.levels.hysteresis >= config.levels.caution:
        faults.append(("levels.hysteresis", f"must be below levels.caution, {config.levels.caution}"))
    return faults


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
    if finger.mu_max is not None and finger.mu is not None and finger.mu_max < finger.mu:
        faults.append((f"{path}.mu_max", f"must be at least mu, {finger.mu:g}, got {finger.mu_max:g}"))
    if finger.wrench is not None:
        faults += _stream(f"{path}.wrench", finger.wrench, "wrench") + _threshold(path, finger, finger.wrench)
    pad = finger.pad
    if pad is None:
        return faults
    device_faults = _stream(f"{path}.pad", pad, "tactile")
    if device_faults:
        return faults + device_faults
    faults += _pad(f"{path}.pad", pad)
    if axes_of(pad) == 1 and finger.wrench is None:
        faults.append((f"{path}.wrench", f"is missing: {pad.device} measures no shear, so a force sensor is needed"))
    return faults


def _threshold(path: str, finger: Finger, wrench: Wrench) -> list[Fault]:
    """Find a contact threshold that the force sensor never reaches, or that would hide a grip."""
    least_n = finger.min_normal_n
    if least_n > MOST_MIN_NORMAL_N:
        return [(f"{path}.min_normal_n", f"must be at most {MOST_MIN_NORMAL_N:g} N, got {least_n:g}")]
    if wrench.range_n is not None and least_n >= wrench.range_n:
        return [(f"{path}.min_normal_n", f"must be below wrench.range_n, {wrench.range_n:g} N, got {least_n:g}")]
    return []


def _pad(path: str, pad: Pad) -> list[Fault]:
    faults = []
    axes = axes_of(pad)
    if axes not in (1, 3):
        faults.append(
            (
                f"{path}.axis_scale",
                f"must have 1 value for taxels that measure pressure, 3 for those that measure shear too, got {axes}",
            )
        )
    elif 0.0 in pad.axis_scale:
        faults.append(
            (f"{path}.axis_scale", "must not contain 0, which discards an axis: give newtons per count, or 1")
        )
    elif len(pad.axis_scale) != axes:
        faults.append(
            (
                f"{path}.axis_scale",
                f"must have {axes} value(s), one per axis of a {pad.device} taxel, got {len(pad.axis_scale)}",
            )
        )
    taxels = DEVICES[pad.device].taxels
    if taxels not in (None, pad.rows * pad.cols):
        message = f"rows x cols must be {taxels}, the taxels of one {pad.device} sensor, got {pad.rows} x {pad.cols}"
        faults.append((f"{path}.rows", message))
    if axes == 3 and pad.charge_tau_s is not None:
        faults.append((f"{path}.charge_tau_s", f"must be left out: {pad.device} measures force, not charge"))
    if pad.tare and len(pad.tare) != axes * pad.rows * pad.cols:
        faults.append((f"{path}.tare", f"must have {axes * pad.rows * pad.cols} values, got {len(pad.tare)}"))
    return faults + _size(path, pad)


def _size(path: str, pad: Pad) -> list[Fault]:
    """Find taxels that overlap, and a pad that fits no gripper."""
    if pad.electrode_m > pad.pitch_m:
        return [(f"{path}.electrode_m", f"must be at most pitch_m, {pad.pitch_m:g} m, got {pad.electrode_m:g}")]
    longest_m = max(pad.rows, pad.cols) * pad.pitch_m
    if longest_m <= LONGEST_PAD_M:
        return []
    rule = f"the pad must be at most {LONGEST_PAD_M:g} m long"
    return [
        (f"{path}.pitch_m", f"{rule}, got {longest_m:g} m ({pad.rows} x {pad.cols} taxels, {pad.pitch_m:g} m apart)")
    ]


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
    rate = _rate(path, stream, device)
    if rate:
        return rate
    least_s = max(STALE_S, STALE_S_PERIODS / stream.rate_hz)
    most_s = max(STALE_MOST_S, STALE_MOST_PERIODS / stream.rate_hz)
    if stream.stale_s is not None and not least_s <= stream.stale_s <= most_s:
        message = f"must be from {least_s:g} to {most_s:g} s at rate_hz = {stream.rate_hz:g}, got {stream.stale_s:g}"
        return [(f"{path}.stale_s", message)]
    stale_s = stale_after_ns(stream) * 1e-9
    if stream.delay_s >= stale_s:
        message = (
            f"must be less than {stale_s:g} s, or every reading would be stale, got {stream.delay_s:g}; set stale_s"
        )
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


def _rate(path: str, stream: Stream, device: Device) -> list[Fault]:
    """Find a rate that the device does not have, or that its line cannot carry."""
    low_hz, high_hz = device.rates_hz
    if not low_hz / MARGIN <= stream.rate_hz <= high_hz * MARGIN:
        rule = f"must be from {low_hz:.4g} to {high_hz:.4g} Hz, the rates of {stream.device}, got {stream.rate_hz:g}"
        seconds = f": did you mean a period of {stream.rate_hz:g} s? write {1.0 / stream.rate_hz:g}"
        meant = low_hz <= 1.0 / stream.rate_hz <= high_hz and stream.rate_hz < low_hz
        return [(f"{path}.rate_hz", rule + seconds if meant else rule)]
    baud = stream.baud or device.baud
    needed = stream.rate_hz * device.frame_bytes * BITS_A_BYTE
    if baud is None or transport_of(stream.port) != "serial" or needed <= baud:
        return []
    carried_hz = baud / (device.frame_bytes * BITS_A_BYTE)
    rule = f"must be at most {carried_hz:.0f} Hz, which is all that {stream.device} sends at {baud} bit/s"
    return [(f"{path}.rate_hz", f"{rule}, got {stream.rate_hz:g}; lower it or raise baud")]


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
    """Return the silence, and the age of a reading, beyond which a stream is stale for the verdict."""
    if stream.stale_s is not None:
        return round(stream.stale_s * 1e9)
    return max(round(STALE_PERIODS * 1e9 / stream.rate_hz), STALE_LEAST_NS)


def axes_of(pad: Pad) -> int:
    """Components that a taxel of the pad measures; where the device leaves it open, as many as have a scale."""
    return DEVICES[pad.device].axes or len(pad.axis_scale)


def in_newtons(pad: Pad) -> bool:
    """Whether what a pad reads is in newtons, and not in a unit that the config chose."""
    return pad.gain_error is not None or (DEVICES[pad.device].newtons and set(map(abs, pad.axis_scale)) == {1.0})


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
