"""The options of every device, and parts of docstrings in Google style, as Markdown for the page of the config."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator
from inspect import Parameter
from typing import Any

from slipd.devices import SLIPD, Device, installed

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


def option_rows() -> Iterator[tuple[str, ...]]:
    """Yield device, option, type, default and meaning of every option."""
    for each in installed():
        if each.package == SLIPD and each.device is not None:
            for row in options_of(each.device):
                yield f"`{each.name}`", *row


def options_of(device: Device) -> Iterator[tuple[str, str, str, str]]:
    """Yield option, type, default and meaning of every option of a device."""
    for option, parameter in _parameters(device).items():
        annotation = str(parameter.annotation)
        yield f"`{option}`", _TYPES.get(annotation, annotation), _default(parameter), _text(device, option)


def _parameters(device: Device) -> dict[str, Parameter]:
    """Return the options of a device: those of its session, and those that it hands on to the decoder."""
    found: dict[str, Parameter] = {}
    for taker in (device.session, device.decoder) if _hands_on(device) else (device.session or device.decoder,):
        if taker is not None:
            found = dict(inspect.signature(taker).parameters) | found
    return {name: each for name, each in found.items() if name not in _KEYS and each.kind is not Parameter.VAR_KEYWORD}


def _hands_on(device: Device) -> bool:
    parameters = inspect.signature(device.session or device.decoder).parameters
    return any(each.kind is Parameter.VAR_KEYWORD for each in parameters.values())


def _text(device: Device, option: str) -> str:
    text = arguments_of(device.session or device.decoder).get(option, "See `Decoder`.")
    decoder = arguments_of(device.decoder).get(option, "")
    return text.replace("See `Decoder`", decoder.rstrip(".")) if "See `Decoder`" in text else text


def _default(parameter: Parameter) -> str:
    if parameter.default is Parameter.empty:
        return "required"
    if parameter.default is None:
        return "left out"
    return f"`{json.dumps(parameter.default)}`"


def summary_of(documented: Any) -> str:
    """Return what a class is: its first paragraph, without the name of the table."""
    first = (inspect.getdoc(documented) or "").partition("\n\n")[0]
    return _markdown(re.sub(r"^``\[?[\w.]+\]?``[:.]? ?", "", first))


def attributes_of(documented: Any) -> dict[str, str]:
    """Return the texts of the section "Attributes" by name."""
    return _section(documented, "Attributes")


def arguments_of(documented: Any) -> dict[str, str]:
    """Return the texts of the section "Args" by name."""
    return _section(documented, "Args")


def _section(documented: Any, title: str) -> dict[str, str]:
    _, _, rest = (inspect.getdoc(documented) or "").partition(f"{title}:\n")
    body = re.split(r"^\S", rest, maxsplit=1, flags=re.MULTILINE)[0]
    _, *parts = _ENTRY.split(body)
    return {name: _markdown(text) for name, text in zip(parts[::2], parts[1::2], strict=True)}


def sentence(text: str) -> str:
    """Return a text that begins with a capital, unless it begins with code."""
    return text[:1].upper() + text[1:]


def _markdown(text: str) -> str:
    """Return a text on one line, with the words of a config for those of Python."""
    line = " ".join(text.split()).replace("``", "`").replace("|", "\\|")
    line = re.sub(r"(^|\. )None\b", r"\1Left out", line)
    return sentence(re.sub(r"\bNone\b", "left out", line))
