"""Unbuffered output of an MCAP writer, which can be cut back to the last complete record."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path


class RecordStream:
    """A new file, written record by record.

    Nothing is buffered here, so no part of a failed record can reach the file later.

    Args:
        path: File to create; an existing one is never overwritten.

    Raises:
        OSError: The file exists or cannot be created. All methods except `cut_back`, `remove` and `close` raise it when
            the disk fails.
    """

    def __init__(self, path: Path) -> None:
        # A device file exists already, and holds nothing that could be lost.
        self._file = path.open("wb" if path.is_char_device() else "xb", buffering=0)
        self._path = path
        self._written = self._whole = 0

    def write(self, data: bytes) -> int:
        """Write all of ``data``; a disk that is nearly full may take only a part at first."""
        rest = memoryview(data)
        while rest:
            count = self._file.write(rest) or 0
            self._written += count
            rest = rest[count:]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._written

    def flush(self) -> None:
        """Mark everything written so far as complete records; the kernel has them already."""
        self._whole = self._written

    def sync(self) -> None:
        """Pass everything to the disk, so that it survives a power cut; a file that was deleted is a failed disk."""
        os.fdatasync(self._file.fileno())
        if not os.fstat(self._file.fileno()).st_nlink:
            raise OSError(errno.ENOENT, "the file was deleted while it was written")

    def free_bytes(self) -> int:
        """Return the free space of the disk, bytes."""
        found = os.fstatvfs(self._file.fileno())
        return found.f_bavail * found.f_frsize

    def cut_back(self) -> None:
        """Remove everything after the last `flush`; leave a device file unchanged."""
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._whole)
            self._file.seek(self._whole)
        self._written = self._whole

    def remove(self) -> None:
        """Remove the file from its folder."""
        with suppress(OSError):
            if not self._path.is_char_device():
                self._path.unlink()

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            self._file.close()
