"""A process that ends with its ``with`` block, whatever happens within."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any, cast

END_S = 5.0
"""How long a process may take to end before it is killed."""

LAST_WORDS = 2000
"""How much of what a failed process said is told, characters."""


class BenchError(Exception):
    """The measurement cannot be made; says why."""


class Child:
    """A process that ends with its ``with`` block; in a session of its own, so that Ctrl-C reaches only us, who end it.

    Args:
        command: The program and its arguments.
        folder: Where it runs.
        options: As for `subprocess.Popen`.
    """

    def __init__(self, command: Sequence[str], folder: Path, **options: Any) -> None:
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed on exit
        self._process = subprocess.Popen(
            command,
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            start_new_session=True,
            **options,
        )
        self._output = cast("IO[str]", self._process.stdout)

    @property
    def pid(self) -> int:
        """Its id."""
        return self._process.pid

    def told(self, beginning: str) -> str:
        """Wait for the next line that begins so, and return its rest.

        Raises:
            BenchError: It ends without such a line.
        """
        for line in self._output:
            if line.startswith(beginning):
                return line[len(beginning) :].strip()
        self._process.wait(END_S)
        raise BenchError(f"a process ended before it said {beginning!r}: {self._last_words()}")

    def terminate(self) -> None:
        """Ask it to end."""
        self._process.terminate()

    def ended(self, seconds: float) -> None:
        """Wait until it has ended.

        Raises:
            BenchError: It runs on, or it failed.
        """
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired as error:
            raise BenchError(f"a process did not end within {seconds:g} s") from error
        if self._process.returncode:
            raise BenchError(f"a process failed: {self._last_words()}")

    def check(self) -> None:
        """Make sure that it still runs.

        Raises:
            BenchError: It does not.
        """
        if self._process.poll() is not None:
            raise BenchError(f"a process ended by itself: {self._last_words()}")

    def _last_words(self) -> str:
        self._errors.seek(0)
        return f"exit code {self._process.returncode}\n{self._errors.read()[-LAST_WORDS:]}"

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.terminate()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._output.close()
        self._errors.close()
