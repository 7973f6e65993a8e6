"""Output on a terminal that lacks characters, and names of files that are no text."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from replays import RECORDINGS

RUN_OF_NO_TEXT = f"cp {RECORDINGS}/demo.mcap $'run\\xff.mcap' && slipd plot $'run\\xff.mcap' --out run.html"
LONG = 300 * "a"


@pytest.mark.process
def test_what_a_terminal_cannot_show_is_escaped_or_a_question_mark_and_ends_nothing(tmp_path: Path) -> None:
    run = Path(os.fsdecode(bytes(tmp_path) + b"/run\xff.mcap"))
    shutil.copy(RECORDINGS / "demo.mcap", run)
    variables = os.environ | {"PYTHONIOENCODING": "ascii:strict", "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-m", "slipd", "evaluate", os.fsencode(run)]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert r"run\udcff.mcap" in done.stdout
    assert "? max" in done.stdout


@pytest.mark.process
@pytest.mark.parametrize(
    ("call", "ends", "said"),
    [
        ("slipd docs commands | true", 0, ""),
        ("slipctl --help | true", 0, ""),
        ("slipd docs commands >&-", 0, ""),
        ("slipctl --version >&- 2>&-", 0, ""),
        ("slipd docs commands >/dev/full", 1, "slipd: the output cannot be written: No space left on device\n"),
        (RUN_OF_NO_TEXT, 0, ""),
        (f"slipd check {LONG}", 1, f"slipd: {LONG}: File name too long\n"),
        (f"slipd emulate {LONG}", 1, f"slipd: {LONG}: File name too long\n"),
        (f"slipctl view --config {LONG}", 1, f"slipctl: {LONG}: File name too long\n"),
    ],
)
def test_an_output_that_is_closed_or_full_or_an_odd_file_name_is_no_traceback(
    call: str, ends: int, said: str, tmp_path: Path
) -> None:
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    variables["PATH"] = f"{Path(sys.executable).parent}:{variables['PATH']}"
    command = ["bash", "-c", f"{call}; exit ${{PIPESTATUS[0]}}"]
    done = subprocess.run(command, env=variables, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (ends, said)
