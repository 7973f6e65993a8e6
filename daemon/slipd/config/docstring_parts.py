"""Parts of a docstring in Google style, as Markdown for the page of the config."""

from __future__ import annotations

import inspect
import re
from typing import Any

_ENTRY = re.compile(r"^    (\w+): ", re.MULTILINE)


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
