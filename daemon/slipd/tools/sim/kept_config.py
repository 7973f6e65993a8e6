"""Keeps what changed in the copy of a config while its devices were emulated, such as what was commissioned."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from difflib import SequenceMatcher
from pathlib import Path

ENDING = ".commissioned"
"""Before the suffix of the name of a kept config."""


def with_changes(source: str, copy: str, now: str, addresses: Mapping[str, str]) -> str:
    """Return a config with the lines that changed in its copy; ports, identities and the bus stay its own.

    Args:
        source: The config.
        copy: Its copy as it was written, line for line, with the addresses of the emulated devices.
        now: The copy as it is now.
        addresses: Address of the emulated device of each port of ``source``.
    """
    before, after, lines = copy.splitlines(), now.splitlines(), source.splitlines()
    found: list[str] = []
    for kind, first, last, new_first, new_last in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if kind == "equal":
            found += lines[first:last]
        else:
            found += [_with_port(line, addresses) for line in after[new_first:new_last]]
    return "\n".join(found) + "\n"


def keep(text: str, name: str, folder: Path) -> Path:
    """Write a config under a name that is free, and return its path.

    Args:
        text: The config.
        name: Name of the file that it comes from.
        folder: Where to write it; if that fails, a new temporary folder takes its place.

    Raises:
        OSError: The temporary folder cannot be written either.
    """
    try:
        return _write(text, name, folder)
    except OSError:
        return _write(text, name, Path(tempfile.mkdtemp(prefix="slipd-commissioned-")))


def _write(text: str, name: str, folder: Path) -> Path:
    stem, suffix = Path(name).stem, Path(name).suffix
    path, number = folder / f"{stem}{ENDING}{suffix}", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}{ENDING}-{number}{suffix}"
    with path.open("x", encoding="utf-8") as file:
        file.write(text)
    return path


def _with_port(line: str, addresses: Mapping[str, str]) -> str:
    for port, address in addresses.items():
        line = line.replace(json.dumps(address), json.dumps(port))
    return line
