"""``slipd devices``: the installed devices, where each comes from, and what its decoder was compared with."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator
from inspect import Parameter
from typing import Any

from slipd.devices import EVIDENCE, Device, Installed, find_device, installed
from slipd.errors import UsageError, one_line
from slipd.tools.cli_arguments import aligned

TITLES = ("device", "kind", "line", "package", "evidence")
_ENTRY = re.compile(r"^    (\w+): ", re.MULTILINE)
_TYPES = {
    "int": "integer",
    "int | None": "integer",
    "float": "number",
    "bool": "true, false",
    "str": "text",
    "Sequence[float]": "list of numbers",
    "Sequence[Sequence[float]] | None": "list of lists of numbers",
}
_KEYS = {"rows", "cols", "wiring", "force_table", "width_table", "speed_table"}
"""Arguments of a decoder or session that follow from other keys of the config."""


def print_devices(name: str | None, *, as_json: bool) -> None:
    """Print every installed device; then those that cannot be used, each with its package and why.

    Args:
        name: Describe only this device; None: list all.
        as_json: Print one JSON document.

    Raises:
        UsageError: The device is not installed, or cannot be used.
    """
    if name is not None:
        _describe(*usable_device(name), as_json=as_json)
        return
    usable = [each for each in installed() if each.device is not None]
    faulty = [each for each in installed() if each.device is None]
    if as_json:
        faults = [{"device": one_line(each.name), "fault": one_line(each.fault)} for each in faulty]
        print(json.dumps([*map(_summary, usable), *faults], ensure_ascii=False))
        return
    for line in aligned([TITLES, *(tuple(_summary(each).values()) for each in usable)]):
        print(line)
    for each in faulty:
        print(f"{one_line(each.name)} of {package_of(each)} cannot be used: {one_line(each.fault)}")


def usable_device(name: str) -> tuple[Installed, Device]:
    """Return where a device comes from, and the device.

    Raises:
        UsageError: It is not installed, or cannot be used.
    """
    found = find_device(name)
    if found is None:
        raise UsageError(f"no device {name!r} is installed; `slipd devices` lists those that are")
    if found.device is None:
        raise UsageError(f"{name!r} of {package_of(found)} cannot be used: {found.fault}")
    return found, found.device


def _describe(found: Installed, device: Device, *, as_json: bool) -> None:
    """Print where a device comes from, its lines, rates and options, and its own description."""
    (low_hz, high_hz), options = device.rates_hz, list(options_of(device))
    if as_json:
        more = {"rates_hz": [low_hz, high_hz], "baud": device.baud, "about": device.about, "options": options}
        print(json.dumps(_summary(found) | more, ensure_ascii=False))
        return
    speed = f", {device.baud} bit/s" if device.baud else ""
    print(f"{found.name}: {device.kind}, {' or '.join(device.transports)}{speed}, {low_hz:g} to {high_hz:g} Hz")
    print(f"package: {package_of(found)}\nevidence: {EVIDENCE[device.evidence]}")
    for option, kind, default, meaning in options:
        print(f"option {option}: {kind}, default {default}. {meaning}")
    print(f"\n{device.about.strip()}" if device.about else "described in: slipd docs devices")


def _summary(each: Installed) -> dict[str, Any]:
    device: Any = each.device
    cells = (each.name, device.kind, ", ".join(device.transports), package_of(each), EVIDENCE[device.evidence])
    return dict(zip(TITLES, cells, strict=True))


def package_of(each: Installed) -> str:
    """Return the package of a device, with its version."""
    return f"{each.package} {each.version}".strip()


def options_of(device: Device) -> Iterator[tuple[str, str, str, str]]:
    """Yield option, type, default and meaning of every option of a device."""
    for option, parameter in device.parameters().items():
        if option not in _KEYS:
            annotation = str(parameter.annotation)
            yield f"`{option}`", _TYPES.get(annotation, annotation), _default(parameter), _text(device, option)


def _text(device: Device, option: str) -> str:
    text = section_of(device.session or device.decoder, "Args").get(option, "See `Decoder`.")
    decoder = section_of(device.decoder, "Args").get(option, "")
    return text.replace("See `Decoder`", decoder.rstrip(".")) if "See `Decoder`" in text else text


def _default(parameter: Parameter) -> str:
    if parameter.default is Parameter.empty:
        return "required"
    if parameter.default is None:
        return "left out"
    return f"`{json.dumps(parameter.default)}`"


def section_of(documented: Any, title: str) -> dict[str, str]:
    """Return the texts of the section "Args" or "Attributes" by name."""
    _, _, rest = (inspect.getdoc(documented) or "").partition(f"{title}:\n")
    body = re.split(r"^\S", rest, maxsplit=1, flags=re.MULTILINE)[0]
    _, *parts = _ENTRY.split(body)
    return {name: in_words(text) for name, text in zip(parts[::2], parts[1::2], strict=True)}


def sentence(text: str) -> str:
    """Return a text that begins with a capital, unless it begins with code."""
    return text[:1].upper() + text[1:]


def in_words(text: str) -> str:
    """Return a text on one line, with the words of a config for those of Python."""
    line = " ".join(text.split()).replace("``", "`").replace("|", "\\|")
    line = re.sub(r"(^|\. )None\b", r"\1Left out", line)
    return sentence(re.sub(r"\bNone\b", "left out", line))
