"""``slipd devices``: the installed devices, where each comes from, and what its decoder was compared with."""

from __future__ import annotations

from slipd.config.option_tables import options_of
from slipd.devices import EVIDENCE, Device, Installed, find_device, installed
from slipd.errors import SlipdError
from slipd.types.device_text import one_line

TITLES = ("device", "kind", "line", "package", "evidence")


def print_devices(name: str | None) -> None:
    """Print every installed device; then those that cannot be used, each with its package and why.

    Args:
        name: Describe only this device; None: list all.

    Raises:
        SlipdError: The device is not installed, or cannot be used.
    """
    if name is not None:
        _describe(name)
        return
    rows = [TITLES, *(_row(each, each.device) for each in installed() if each.device is not None)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    for each in installed():
        if each.device is None:
            print(f"{one_line(each.name)} of {_package(each)} cannot be used: {one_line(each.fault)}")


def _describe(name: str) -> None:
    """Print where a device comes from, its lines, rates and options, and its own description."""
    found = find_device(name)
    if found is None:
        raise SlipdError(f"no device {name!r} is installed; `slipd devices` lists those that are")
    device = found.device
    if device is None:
        raise SlipdError(f"{name!r} of {_package(found)} cannot be used: {found.fault}")
    low_hz, high_hz = device.rates_hz
    speed = f", {device.baud} bit/s" if device.baud else ""
    print(f"{name}: {device.kind}, {' or '.join(device.transports)}{speed}, {low_hz:g} to {high_hz:g} Hz")
    print(f"package: {_package(found)}")
    print(f"evidence: {EVIDENCE[device.evidence]}")
    for option, kind, default, meaning in options_of(device):
        print(f"option {option}: {kind}, default {default}. {meaning}")
    print(f"\n{device.about.strip()}" if device.about else "described in: slipd docs devices")


def _row(each: Installed, device: Device) -> tuple[str, ...]:
    lines = ", ".join(device.transports)
    return each.name, device.kind, lines, _package(each), EVIDENCE[device.evidence]


def _package(each: Installed) -> str:
    return f"{each.package} {each.version}".strip()
