"""Faults of ``[finger.X]`` and of one stream: device, port, sensor, rate, staleness, options, and what does not fit."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from urllib.parse import urlsplit

from slipd.config.model import ADDRESSES, axes_of, device_options, stale_after_ns, transport_of
from slipd.config.stream_tables import Finger, Pad, Stream
from slipd.config.value_bounds import LONGEST_PAD_M, MARGIN, MOST_MIN_NORMAL_N, Fault
from slipd.devices import (
    DEVICES,
    SLIPD,
    Decoder,
    Device,
    GripperSession,
    Session,
    find_device,
    is_installed,
    normalized,
)

_KINDS = {
    "wrench": ("wrench",),
    "tactile": ("tactile",),
    "gripper": ("gripper",),
    "any": ("wrench", "tactile", "object", "arm"),
}

BITS_PER_BYTE = 10
"""Bits per byte on a serial line with 8N1 framing."""

STALE_S, STALE_S_PERIODS = 0.01, 1.5
"""Smallest ``stale_s``, in s and in periods: silence is checked every 5 ms, and one reading may be missed."""

STALE_MOST_S, STALE_MOST_PERIODS = 0.5, 10.0
"""Largest ``stale_s``, in s or in periods, whichever is longer: a verdict must not rest on a dead sensor."""


def finger_faults(path: str, finger: Finger) -> Iterator[Fault]:
    """Yield the faults of a finger and its streams.

    Args:
        path: Key path of the finger.
        finger: The finger.
    """
    wrench, pad, least_n = finger.wrench, finger.pad, finger.min_normal_n
    if wrench is None and pad is None:
        yield path, "must have [wrench], [pad] or both, got neither"
        return
    if finger.mu_max is not None and finger.mu is not None and finger.mu_max < finger.mu:
        yield f"{path}.mu_max", f"must be at least mu, {finger.mu:g}, got {finger.mu_max:g}"
    if wrench is not None:
        yield from stream_faults(f"{path}.wrench", wrench, "wrench")
        if least_n > MOST_MIN_NORMAL_N:  # it would hide a grip
            yield f"{path}.min_normal_n", f"must be at most {MOST_MIN_NORMAL_N:g} N, got {least_n:g}"
        elif wrench.range_n is not None and least_n >= wrench.range_n:
            yield f"{path}.min_normal_n", f"must be below wrench.range_n, {wrench.range_n:g} N, got {least_n:g}"
    if pad is not None:
        device_faults = list(stream_faults(f"{path}.pad", pad, "tactile"))
        yield from device_faults or _pad_faults(f"{path}.pad", pad)
        if not device_faults and axes_of(pad) == 1 and wrench is None:
            yield f"{path}.wrench", f"is missing: {pad.device} measures no shear, so a force sensor is needed"


def _pad_faults(path: str, pad: Pad) -> Iterator[Fault]:
    """Find keys that do not fit the device, taxels that overlap, and a pad that fits no gripper."""
    axes, taxels, scales = axes_of(pad), DEVICES[pad.device].taxels, len(pad.axis_scale)
    if axes not in (1, 3):
        rule = f"must have 1 value for taxels that measure pressure, 3 if they measure shear too, got {axes}"
        yield f"{path}.axis_scale", rule
    elif 0.0 in pad.axis_scale:
        yield f"{path}.axis_scale", "must not contain 0, which discards an axis: give newtons per count, or 1"
    elif scales != axes:
        rule = f"must have {axes} value(s), one for each axis of a {pad.device} taxel, got {scales}"
        yield f"{path}.axis_scale", rule
    if taxels not in (None, pad.rows * pad.cols):
        rule = f"rows x cols must be {taxels}, the taxels of one {pad.device} sensor, got {pad.rows} x {pad.cols}"
        yield f"{path}.rows", rule
    if axes == 3 and pad.charge_tau_s is not None:
        yield f"{path}.charge_tau_s", f"must be left out: {pad.device} measures force, not charge"
    if pad.tare and len(pad.tare) != axes * pad.rows * pad.cols:
        yield f"{path}.tare", f"must have {axes * pad.rows * pad.cols} values, got {len(pad.tare)}"
    longest_m = max(pad.rows, pad.cols) * pad.pitch_m
    if pad.electrode_m > pad.pitch_m:
        yield f"{path}.electrode_m", f"must be at most pitch_m, {pad.pitch_m:g} m, got {pad.electrode_m:g}"
    elif longest_m > LONGEST_PAD_M:
        rule = f"the pad must be at most {LONGEST_PAD_M:g} m long, got {longest_m:g} m"
        yield f"{path}.pitch_m", f"{rule} ({pad.rows} x {pad.cols} taxels, {pad.pitch_m:g} m apart)"


def stream_faults(path: str, stream: Stream, kind: str) -> Iterator[Fault]:
    """Yield the first fault of a stream, except those that only other streams show.

    Args:
        path: Key path of the stream.
        stream: The stream.
        kind: Kind of device that belongs here: "wrench", "tactile", "gripper", "object" or "arm".
    """
    fault = _package_fault(stream) or _device_fault(stream, kind)
    if fault is None:
        device = DEVICES[stream.device]
        fault = _port_fault(stream, device) or _sensor_fault(stream, device) or _rate_fault(stream, device)
        fault = fault or _staleness_fault(stream) or _option_fault(stream, device)
    if fault is not None:
        yield f"{path}.{fault[0]}", fault[1]


def _package_fault(stream: Stream) -> Fault | None:
    """Find a package that is not installed, or that does not provide a device that can be used."""
    found = find_device(stream.device)
    if found is None:
        if not stream.package:
            return None
        why = "does not provide it" if is_installed(stream.package) else "is not installed"
        return "package", f"{stream.device!r} needs the package {stream.package!r}, which {why}: install it with pip"
    if found.fault:
        return "device", f"{stream.device!r} of {found.package} cannot be used: {found.fault}"
    if normalized(found.package) == normalized(stream.package or SLIPD):
        return None
    if found.package == SLIPD:
        return "package", f"must be left out: {stream.device!r} is a device of slipd, got {stream.package!r}"
    return "package", f"must be {found.package!r}, the package that provides {stream.device!r}, got {stream.package!r}"


def _device_fault(stream: Stream, kind: str) -> Fault | None:
    known = {name for name, device in DEVICES.items() if kind in _KINDS[device.kind]}
    if stream.device in known:
        return None
    return "device", f"must be a {kind} device, got {stream.device!r}; known: {', '.join(sorted(known))}"


def _port_fault(stream: Stream, device: Device) -> Fault | None:
    transport = transport_of(stream.port)
    if transport not in device.transports:
        right = " or ".join(ADDRESSES[each] for each in device.transports)
        return "port", f"must be {right} for {stream.device}, got {stream.port!r}"
    on_network = transport not in ("serial", "external", "local")  # others are checked when they are opened
    wrong = address_fault(stream.port, needs_port=transport != "websocket") if on_network else ""
    return ("port", f"must be {ADDRESSES[transport]}, got {stream.port!r}: {wrong}") if wrong else None


def address_fault(address: str, *, needs_port: bool = True) -> str:
    """Return what is wrong with a network address such as ``udp://HOST:PORT``; "" if nothing is."""
    try:
        parts = urlsplit(address)
        host, number = parts.hostname, parts.port
        (host or "").encode("idna")
    except ValueError as error:
        return f"not an address ({error})"
    if not host:
        return "no host"
    return "no port from 1 to 65535" if number == 0 or (number is None and needs_port) else ""


def _sensor_fault(stream: Stream, device: Device) -> Fault | None:
    if device.shared and not stream.sensor:
        return "sensor", f'must name one sensor of the port, such as "1": a {stream.device} port carries several'
    if stream.sensor and not device.shared:
        return "sensor", f"must be left out: a {stream.device} port carries one sensor"
    if device.sensors and stream.sensor not in device.sensors:
        known = " or ".join(f'"{sensor}"' for sensor in device.sensors)
        return "sensor", f"must be {known}, the sensors of {stream.device}, got {stream.sensor!r}"
    return None


def _rate_fault(stream: Stream, device: Device) -> Fault | None:
    """Find a rate that the device does not have, or that its line cannot carry."""
    low_hz, high_hz = device.rates_hz
    if not low_hz / MARGIN <= stream.rate_hz <= high_hz * MARGIN:
        rule = f"must be from {low_hz:.4g} to {high_hz:.4g} Hz, the rates of {stream.device}, got {stream.rate_hz:g}"
        if low_hz <= 1.0 / stream.rate_hz <= high_hz and stream.rate_hz < low_hz:
            rule += f": did you mean a period of {stream.rate_hz:g} s? write {1.0 / stream.rate_hz:g}"
        return "rate_hz", rule
    baud, reading_bits = stream.baud or device.baud, device.frame_bytes * BITS_PER_BYTE
    if baud is None or transport_of(stream.port) != "serial" or stream.rate_hz * reading_bits <= baud:
        return None
    rule = f"must be at most {baud / reading_bits:.0f} Hz, the most that {stream.device} can send at {baud} bit/s"
    return "rate_hz", f"{rule}, got {stream.rate_hz:g}; lower it or raise baud (default {device.baud})"


def _staleness_fault(stream: Stream) -> Fault | None:
    least_s = max(STALE_S, STALE_S_PERIODS / stream.rate_hz)
    most_s = max(STALE_MOST_S, STALE_MOST_PERIODS / stream.rate_hz)
    if stream.stale_s is not None and not least_s <= stream.stale_s <= most_s:
        rule = f"must be from {least_s:g} to {most_s:g} s at rate_hz = {stream.rate_hz:g}, got {stream.stale_s:g}"
        return "stale_s", rule
    stale_s = stale_after_ns(stream) * 1e-9
    if stream.delay_s < stale_s:
        return None
    rule = f"must be less than {stale_s:g} s, or every reading would be stale, got {stream.delay_s:g}"
    return "delay_s", f"{rule}; raise stale_s"


def _option_fault(stream: Stream, device: Device) -> Fault | None:
    misplaced = sorted({"rows", "cols"} & stream.options.keys())
    if misplaced:
        return "options", f"must not contain {' and '.join(misplaced)}: write them as keys of the pad"
    if device.needs_wiring and "wiring" in stream.options:
        return "options.wiring", "must be left out: the address in port determines it"
    options = device_options(stream)
    try:
        known = sorted(device.parameters().keys() - (options.keys() - stream.options.keys()))
        if unknown := sorted(stream.options.keys() - set(known)):
            near = difflib.get_close_matches(unknown[0], known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(known) or 'none'}"
            return f"options.{unknown[0]}", f"unknown option of {device.name}; {hint}"
        made = (device.session or device.decoder)(**options)
    except (TypeError, ValueError, OverflowError) as error:
        return "options", str(error)
    except ZeroDivisionError:  # two rows of a table are equal, which `gripper_faults` reports
        return None
    except Exception as error:  # of a device of another package
        return "device", f"{device.name!r} cannot be used: {type(error).__name__}: {error}"
    needed = GripperSession if device.kind == "gripper" else Session if device.session else Decoder
    if isinstance(made, needed):
        return None
    return "device", f"{device.name!r} cannot be used: it makes no slipd.devices.{needed.__name__}"
