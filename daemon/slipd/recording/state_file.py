"""The file in which the state of a run is kept for the next: read once, and replaced by a thread of its own."""

from __future__ import annotations

import logging
import os
import stat
import threading
from pathlib import Path

from slipd.errors import RecordingError
from slipd.events import StateRestored
from slipd.io.replaced_file import replace_file
from slipd.recording.run_files import private_directory

MOST_BYTES = 1_000_000
"""Largest file that is read: a state of two pads of 1,000 taxels has a tenth of it."""
CLOSE_LIMIT_S = 2.0
"""Longest wait for the disk at the end of a run, s."""

_log = logging.getLogger(__name__)


class StateFile:
    """Keeps the newest text in a file; a disk that is slow, full or gone never delays or ends the run.

    Args:
        path: The file, in a folder to which only this user can write.

    Attributes:
        problem: Why the newest text could not be written, for people; "" where it could.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problem = ""
        self._text: str | None = None  # not written yet
        self._kept = ""
        self._closed = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def read(self) -> StateRestored | None:
        """Return what the run before kept; None where it kept nothing."""
        try:
            private_directory(self._path.parent)
            return StateRestored(_read(self._path))
        except FileNotFoundError:
            return None
        except (RecordingError, OSError, UnicodeDecodeError) as error:
            return StateRestored("", f"{self._path}: {getattr(error, 'strerror', None) or error}")

    def keep(self, text: str) -> None:
        """Write a text, unless it is the one that was kept last; a newer one takes the place of one that waits."""
        if text == self._kept:
            return
        with self._changed:
            self._kept = self._text = text
            self._changed.notify()
        if self._thread is None:
            thread = threading.Thread(target=self._run, name="state", daemon=True)
            try:
                thread.start()
            except RuntimeError as error:  # the system starts no more threads: the next text tries again
                self.problem = f"{self._path}: cannot be written: {error}"
            else:
                self._thread = thread

    def close(self) -> None:
        """Write what waits, for at most `CLOSE_LIMIT_S`."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join(CLOSE_LIMIT_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._text is not None or self._closed)
                text, self._text = self._text, None
            if text is None:
                return
            try:
                replace_file(self._path, text)
                self.problem = ""
            except OSError as error:
                if not self.problem:
                    _log.warning("%s: %s", self._path, error.strerror, extra={"slipd_fault": "state-not-kept"})
                self.problem = f"{self._path}: cannot be written: {error.strerror}"


def _read(path: Path) -> str:
    """Return the text of a regular file of this user, to which nobody else can write."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(handle, "rb") as file:  # noqa: PTH123 - a handle that follows no link
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o022:
            raise RecordingError(f"must be a regular file of user {os.geteuid()} to which nobody else can write")
        if found.st_size > MOST_BYTES:
            raise RecordingError(f"must have at most {MOST_BYTES} bytes, got {found.st_size}")
        return file.read(MOST_BYTES).decode()
