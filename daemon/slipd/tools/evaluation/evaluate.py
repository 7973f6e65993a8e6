"""Replay recordings with several configs, and collect what differs.

The recorded motion stays as it was: a config changes what slipd reports on it, not what the robot or the reflex would
have done about that.

What a recording gave is kept, so that a second evaluation replays only what is new. A result belongs to the bytes of
the recording, the text of the config and the source code of slipd: a change of any of them makes a new one. Files that
are damaged or cannot be read or written cost time, and nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from slipd.io.replaced_file import replace_file
from slipd.tools.evaluation.config_run import RECORDED, ConfigRun
from slipd.tools.evaluation.executors import (
    Executor,
    Finished,
    Job,
    LastingFault,
    NamedConfig,
    Run,
    here,
    in_processes,
    own_stamp,
)

FEW_BYTES = 2_000_000
"""Up to this size of all recordings, starting further processes takes longer than they save."""

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
        why, content = (result, result) if isinstance(result, LastingFault) else (result.fault, asdict(result))
        of_run, of_fault = self._files(job)
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            replace_file(
                of_fault if why else of_run, json.dumps(content), mode=0o644
            )  # several users may share the folder

    def _files(self, job: Job) -> tuple[Path, Path]:
        """Return the file of a whole run, and that of a fault, whose text names the recording and the config."""
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


@dataclass(slots=True)
class Evaluation:
    """One recording with every config.

    Attributes:
        name: Name of the recording for people.
        path: The recording.
        runs: By name of the config, in the order of the configs; a text is why there is no run.
    """

    name: str
    path: Path
    runs: dict[str, Run]

    @property
    def faults(self) -> list[str]:
        """Everything that went wrong, for people, without repetition."""
        found = [run if isinstance(run, str) else run.fault for run in self.runs.values()]
        return list(dict.fromkeys(filter(None, found)))


def finished_runs(
    paths: Sequence[Path], configs: Sequence[NamedConfig], cache: ResultCache, executor: Executor | None = None
) -> Generator[Finished]:
    """Replay every recording with its own config and with every other; yield each run as soon as it is there.

    Args:
        paths: The recordings, each once.
        configs: The other configs.
        cache: Results of earlier evaluations; gets the new ones.
        executor: Where the replays run; None: on all cores of this machine, or here where they are short.

    Yields:
        Runs in any order. Whatever goes wrong with a recording is in its runs.
    """
    sizes = {path: path.stat().st_size if os.access(path, os.F_OK) else 0 for path in paths}
    if executor is None:
        short = sum(sizes.values()) <= FEW_BYTES or len(os.sched_getaffinity(0)) < 2
        executor = here if short else in_processes
    longest_first = sorted(paths, key=lambda path: -sizes[path])
    for found in executor(_work(longest_first, [NamedConfig(RECORDED, None), *configs], cache)):
        if isinstance(found.run, ConfigRun | LastingFault) and not found.kept:
            cache.put(found.job, found.run)
        yield found
    cache.prune(len(paths) * (1 + len(configs)))


def evaluations(
    finished: Iterable[Finished], paths: Sequence[Path], configs: Sequence[NamedConfig]
) -> list[Evaluation]:
    """Return all runs by recording, in the order of the recordings and of the configs."""
    runs = {(found.job.path, found.job.config.name): found.run for found in finished}
    names = [RECORDED, *(config.name for config in configs)]
    return [
        Evaluation(short, path, {name: runs[path, name] for name in names})
        for short, path in zip(short_names(paths), paths, strict=True)
    ]


def short_names(paths: Sequence[Path]) -> list[str]:
    """Return the names of files; those that would be the same keep as many folders as make them differ."""
    depth = 1
    while depth < max((len(path.parts) for path in paths), default=1):
        if len({path.parts[-depth:] for path in paths}) == len(set(paths)):
            break
        depth += 1
    return [str(Path(*path.parts[-depth:])) for path in paths]


def _work(paths: Sequence[Path], every: Sequence[NamedConfig], cache: ResultCache) -> Iterator[Job | Finished]:
    """Yield what is to be replayed, and what the cache has already."""
    for path in paths:
        try:
            keys = cache.keys(path, [config.text for config in every])
        except OSError as error:
            why = f"{path}: cannot be opened: {error.strerror}"
            yield from (Finished(Job(path, config, ""), why) for config in every)
            continue
        for config, key in zip(every, keys, strict=True):
            job = Job(path, config, key)
            kept = cache.get(job)
            yield job if kept is None else Finished(job, kept, kept=True)
