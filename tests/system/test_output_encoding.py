"""Output on a terminal that lacks characters, and names of files that are no text."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from replays import RECORDINGS


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
