"""Recognise the files of an export."""

from __future__ import annotations

from pathlib import Path

from slipd.recording.reader import is_recording
from slipd.tools.draft import Kind
from slipd.tools.export.message_columns import LOG_TIME
from slipd.tools.export.parquet_file import is_marked

_MCAP_LIBRARY = b"\x05\0\0\0slipd"
"""Name of the library in the header of an exported MCAP file, with its length."""

ROBOT = "slipd"
"""``robot_type`` of a data set for learning, and the first key of its ``meta/info.json``."""

DATASET_FOLDERS = ("meta", "data")


def is_exported(path: Path) -> bool:
    """Return whether a file is one of an export, by its first bytes; a bag's metadata by its name.

    A folder is one if it belongs to a data set for learning and holds nothing else.
    """
    if path.is_dir():
        return path.name in DATASET_FOLDERS and _of_dataset(path)
    if path.name == "metadata.yaml":
        return True
    try:
        with path.open("rb") as file:
            start = file.read(64)
        if start.startswith(b"PAR1"):
            return is_marked(path)
    except OSError:
        return False
    return start.startswith(f"{LOG_TIME},".encode()) or (_MCAP_LIBRARY in start and not is_recording(path))


def _of_dataset(folder: Path) -> bool:
    """Return whether a folder of a data set holds only what slipd wrote there."""
    info = folder.parent / "meta" / "info.json"
    try:
        ours = f'"robot_type": "{ROBOT}"' in info.read_text(encoding="utf-8")[:64]
    except (OSError, ValueError):
        return False
    known = {info, info.with_name("stats.json")}
    inside = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    return ours and all(path.is_file() and (path in known or is_exported(path)) for path in inside)


EXPORT = Kind("an export of slipd", is_exported, folders=True)
