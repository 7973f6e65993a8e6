"""Output on a terminal that lacks characters, to a closed pipe or a full disk; names of files that are no text."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from replays import RECORDINGS

RUN = "$'run\\xff.mcap'"
"""Its name is no UTF-8."""
COPY = f"cp {RECORDINGS}/demo.mcap {RUN}"
ON_ASCII = f"XDG_CACHE_HOME=. PYTHONIOENCODING=ascii:strict slipd evaluate {RUN} 2>log"
LONG = 300 * "a"


@pytest.mark.process
@pytest.mark.parametrize(
    ("call", "ends", "said"),
    [
        ("slipd docs commands | true", 0, ""),
        ("slipctl --help | true", 0, ""),
        ("slipd docs commands >&-", 0, ""),
        ("slipctl --version >&- 2>&-", 0, ""),
        ("slipd docs commands >/dev/full", 1, "slipd: the output cannot be written: No space left on device\n"),
        (f"{COPY} && slipd plot {RUN} --out run.html 2>log", 0, ""),
        (rf"{COPY} && test $({ON_ASCII} | grep -c -e '? max' -e '^run\\udcff\.mcap') = 2", 0, ""),
        (f"slipd check {LONG}", 1, f"slipd: {LONG}: File name too long\n"),
        (f"slipd emulate {LONG}", 1, f"slipd: {LONG}: File name too long\n"),
        (f"slipctl view --config {LONG}", 1, f"slipctl: {LONG}: File name too long\n"),
        (
            "(ulimit -f 0; slipctl keys new robot --dir .)",
            2,
            "slipctl: robot: File too large; choose another name or directory\n",
        ),
        (
            "(ulimit -f 0; slipctl --requests ipc://none diagnose d.tgz --seconds 0.1 >/dev/null); test ! -e d.tgz",
            0,
            "slipctl: d.tgz: cannot be written: File too large\n",
        ),
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
