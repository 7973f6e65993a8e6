"""Warnings of `slipd check` about one stream: port, what its device needs, options that contradict each other."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator
from pathlib import Path

from slipd.config.stream_model import Stream
from slipd.config.stream_settings import device_options, transport_of
from slipd.config.value_bounds import MARGIN
from slipd.devices import DEVICES, Device, Need

NUMBERED_PORT = re.compile(r"/dev/tty(USB|ACM)\d+")
STABLE_NAMES = (Path("/dev/serial/by-id"), Path("/dev/serial/by-path"))

OPTIONS = "options."


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


def _option(device: Device, options: object) -> float | None:
    """Return the value of the option that sets the rate, or its default; None if there is no such option."""
    if device.rate_option is None:
        return None
    name = device.rate_option.name
    default = inspect.signature(device.session or device.decoder).parameters[name].default
    value = options.get(name, default) if isinstance(options, dict) else default
    return float(value)


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
    for folder in STABLE_NAMES:
        for name in sorted(folder.iterdir()) if folder.is_dir() else ():
            if name.resolve() == port.resolve():
                return name
    return None
