"""A disk of its own that Linux makes read-only after an error, as it does with one that fails."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

SIZE_BYTES = 16 * 1024 * 1024


class BreakingDisk:
    """An ext4 file system in a file.

    Args:
        folder: Where it is mounted.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        mounts = (line.split() for line in Path("/proc/self/mounts").read_text(encoding="utf-8").splitlines())
        [device] = [source for source, place, *_ in mounts if place == str(folder)]
        self.trigger = Path("/sys/fs/ext4") / Path(device).name / "trigger_fs_error"

    def fail(self) -> None:
        """Let the kernel find an error: from now on nothing can be written, not even to a file that is open."""
        self.trigger.write_text("1", encoding="utf-8")


@contextmanager
def breaking_disk(folder: Path) -> Iterator[BreakingDisk]:
    """Mount a disk in a folder for the duration of ``with``; skip the test where this machine does not allow it."""
    if os.geteuid() != 0 or shutil.which("mkfs.ext4") is None:
        pytest.skip("needs root, who may mount, and mkfs.ext4")
    image, place = folder / "disk.img", folder / "disk"
    place.mkdir()
    image.touch()
    os.truncate(image, SIZE_BYTES)
    subprocess.run(["mkfs.ext4", "-q", "-F", str(image)], check=True)
    options = "loop,errors=remount-ro"
    mounted = subprocess.run(["mount", "-o", options, str(image), str(place)], capture_output=True, text=True)
    if mounted.returncode != 0:
        pytest.skip(f"this machine mounts nothing: {mounted.stderr.strip()}")
    try:
        disk = BreakingDisk(place)
        if not disk.trigger.exists():
            pytest.skip("this kernel cannot be told to find an error in ext4")
        yield disk
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)
