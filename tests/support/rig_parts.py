"""The parts of a rig as processes, which share the runtime directory of a folder."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ENDS_S = 10.0


@contextmanager
def part(folder: Path, name: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a module until the block ends; it starts beside what follows, and `first_line` waits for it."""
    with subprocess.Popen(
        [sys.executable, "-m", name, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")},
    ) as process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(ENDS_S)
            except subprocess.TimeoutExpired:
                process.kill()


def first_line(process: subprocess.Popen[str]) -> str:
    """Wait for the first line that a part prints, and return it."""
    assert process.stdout is not None
    line = process.stdout.readline().strip()
    assert line, f"{process.args} ended at its start"
    return line
