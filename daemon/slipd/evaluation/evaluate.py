"""Replay recordings with several configs, on all cores, and collect what differs.

The recorded motion stays as it was: a config changes what slipd reports on it, not what the robot or the reflex would
have done about that.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from slipd.errors import SlipdError
from slipd.evaluation.config_run import RECORDED, ConfigRun, run_config
from slipd.evaluation.recorded_truth import Truth
from slipd.evaluation.result_cache import ResultCache

FEW_BYTES = 2_000_000
"""Up to this size of all that is to be replayed, starting further processes takes longer than they save."""


class NamedConfig(NamedTuple):
    """A config: its name for people, and its text, TOML; None: that of each recording."""

    name: str
    text: str | None


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
    runs: dict[str, ConfigRun | str]

    @property
    def truth(self) -> Truth | None:
        """What truly happened, where the recording says so."""
        return next((run.truth for run in self.runs.values() if isinstance(run, ConfigRun)), None)

    @property
    def faults(self) -> list[str]:
        """Everything that went wrong, for people, without repetition."""
        found = [run if isinstance(run, str) else run.fault for run in self.runs.values()]
        return list(dict.fromkeys(filter(None, found)))


class _Job(NamedTuple):
    evaluation: Evaluation
    config: NamedConfig
    key: str


def evaluate(
    paths: Sequence[Path],
    configs: Sequence[NamedConfig],
    cache: ResultCache,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[Evaluation]:
    """Replay every recording with its own config and with every other.

    Args:
        paths: The recordings; one that is named twice counts once.
        configs: The other configs.
        cache: Results of earlier evaluations.
        progress: Called with the number of runs that are done, and of all.

    Returns:
        One evaluation for each recording, in order; faults are in it.
    """
    every = [NamedConfig(RECORDED, None), *configs]
    paths = list(dict.fromkeys(paths))
    found = [Evaluation(name, path, {}) for name, path in zip(short_names(paths), paths, strict=True)]
    jobs: list[_Job] = []
    for one in found:
        jobs += _begin(one, every, cache)
    total = len(found) * len(every)
    done = total - len(jobs)
    progress(done, total)
    for job, run in _runs(jobs):
        job.evaluation.runs[job.config.name] = run
        if isinstance(run, ConfigRun):
            cache.put(job.key, run)
        done += 1
        progress(done, total)
    cache.prune()
    for one in found:
        one.runs = {config.name: one.runs[config.name] for config in every}
    return found


def short_names(paths: Sequence[Path]) -> list[str]:
    """Return the names of files; those that would be the same keep as many folders as make them differ."""
    depth = 1
    while depth < max((len(path.parts) for path in paths), default=1):
        if len({path.parts[-depth:] for path in paths}) == len(set(paths)):
            break
        depth += 1
    return [str(Path(*path.parts[-depth:])) for path in paths]


def _begin(one: Evaluation, every: list[NamedConfig], cache: ResultCache) -> Iterator[_Job]:
    """Take what the cache has; yield what is to be replayed, unless the recording cannot be read at all."""
    try:
        keys = [cache.key(one.path, config.text) for config in every]
    except OSError as error:
        one.runs = dict.fromkeys((config.name for config in every), f"{one.path}: cannot be opened: {error.strerror}")
        return
    for config, key in zip(every, keys, strict=True):
        kept = cache.get(key)
        if kept is None:
            yield _Job(one, config, key)
        else:
            one.runs[config.name] = kept


def _runs(jobs: list[_Job]) -> Iterator[tuple[_Job, ConfigRun | str]]:
    """Replay; yield each run when it is done."""
    sizes = {job.evaluation.path: job.evaluation.path.stat().st_size for job in jobs}
    cores = min(len(os.sched_getaffinity(0)), len(jobs))
    if cores < 2 or math.fsum(sizes[job.evaluation.path] for job in jobs) <= FEW_BYTES:
        for job in jobs:
            yield job, _run(job.evaluation.path, job.config)
        return
    silent_end = (signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the processes at once, without a traceback of each
    pool = ProcessPoolExecutor(cores, multiprocessing.get_context("spawn"), signal.signal, silent_end)
    try:
        longest_first = sorted(jobs, key=lambda job: -sizes[job.evaluation.path])
        running: dict[Future[ConfigRun | str], _Job] = {
            pool.submit(_run, job.evaluation.path, job.config): job for job in longest_first
        }
        for future in as_completed(running):
            job = running[future]
            try:
                yield job, future.result()
            except BrokenProcessPool:
                yield job, f"{job.evaluation.path}: the process that replayed it ended; is there enough memory?"
    finally:
        pool.shutdown(cancel_futures=True)


def _run(path: Path, config: NamedConfig) -> ConfigRun | str:
    try:
        return run_config(path, config.text, config.name)
    except SlipdError as error:
        return str(error)
