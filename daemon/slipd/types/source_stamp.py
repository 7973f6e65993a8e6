"""Identify the source code that made a result: compiled kernels, kept evaluations. Imports nothing slow."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path


@functools.cache
def source_stamp(folder: Path) -> str:
    """Return a hash of the names and contents of all Python files in and below a folder."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        text = path.read_bytes()
        digest.update(f"{path.relative_to(folder).as_posix()} {len(text)}\n".encode())
        digest.update(text)
    return digest.hexdigest()
