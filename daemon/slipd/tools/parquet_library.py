"""Loads pyarrow, which a few commands need and the daemon does not, and makes texts fit for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from slipd.errors import UsageError

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


@contextmanager
def parquet_file(path: Path, schema: Any) -> Iterator[Callable[[Any], None]]:
    """Create a file, and yield what writes an Arrow table of this schema as one row group.

    Raises:
        SlipdError: pyarrow is not installed.
        OSError: The file cannot be written.
    """
    _, parquet = parquet_library("--to parquet")
    marked = schema.with_metadata({**(schema.metadata or {}), MARK: "1"})
    with path.open("xb") as file:
        writer = parquet.ParquetWriter(file, marked, compression="zstd")
        try:
            yield writer.write_table
            writer.close()
        finally:
            writer.is_open = False  # after a failure its destructor would try again


@contextmanager
def parquet_rows(path: Path, schema: Any, at_once: int) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Create a file, and yield what writes a row, a value for each column that is known; errors are as above.

    Args:
        path: File to create.
        schema: Its Arrow schema.
        at_once: Rows that are kept in memory until they are written as one row group.
    """
    arrow, _ = parquet_library("--to parquet")
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
