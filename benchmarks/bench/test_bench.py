"""The benchmark works: every section prints numbers, and an interrupt leaves no process and no file behind.

No test asserts a measured time.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from project import MODULES

QUICK = [sys.executable, "-m", "bench.latency", "--quick"]
ENVIRONMENT = os.environ | {"PYTHONPATH": MODULES}
SECTIONS = (
    "Chain",
    "Full load: two fingers",
    "Full load: the first",
    "Full load: messages",
    "Recording",
    "Replay",
    "Friction limit: ratios",
    "Friction limit: times",
    "Friction limit: one public call",
    "Torque limit certified",
    "Utilisation certified",
)
IN_WORDS = ("contacts", "wanted", "reached")
"""Columns that hold no numbers."""
START_S = 60.0
TRIES = 3
"""A machine that stalls for the whole of a quick window leaves nothing to measure in it."""


@pytest.fixture
def folder() -> Iterator[Path]:
    """A short path: that of a socket has at most 107 bytes."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def sections(report: str) -> dict[str, list[dict[str, str]]]:
    """Title → rows of its table by column."""
    found = {}
    for part in report.split("\n## ")[1:]:
        title, *lines = part.splitlines()
        head, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line[:1] == "|"]
        found[title] = [dict(zip(head, row, strict=True)) for row in rows]
    return found


@pytest.mark.process
@pytest.mark.timeout(340)
def test_every_section_prints_finite_numbers(folder: Path) -> None:
    report = folder / "report.md"
    run = [*QUICK, "--report", str(report)]
    for _attempt in range(TRIES):
        done = subprocess.run(run, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=110)
        if "All-NaN" not in done.stderr:
            break
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    text = report.read_text()
    found = sections(text)
    assert len(found) == len(SECTIONS)
    for title, beginning in zip(found, SECTIONS, strict=True):
        assert title.startswith(beginning)
        assert title in done.stdout
        assert found[title]
        for row in found[title]:
            cells = [cell for name, cell in list(row.items())[1:] if name not in IN_WORDS]
            assert all(cell == "not measured" or math.isfinite(float(cell)) for cell in cells), row
    assert "NOT byte for byte" not in text
    chain, streams = list(found.values())[:2]
    assert "The C program is not measured" in text or ("C p50" in chain[0] and "the same keys" in text)
    assert "NOT THE SAME KEYS" not in text
    assert "None taxels" not in text
    assert ("not measured" in text) == ("is not measured: " in text)
    for row in streams:
        assert row["taken"] == row["written"] != "0"


@pytest.mark.process
def test_an_interrupt_leaves_no_process_and_no_file(folder: Path) -> None:
    process = subprocess.Popen(QUICK, env=ENVIRONMENT | {"TMPDIR": str(folder)}, stdout=subprocess.DEVNULL)
    try:
        until = time.monotonic() + START_S
        while not list(folder.glob("*/run/publish")):
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.01)
        assert still_running(folder)
        process.send_signal(signal.SIGINT)
        assert process.wait(START_S) == 128 + signal.SIGINT
    finally:
        process.kill()
        process.wait()
    assert not still_running(folder)
    assert not list(folder.iterdir())


def still_running(folder: Path) -> list[bytes]:
    """Command lines that name the folder."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            command = file.read_bytes()
        except OSError:  # it ended meanwhile
            continue
        if os.fsencode(folder) in command:
            found.append(command)
    return found
