"""Write a result beside its place, and put it there only when it is whole."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from slipd.errors import SlipdError
from slipd.recording.reader import is_recording


@contextlib.contextmanager
def draft(out: Path, kind: str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a path to write to, which becomes ``out`` at the end; after an error nothing of it stays.

    Args:
        out: The result: a file or a folder.
        kind: Ending of the files in a folder that may be overwritten, e.g. ".csv".
        overwrite: Replace an earlier result.

    Raises:
        SlipdError: ``out`` exists and may not be overwritten, or it cannot be written.
    """
    _check(out, kind, overwrite=overwrite)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".draft", dir=out.parent))
    except OSError as error:
        raise _unwritable(out, error) from error
    try:
        yield folder / out.name
        _place(folder / out.name, out, folder / "replaced")
    except OSError as error:
        raise _unwritable(out, error) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check(out: Path, kind: str, *, overwrite: bool) -> None:
    if not os.path.lexists(out):
        return
    if not overwrite:
        raise SlipdError(f"{out}: exists already; give a new name, or --overwrite")
    if out.is_symlink() or not (out.is_file() or out.is_dir()):
        raise SlipdError(f"{out}: only a file or a folder can be overwritten")
    if out.is_file() and is_recording(out):
        raise SlipdError(f"{out}: is a recording of slipd, and is not overwritten")
    for path in sorted(out.iterdir()) if out.is_dir() else ():
        if not path.is_file() or path.suffix not in (kind, ".yaml") or is_recording(path):
            raise SlipdError(f"{out}: is a folder that also holds {path.name!r}, and is not overwritten")


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
