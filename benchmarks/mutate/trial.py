"""One mutant against the tests of its room, in a copy of the project."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from mutate.mutations import Mutation, mutate

LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv*", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", "*.nbi", "*.nbc"
)
NO_TESTS = 5
"""Exit code of pytest that collected nothing."""


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant.

    Attributes:
        path: Mutated file, relative to the project.
        mutation: What was changed.
        verdict: "killed", "timeout" (also noticed), or "survived".
    """

    path: str
    mutation: Mutation
    verdict: str


class Copy:
    """A copy of the project that mutants are written into.

    Args:
        project: Folder of the project.
        folder: New folder of the copy.
    """

    def __init__(self, project: Path, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(project, folder, ignore=LEFT_OUT, symlinks=True)
        paths = [str(folder / "daemon"), str(folder / "clients")]
        self._environment = os.environ | {
            "PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1",
        }  # fmt: skip

    def passes(self, tests: list[str], limit_s: float) -> str:
        """Run tests until the first fails; return "passed", "failed" or "timeout"."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not long", *tests]
        with subprocess.Popen(
            command, cwd=self.folder, env=self._environment, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ) as run:  # fmt: skip
            try:
                code = run.wait(limit_s)
            except subprocess.TimeoutExpired:
                os.killpg(run.pid, signal.SIGKILL)
                return "timeout"
        return "passed" if code in (0, NO_TESTS) else "failed"

    def try_mutant(self, path: str, mutation: Mutation, tests: list[list[str]], limit_s: float) -> Outcome:
        """Write a mutant, run the tests, nearest first, and put the file back."""
        file = self.folder / path
        source = file.read_text(encoding="utf-8")
        file.write_text(mutate(source, mutation), encoding="utf-8")
        try:
            for group in tests:
                verdict = self.passes(group, limit_s)
                if verdict != "passed":
                    return Outcome(path, mutation, "killed" if verdict == "failed" else verdict)
        finally:
            file.write_text(source, encoding="utf-8")
        return Outcome(path, mutation, "survived")
