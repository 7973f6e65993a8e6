"""Devices of other packages: the entry points ``slipd.devices`` of the installed distributions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, distributions

GROUP = "slipd.devices"
"""Group of the entry points; each names a device."""


@dataclass(frozen=True, slots=True)
class Provider:
    """A package that provides a device.

    Attributes:
        package: Name of the distribution.
        version: Its version.
        entry: Its entry point.
    """

    package: str
    version: str
    entry: EntryPoint

    def load(self) -> tuple[object, str]:
        """Return what the entry point names, and why it cannot be loaded; "" if it can."""
        try:
            return self.entry.load(), ""
        except Exception as error:  # no package may stop the other devices
            return None, f"{self.entry.value} cannot be loaded: {type(error).__name__}: {error}"


@cache
def providers() -> Mapping[str, tuple[Provider, ...]]:
    """Return the packages that provide a device, by its name; no package is imported."""
    found: dict[str, tuple[Provider, ...]] = {}
    seen: set[str] = set()
    for package in distributions():
        for each in _provided(package):
            if (key := f"{each.package} {each.entry.name}") not in seen:  # a later folder of the path is hidden
                seen.add(key)
                found[each.entry.name] = (*found.get(each.entry.name, ()), each)
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


def _provided(package: Distribution) -> Iterator[Provider]:
    try:
        for entry in package.entry_points.select(group=GROUP):
            yield Provider(package.name, package.version, entry)
    except Exception:  # damaged metadata of some package
        return
