"""Recognise the files of an export."""

from __future__ import annotations

from pathlib import Path

from slipd.draft import Kind
from slipd.export.csv_files import LOG_TIME
from slipd.recording.reader import is_recording

_MCAP_LIBRARY = b"\x05\0\0\0slipd"
"""Name of the library in the header of an exported MCAP file, with its length."""


def is_exported(path: Path) -> bool:
    """Return whether a file is one of an export, by its first bytes; a bag's metadata by its name."""
    if path.name == "metadata.yaml":
        return True
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError:
        return False
    return start.startswith(f"{LOG_TIME},".encode()) or (_MCAP_LIBRARY in start and not is_recording(path))


EXPORT = Kind("an export of slipd", is_exported, folders=True)
