"""One Parquet file of an export."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from slipd.tools.parquet_library import parquet_library

MARK = "slipd_export"
"""Key in the metadata that marks a file as part of an export of slipd."""

COMPRESSION = "zstd"


class ParquetFile:
    """Writes the file.

    Args:
        path: File to create.
        schema: Arrow schema of its tables.
    """

    def __init__(self, path: Path, schema: Any) -> None:
        _, parquet = parquet_library("--to parquet")
        self.path = path
        metadata = {**(schema.metadata or {}), MARK: "1"}
        self._file = path.open("xb")
        self._writer = parquet.ParquetWriter(self._file, schema.with_metadata(metadata), compression=COMPRESSION)

    def write(self, table: Any) -> None:
        """Write an Arrow table as one row group."""
        self._writer.write_table(table)

    def finish(self) -> None:
        """Complete the file and close it."""
        self._writer.close()
        self._file.close()

    def close(self) -> None:
        """Close the file as it is; does nothing after `finish`."""
        with contextlib.suppress(Exception):
            self._writer.close()
        self._writer.is_open = False  # its destructor would try again
        with contextlib.suppress(OSError):
            self._file.close()


def is_marked(path: Path) -> bool:
    """Return whether a file is a Parquet file of an export, by the metadata at its end.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        file.seek(0, 2)
        size = file.tell()
        if size < 12:
            return False
        file.seek(size - 8)
        length, magic = int.from_bytes(file.read(4), "little"), file.read(4)
        if magic != b"PAR1" or length > size - 12:
            return False
        file.seek(size - 8 - length)
        return MARK.encode() in file.read(length)
