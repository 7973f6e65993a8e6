"""Write a result beside its place, and put it there only when it is whole."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from slipd.errors import SlipdError
from slipd.export.csv_files import LOG_TIME
from slipd.recording.reader import is_recording

_MCAP_LIBRARY = b"\x05\0\0\0slipd"
"""Name of the library in the header of an exported MCAP file, with its length."""


@contextlib.contextmanager
def draft(out: Path, *, overwrite: bool) -> Iterator[Path]:
    """Yield a path to write to, which becomes ``out`` at the end; after an error nothing of it stays.

    Args:
        out: The result: a file or a folder.
        overwrite: Replace an earlier export; nothing else is ever replaced.

    Raises:
        SlipdError: ``out`` exists and may not be overwritten, or it cannot be written.
    """
    _check(out, overwrite=overwrite)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".draft", dir=out.parent))
    except OSError as error:
        raise _unwritable(out, error) from error
    try:
        yield folder / out.name
        _check(out, overwrite=overwrite)  # it may have come meanwhile
        _place(folder / out.name, out, folder / "replaced")
    except OSError as error:
        raise _unwritable(out, error) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check(out: Path, *, overwrite: bool) -> None:
    if not os.path.lexists(out):
        return
    if not overwrite:
        raise SlipdError(f"{out}: exists already; give a new name, or --overwrite")
    if out.is_symlink() or not (out.is_file() or out.is_dir()):
        raise SlipdError(f"{out}: only a file or a folder can be overwritten")
    if out.is_file() and is_recording(out):
        raise SlipdError(f"{out}: is a recording of slipd, and is not overwritten")
    if out.is_file() and not _is_exported(out):
        raise SlipdError(f"{out}: is not an export of slipd, and is not overwritten")
    for path in sorted(out.iterdir()) if out.is_dir() else ():
        if not path.is_file() or not _is_exported(path):
            raise SlipdError(f"{out}: is a folder that also holds {path.name!r}, and is not overwritten")


def _is_exported(path: Path) -> bool:
    """Return whether a file is one of an export, by its first bytes; a bag's metadata by its name."""
    if path.name == "metadata.yaml":
        return True
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError:
        return False
    return start.startswith(f"{LOG_TIME},".encode()) or (_MCAP_LIBRARY in start and not is_recording(path))


def _place(written: Path, out: Path, aside: Path) -> None:
    """Move the result to its place; an earlier one is moved away first, because a folder cannot replace another."""
    written.chmod(0o777 & ~_umask() if written.is_dir() else 0o666 & ~_umask())
    if os.path.lexists(out):
        out.rename(aside)
    try:
        written.rename(out)
    except BaseException:
        if os.path.lexists(aside):
            aside.rename(out)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _unwritable(out: Path, error: OSError) -> SlipdError:
    return SlipdError(f"{out}: cannot be written: {error.strerror or error}")
