"""Faults of one stream: its device, port, sensor, rate, staleness and device options."""

from __future__ import annotations

from urllib.parse import urlsplit

from slipd.config.stream_model import Stream
from slipd.config.stream_settings import device_options, stale_after_ns, transport_of
from slipd.config.value_bounds import MARGIN, Fault
from slipd.devices import DEVICES, SLIPD, Decoder, Device, GripperSession, Session, find_device
from slipd.devices.shared.other_packages import is_installed, normalized

_KINDS = {
    "wrench": ("wrench",),
    "tactile": ("tactile",),
    "gripper": ("gripper",),
    "any": ("wrench", "tactile", "object"),
}
_ADDRESSES = {
    "serial": "the path of a serial port",
    "tcp": "tcp://HOST:PORT",
    "udp": "udp://HOST:PORT",
    "websocket": "ws://HOST:PORT",
    "external": "ipc:///PATH",
    "local": "unix:///PATH",
}

BITS_PER_BYTE = 10
"""Bits per byte on a serial line with 8N1 framing."""

STALE_S, STALE_S_PERIODS = 0.01, 1.5
"""Smallest ``stale_s``, in s and in periods: silence is checked every 5 ms, and one reading may be missed."""

STALE_MOST_S, STALE_MOST_PERIODS = 0.5, 10.0
"""Largest ``stale_s``, in s or in periods, whichever is longer: a verdict must not rest on a dead sensor."""


def stream_faults(path: str, stream: Stream, kind: str) -> list[Fault]:
    """Find the faults of a stream, except those that only other streams show.

    Args:
        path: Key path of the stream.
        stream: The stream.
        kind: Kind of device that belongs here: "wrench", "tactile", "gripper" or "object".
    """
    faults = _package_faults(path, stream)
    if faults:
        return faults
    device = DEVICES.get(stream.device)
    if device is None or kind not in _KINDS[device.kind]:
        known = ", ".join(sorted(name for name, known in DEVICES.items() if kind in _KINDS[known.kind]))
        return [(f"{path}.device", f"must be a {kind} device, got {stream.device!r}; known: {known}")]
    return (
        _port_faults(path, stream, device)
        or _sensor_faults(path, stream, device)
        or _rate_faults(path, stream, device)
        or _staleness_faults(path, stream)
        or _option_faults(path, stream, device)
    )


def _package_faults(path: str, stream: Stream) -> list[Fault]:
    """Find a package that is not installed, or that does not provide a device that can be used."""
    found, key = find_device(stream.device), f"{path}.package"
    if found is None:
        if not stream.package:
            return []
        why = "does not provide it" if is_installed(stream.package) else "is not installed"
        return [(key, f"{stream.device!r} needs the package {stream.package!r}, which {why}: install it with pip")]
    if found.fault:
        return [(f"{path}.device", f"{stream.device!r} of {found.package} cannot be used: {found.fault}")]
    if normalized(found.package) == normalized(stream.package or SLIPD):
        return []
    if found.package == SLIPD:
        return [(key, f"must be left out: {stream.device!r} is a device of slipd, got {stream.package!r}")]
    return [(key, f"must be {found.package!r}, the package that provides {stream.device!r}, got {stream.package!r}")]


def _port_faults(path: str, stream: Stream, device: Device) -> list[Fault]:
    if transport_of(stream.port) not in device.transports:
        right = " or ".join(_ADDRESSES[transport] for transport in device.transports)
        return [(f"{path}.port", f"must be {right} for {stream.device}, got {stream.port!r}")]
    wrong = _address_fault(stream.port)
    if wrong:
        return [(f"{path}.port", f"must be {_ADDRESSES[transport_of(stream.port)]}, got {stream.port!r}: {wrong}")]
    return []


def _address_fault(port: str) -> str:
    """Return what is wrong with a network address, "" if nothing is; paths and endpoints are checked when opened."""
    transport = transport_of(port)
    if transport in ("serial", "external", "local"):
        return ""
    try:
        parts = urlsplit(port)
        host, number = parts.hostname, parts.port
        (host or "").encode("idna")
    except ValueError as error:
        return f"not an address ({error})"
    if not host:
        return "no host"
    if number == 0 or (number is None and transport != "websocket"):
        return "no port from 1 to 65535"
    return ""


def _sensor_faults(path: str, stream: Stream, device: Device) -> list[Fault]:
    key = f"{path}.sensor"
    if device.shared and not stream.sensor:
        return [(key, f'must name one sensor of the port, such as "1": a {stream.device} port carries several')]
    if stream.sensor and not device.shared:
        return [(key, f"must be left out: a {stream.device} port carries one sensor")]
    if device.sensors and stream.sensor not in device.sensors:
        known = " or ".join(f'"{sensor}"' for sensor in device.sensors)
        return [(key, f"must be {known}, the sensors of {stream.device}, got {stream.sensor!r}")]
    return []


def _rate_faults(path: str, stream: Stream, device: Device) -> list[Fault]:
    """Find a rate that the device does not have, or that its line cannot carry."""
    low_hz, high_hz = device.rates_hz
    if not low_hz / MARGIN <= stream.rate_hz <= high_hz * MARGIN:
        rule = f"must be from {low_hz:.4g} to {high_hz:.4g} Hz, the rates of {stream.device}, got {stream.rate_hz:g}"
        hint = f": did you mean a period of {stream.rate_hz:g} s? write {1.0 / stream.rate_hz:g}"
        is_period = low_hz <= 1.0 / stream.rate_hz <= high_hz and stream.rate_hz < low_hz
        return [(f"{path}.rate_hz", rule + hint if is_period else rule)]
    baud = stream.baud or device.baud
    needed = stream.rate_hz * device.frame_bytes * BITS_PER_BYTE
    if baud is None or transport_of(stream.port) != "serial" or needed <= baud:
        return []
    carried_hz = baud / (device.frame_bytes * BITS_PER_BYTE)
    rule = f"must be at most {carried_hz:.0f} Hz, the most that {stream.device} can send at {baud} bit/s"
    return [(f"{path}.rate_hz", f"{rule}, got {stream.rate_hz:g}; lower it or raise baud (default {device.baud})")]


def _staleness_faults(path: str, stream: Stream) -> list[Fault]:
    least_s = max(STALE_S, STALE_S_PERIODS / stream.rate_hz)
    most_s = max(STALE_MOST_S, STALE_MOST_PERIODS / stream.rate_hz)
    if stream.stale_s is not None and not least_s <= stream.stale_s <= most_s:
        rule = f"must be from {least_s:g} to {most_s:g} s at rate_hz = {stream.rate_hz:g}, got {stream.stale_s:g}"
        return [(f"{path}.stale_s", rule)]
    stale_s = stale_after_ns(stream) * 1e-9
    if stream.delay_s >= stale_s:
        rule = f"must be less than {stale_s:g} s, or every reading would be stale, got {stream.delay_s:g}"
        return [(f"{path}.delay_s", f"{rule}; raise stale_s")]
    return []


def _option_faults(path: str, stream: Stream, device: Device) -> list[Fault]:
    misplaced = sorted({"rows", "cols"} & stream.options.keys())
    if misplaced:
        return [(f"{path}.options", f"must not contain {' and '.join(misplaced)}: write them as keys of the pad")]
    if device.needs_wiring and "wiring" in stream.options:
        return [(f"{path}.options.wiring", "must be left out: the address in port determines it")]
    try:
        made = (device.session or device.decoder)(**device_options(stream))
    except (TypeError, ValueError, OverflowError) as error:
        return [(f"{path}.options", str(error))]
    except ZeroDivisionError:  # two rows of a table are equal, which `gripper_faults` reports
        return []
    except Exception as error:  # of a device of another package
        return [(f"{path}.device", f"{device.name!r} cannot be used: {type(error).__name__}: {error}")]
    needed = GripperSession if device.kind == "gripper" else Session if device.session else Decoder
    if not isinstance(made, needed):
        return [(f"{path}.device", f"{device.name!r} cannot be used: it makes no slipd.devices.{needed.__name__}")]
    return []
