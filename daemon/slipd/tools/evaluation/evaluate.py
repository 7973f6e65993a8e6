"""Replay recordings with several configs, and collect what differs.

The recorded motion stays as it was: a config changes what slipd reports on it, not what the robot or the reflex would
have done about that.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from slipd.tools.evaluation.config_run import RECORDED, ConfigRun
from slipd.tools.evaluation.executors import Executor, Finished, Job, LastingFault, NamedConfig, Run, here, in_processes
from slipd.tools.evaluation.result_cache import ResultCache

FEW_BYTES = 2_000_000
"""Up to this size of all recordings, starting further processes takes longer than they save."""


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
    sizes = {path: path.stat().st_size if path.exists() else 0 for path in paths}
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
