"""``slipd devices``: the installed devices, where each comes from, and what its decoder was compared with."""

from __future__ import annotations

import json
from typing import Any

from slipd.devices import EVIDENCE, Installed, find_device, installed
from slipd.errors import UsageError
from slipd.tools.device_options import options_of
from slipd.types.device_text import one_line

TITLES = ("device", "kind", "line", "package", "evidence")


def print_devices(name: str | None, *, as_json: bool) -> None:
    """Print every installed device; then those that cannot be used, each with its package and why.

    Args:
        name: Describe only this device; None: list all.
        as_json: Print one JSON document.

    Raises:
        UsageError: The device is not installed, or cannot be used.
    """
    if name is not None:
        _describe(_known(name), as_json=as_json)
        return
    usable = [each for each in installed() if each.device is not None]
    faulty = [each for each in installed() if each.device is None]
    if as_json:
        found = [_summary(each) for each in usable]
        faults = [{"device": one_line(each.name), "fault": one_line(each.fault)} for each in faulty]
        print(json.dumps(found + faults, ensure_ascii=False))
        return
    rows = [TITLES, *(tuple(_summary(each).values())[: len(TITLES)] for each in usable)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    for each in faulty:
        print(f"{one_line(each.name)} of {_package(each)} cannot be used: {one_line(each.fault)}")


def _known(name: str) -> Installed:
    found = find_device(name)
    if found is None:
        raise UsageError(f"no device {name!r} is installed; `slipd devices` lists those that are")
    if found.device is None:
        raise UsageError(f"{name!r} of {_package(found)} cannot be used: {found.fault}")
    return found


def _describe(found: Installed, *, as_json: bool) -> None:
    """Print where a device comes from, its lines, rates and options, and its own description."""
    device: Any = found.device
    (low_hz, high_hz), options = device.rates_hz, list(options_of(device))
    if as_json:
        more = {"rates_hz": [low_hz, high_hz], "baud": device.baud, "about": device.about, "options": options}
        print(json.dumps(_summary(found) | more, ensure_ascii=False))
        return
    speed = f", {device.baud} bit/s" if device.baud else ""
    print(f"{found.name}: {device.kind}, {' or '.join(device.transports)}{speed}, {low_hz:g} to {high_hz:g} Hz")
    print(f"package: {_package(found)}\nevidence: {EVIDENCE[device.evidence]}")
    for option, kind, default, meaning in options:
        print(f"option {option}: {kind}, default {default}. {meaning}")
    print(f"\n{device.about.strip()}" if device.about else "described in: slipd docs devices")


def _summary(each: Installed) -> dict[str, Any]:
    device: Any = each.device
    cells = (each.name, device.kind, ", ".join(device.transports), _package(each), EVIDENCE[device.evidence])
    return dict(zip(TITLES, cells, strict=True))


def _package(each: Installed) -> str:
    return f"{each.package} {each.version}".strip()
