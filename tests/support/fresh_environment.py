"""A fresh environment for packages beside slipd, which it borrows from this one; nothing comes from a network."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PATIENCE_S = 300.0
"""Longest time of one command, s: a busy machine must not decide."""
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
OFFLINE = ("install", "--quiet", "--no-index", "--no-build-isolation")


class Environment:
    """An environment that borrows slipd and its dependencies from this one, and installs packages of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        venv.create(folder / "venv", symlinks=True)
        self.python = folder / "venv" / "bin" / "python"
        version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
        site = folder / "venv" / "lib" / version / "site-packages"
        (site / "borrowed.pth").write_text(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n")
        self._variables = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}

    def pip(self, *arguments: str | Path) -> None:
        command = (*PIP, "--python", self.python, *arguments)
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
        assert done.returncode == 0, done.stdout + done.stderr

    def slipd(self, *arguments: str | Path, module: str = "slipd") -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            (self.python, "-m", module, *arguments),
            cwd=self._folder, env=self._variables, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
        )  # fmt: skip

    @contextmanager
    def running(self, until: str, *arguments: str | Path) -> Iterator[str]:
        """Run a command until the block ends; yield what follows the word ``until`` in its output."""
        with subprocess.Popen(
            (self.python, "-m", "slipd", *arguments),
            cwd=self._folder, env=self._variables, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            try:
                assert process.stdout is not None
                lines = iter(process.stdout.readline, "")
                yield next(line.removeprefix(until).strip() for line in lines if line.startswith(until))
            finally:
                process.terminate()
                process.wait(PATIENCE_S)
