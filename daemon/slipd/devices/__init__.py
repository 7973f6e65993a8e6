"""Devices, each in one file or folder: decoders turn bytes into samples, gripper sessions turn permits into bytes.

The room is pure. `shared` has the common parts of the devices.

`DEVICES` maps names to devices. A device is a module or package of this folder with a ``DEVICE``, or the ``DEVICE`` of
another installed package, named by its entry points ``slipd.devices`` (docs/adding_a_device.md). It is loaded on first
use.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, distributions
from pkgutil import iter_modules

from slipd import __version__
from slipd.devices.shared.device_interface import (
    EVIDENCE,
    INTERFACE,
    Decoder,
    DecoderHealth,
    Device,
    Evidence,
    GripRange,
    Inquiry,
    Need,
    RateOption,
    Session,
)
from slipd.devices.shared.gripper_session import GripperSession

__all__ = [
    "DEVICES",
    "EVIDENCE",
    "INTERFACE",
    "Decoder",
    "DecoderHealth",
    "Device",
    "Evidence",
    "GripRange",
    "GripperSession",
    "Inquiry",
    "Installed",
    "Need",
    "RateOption",
    "Session",
    "find_device",
    "installed",
]

SLIPD = "slipd"
"""Name of the package that provides the devices of this folder."""

GROUP = "slipd.devices"
"""Group of the entry points; each names a device."""


@dataclass(frozen=True, slots=True)
class Installed:
    """An installed device.

    Attributes:
        name: Its name in a config.
        package: Package that provides it; "slipd" for the devices of this folder.
        version: Version of that package.
        device: The device; None if it cannot be used.
        fault: Why it cannot be used; "" if it can.
    """

    name: str
    package: str
    version: str
    device: Device | None
    fault: str = ""


def find_device(name: str) -> Installed | None:
    """Return what is installed by the name of a device; None if nothing is. Only that device is loaded."""
    if name in _modules():
        device = getattr(import_module(f"slipd.devices.{name}"), "DEVICE", None)
        if isinstance(device, Device):  # and not the folder of shared parts
            return Installed(name, SLIPD, __version__, device)
    return _other(name) if name in providers() else None


@cache
def providers() -> Mapping[str, Mapping[str, tuple[str, EntryPoint]]]:
    """Return version and entry point of the packages that provide a device, by its name and theirs; import none."""
    found: dict[str, dict[str, tuple[str, EntryPoint]]] = {}
    for package in distributions():
        with suppress(Exception):  # damaged metadata of some package
            for entry in package.entry_points.select(group=GROUP):
                packages = found.setdefault(entry.name, {})
                packages.setdefault(package.name, (package.version, entry))  # the first folder of the path counts
    return found


def is_installed(package: str) -> bool:
    """Return whether a package is installed, whatever it provides."""
    try:
        distribution(package)
    except (PackageNotFoundError, ValueError):
        return False
    return True


def normalized(package: str) -> str:
    """Return the name of a package as indexes compare it: "a_B" and "A-b" are one."""
    return re.sub(r"[-_.]+", "-", package).lower()


@cache
def installed() -> tuple[Installed, ...]:
    """Return all devices, those of this folder first, also those that cannot be used."""
    own = [found for name in _modules() if (found := find_device(name)) is not None and found.package == SLIPD]
    return (*own, *(_other(name) for name in sorted(providers())))


@cache
def _modules() -> tuple[str, ...]:
    return tuple(sorted(module.name for module in iter_modules(__path__)))


@cache
def _other(name: str) -> Installed:
    """Return the device that other packages provide by a name."""
    provided = providers()[name]
    package, (version, entry) = next(iter(provided.items()))
    packages = ", ".join(f"{each} {version}" for each, (version, _) in provided.items())
    if name in _modules():
        return Installed(name, packages, "", None, f"slipd {__version__} uses the name itself")
    if len(provided) > 1:
        return Installed(name, packages, "", None, "more than one package provides it; uninstall all but one")
    try:
        device = entry.load()
        fault = _misfit(name, device)
    except Exception as error:  # no package may stop the other devices
        fault = f"{entry.value} cannot be loaded: {type(error).__name__}: {error}"
    return Installed(name, package, version, None if fault else device, fault)


def _misfit(name: str, loaded: object) -> str:
    """Return why what a package provides is not a device that this slipd can use; "" if it is one."""
    if not isinstance(loaded, Device):
        return f"its entry point must name a slipd.devices.Device, got {type(loaded).__name__}"
    if loaded.name != name:
        return f"its entry point must have the name of the device, {loaded.name!r}, got {name!r}"
    if loaded.interface != INTERFACE:
        return f"it must be written for interface {INTERFACE} of slipd {__version__}, got {loaded.interface}"
    return ""


class _Devices(Mapping[str, Device]):
    """The devices that can be used, by name; a lookup loads only that device, iteration loads all."""

    def __getitem__(self, name: str) -> Device:
        found = find_device(name)
        if found is None or found.device is None:
            raise KeyError(name)
        return found.device

    def __iter__(self) -> Iterator[str]:
        return (each.name for each in installed() if each.device is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)


DEVICES: Mapping[str, Device] = _Devices()
