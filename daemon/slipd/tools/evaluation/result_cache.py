"""Keep what recordings gave, so that a second evaluation replays only what is new.

A result belongs to the bytes of the recording, the text of the config and the source code of slipd: a change of any of
them makes a new one. Files that are damaged or cannot be read or written cost time, and nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from slipd.io.replaced_file import replace_file
from slipd.tools.evaluation.config_run import ConfigRun
from slipd.tools.evaluation.executors import Job, LastingFault, own_stamp

MOST_RESULTS = 2000
"""Results that are kept, the newest; each has some kilobytes."""


def cache_folder() -> Path:
    """Return the folder of the results: ``$XDG_CACHE_HOME/slipd/evaluate``, by default in ``~/.cache``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "slipd" / "evaluate"


class ResultCache:
    """Results by recording and config.

    Args:
        folder: Where they are; created when needed.
        pruned: Only the newest are kept. A folder that several machines fill at the same time keeps all.
    """

    def __init__(self, folder: Path, *, pruned: bool = True) -> None:
        self._folder = folder
        self._pruned = pruned

    def keys(self, recording: Path, config_texts: Sequence[str | None]) -> list[str]:
        """Return the key of the result for each config; None is the recorded one. The recording is read once.

        Raises:
            OSError: The recording cannot be read.
        """
        of_recording = hashlib.sha256(own_stamp().encode())
        with recording.open("rb") as file:
            of_recording.update(hashlib.file_digest(file, "sha256").digest())
        found = []
        for text in config_texts:
            digest = of_recording.copy()
            if text is not None:
                digest.update(text.encode())
            found.append(digest.hexdigest())
        return found

    def get(self, job: Job) -> ConfigRun | LastingFault | None:
        """Return a result, or None if it is not there. Then it counts as new."""
        for path in self._files(job):
            try:
                found = json.loads(path.read_text(encoding="utf-8"))
                result = LastingFault(found) if isinstance(found, str) else ConfigRun.from_map(found)
            except (OSError, ValueError, KeyError, TypeError, AttributeError):
                continue
            if self._pruned:
                with contextlib.suppress(OSError):  # that of another user
                    os.utime(path)
            return result
        return None

    def put(self, job: Job, result: ConfigRun | LastingFault) -> None:
        """Keep a result."""
        of_run, of_fault = self._files(job)
        path, content = (of_fault, result) if isinstance(result, LastingFault) else (of_run, asdict(result))
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            replace_file(path, json.dumps(content), mode=0o644)  # several users may share the folder

    def _files(self, job: Job) -> tuple[Path, Path]:
        """Return the file of a run, and that of a fault, whose text names the recording and the config."""
        named = hashlib.sha256(f"{job.path} {job.config.name}".encode(errors="surrogateescape")).hexdigest()
        return self._folder / f"{job.key}.json", self._folder / f"{job.key}-{named[:16]}.json"

    def prune(self, needed: int = 0) -> None:
        """Remove the oldest results beyond `MOST_RESULTS`, or beyond those needed, and what an interrupted run left."""
        if not self._pruned:
            return
        most = max(MOST_RESULTS, needed)
        with contextlib.suppress(OSError):
            files = sorted(self._folder.glob("*.json"), key=lambda file: file.stat().st_mtime, reverse=True)
            for file in [*files[most:], *self._folder.glob(".*.json.*")]:
                file.unlink(missing_ok=True)
