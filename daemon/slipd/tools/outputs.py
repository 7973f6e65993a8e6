"""Write a result beside its place, and put it there only when it is whole; also as a Parquet file.

Every command that writes a file or folder of its own writes it here: what the command reads is never its output, and
nothing but an earlier result of the same kind is ever replaced. pyarrow is loaded by the commands that need it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from slipd.errors import RecordingError, SlipdError, UsageError, printable

if TYPE_CHECKING:
    from slipd.recording.reader import Recording


@dataclass(frozen=True, slots=True)
class Kind:
    """Kind of a result.

    Attributes:
        name: Its name with an article.
        is_one: Returns whether a file is of this kind, or a file or folder is part of a folder of this kind.
        folders: A result may be a folder.
        replaceable: The command that makes it has ``--overwrite``.
    """

    name: str
    is_one: Callable[[Path], bool]
    folders: bool = False
    replaceable: bool = True


NEW = Kind("new", lambda _: False, replaceable=False)
"""What replaces nothing, such as a recording or a config."""


SLIPD = b"\x05\0\0\0slipd"
"""A text of an MCAP header with its length: the profile of a recording, or the library that wrote an export."""


def first_bytes(path: Path, most: int) -> bytes:
    """Return the beginning of a file, by which its kind is known; nothing of one that cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError:
        return b""


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording of slipd, by the profile in its header; complete and intact or not."""
    return first_bytes(path, 26)[17:] == SLIPD  # after magic bytes, and kind and length of the header


@contextlib.contextmanager
def draft(out: Path, kind: Kind, inputs: Iterable[Path] = (), *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a path to write to, which becomes ``out`` at the end; after an error nothing of it stays.

    Args:
        out: The result: a file or a folder.
        kind: What it is.
        inputs: What the command reads.
        overwrite: Replace an earlier result of this kind; nothing else is ever replaced.

    Raises:
        UsageError: ``out`` is read by the command, or exists and may not be overwritten.
        SlipdError: It cannot be written.
    """
    for path in inputs:
        if path.exists() and out.exists() and path.samefile(out):
            raise UsageError(f"{out}: is read by this command, and cannot be its output too; give another name")
    _check(out, kind, overwrite=overwrite)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".draft", dir=out.parent))
    except OSError as error:
        raise _unwritable(out, error) from error
    try:
        yield folder / out.name
        _check(out, kind, overwrite=overwrite)  # it may have come meanwhile
        _place(folder / out.name, out, folder / "replaced")
    except OSError as error:
        raise _unwritable(out, error) from error
    except RecordingError as error:
        raise RecordingError(str(error).replace(str(folder / out.name), str(out))) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check(out: Path, kind: Kind, *, overwrite: bool) -> None:
    if not os.path.lexists(out):
        return
    if not overwrite:
        raise UsageError(f"{out}: exists already; give a new name{', or --overwrite' if kind.replaceable else ''}")
    if (why := _obstacle(out, kind)) is not None:
        raise UsageError(f"{out}: {why}, and is not overwritten; give another name")
    if not os.access(out, os.W_OK):
        raise _unwritable(out, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


def _obstacle(out: Path, kind: Kind) -> str | None:
    """Return why something must not be replaced, as the end of a sentence about it."""
    if out.is_symlink():
        return "is a symbolic link"
    if out.is_dir():
        if not kind.folders:
            return "is a folder"
        there = sorted(out.iterdir())  # a pipe or a device never belongs to a result
        others = (path.name for path in there if not ((path.is_file() or path.is_dir()) and kind.is_one(path)))
        other = next(others, None)
        return None if other is None else f"is a folder that also holds {other!r}"
    if not out.is_file():
        return "is not a regular file"
    if is_recording(out):
        return "is a recording of slipd"
    return None if kind.is_one(out) else f"is not {kind.name}"


def _place(written: Path, out: Path, aside: Path) -> None:
    """Move the result to its place; an earlier one is moved away first, because a folder cannot replace another."""
    if os.path.lexists(out):
        out.rename(aside)
    try:
        written.rename(out)
    except BaseException:
        if os.path.lexists(aside):
            aside.rename(out)
        raise


def _unwritable(out: Path, error: OSError) -> SlipdError:
    return SlipdError(f"{out}: cannot be written: {error.strerror or error}")


def all_complete(recordings: Iterable[Recording], what: str = "recording") -> bool:
    """Return whether recordings are complete; print what is missing of each that is not.

    Args:
        recordings: Recordings that were read to their end.
        what: What is incomplete, for people.
    """
    faults = [recording.missing for recording in recordings if recording.missing]
    for fault in faults:
        print(f"slipd: the {what} is incomplete: {printable(fault)}", file=sys.stderr)
    return not faults


MARK = "slipd_export"
"""Key in the metadata that marks a file as part of an export of slipd."""


def parquet_library(option: str, extra: str = "parquet") -> tuple[ModuleType, ModuleType]:
    """Return ``pyarrow`` and ``pyarrow.parquet``.

    Args:
        option: What needs them, for the error.
        extra: Extra of the package slipd that installs them, for the error.

    Raises:
        UsageError: pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise UsageError(f"{option} needs the package pyarrow: pip install 'slipd[{extra}]'") from error
    return pyarrow, parquet


def storable(text: str) -> str:
    r"""Return a text that Arrow can store: an undecodable byte of a file name becomes an escape such as ``\xff``."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


@contextlib.contextmanager
def parquet_file(path: Path, schema: Any) -> Iterator[Callable[[Any], None]]:
    """Create a file, and yield what writes an Arrow table of this schema as one row group.

    Raises:
        OSError: The file cannot be written.
    """
    from pyarrow import parquet

    marked = schema.with_metadata({**(schema.metadata or {}), MARK: "1"})
    with path.open("xb") as file:
        writer = parquet.ParquetWriter(file, marked, compression="zstd")
        try:
            yield writer.write_table
            writer.close()
        finally:
            writer.is_open = False  # after a failure its destructor would try again


@contextlib.contextmanager
def parquet_rows(path: Path, schema: Any, at_once: int) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Create a file, and yield what writes a row, a value for each column that is known; errors are as above.

    Args:
        path: File to create.
        schema: Its Arrow schema.
        at_once: Rows that are kept in memory until they are written as one row group.
    """
    import pyarrow as arrow

    rows: list[dict[str, Any]] = []
    with parquet_file(path, schema) as put:

        def flush() -> None:
            put(arrow.Table.from_pylist(rows, schema=schema))
            rows.clear()

        def add(row: dict[str, Any]) -> None:
            rows.append(row)
            if len(rows) == at_once:
                flush()

        yield add
        if rows:
            flush()


def stored_schema(path: Path, option: str, extra: str = "parquet") -> Any:
    """Return the schema of a file; None if it is no Parquet file. The other arguments are those of `parquet_library`.

    Raises:
        UsageError: pyarrow is not installed.
    """
    arrow, parquet = parquet_library(option, extra)
    try:
        return parquet.read_schema(path)
    except (OSError, arrow.ArrowInvalid):
        return None
