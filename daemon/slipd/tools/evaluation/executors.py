"""Replays to be done, and where they run: in this process, in processes here, or on the workers of a Dask cluster.

Every executor takes jobs and results that are known already, in any mixture, and yields each result as soon as it is
there. It takes a few jobs more than it has workers: a million of them need no more memory than a hundred.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import socket
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import resource_tracker
from pathlib import Path
from typing import NamedTuple

from slipd.errors import SlipdError, UsageError
from slipd.tools.evaluation.config_run import ConfigRun, run_config
from slipd.types.source_stamp import source_stamp

Run = ConfigRun | str


class NamedConfig(NamedTuple):
    """A config: its name for people, and its text, TOML; None: that of each recording."""

    name: str
    text: str | None


class Job(NamedTuple):
    """A recording to be replayed with a config; the key names the result in the cache."""

    path: Path
    config: NamedConfig
    key: str


class LastingFault(str):
    """Why a recording cannot be replayed with a config, by what is in both: another try would end in the same way."""

    __slots__ = ()


class Finished(NamedTuple):
    """What a job gave; a text is why there is no run. ``kept``: it was in the cache."""

    job: Job
    run: Run
    kept: bool = False


Work = Iterator[Job | Finished]
Executor = Callable[[Work], Iterator[Finished]]

AHEAD = 2
"""Jobs that are handed out for each worker, so that none waits for its next one."""

CONNECT_S = 10
"""How long a Dask scheduler may take to answer, s."""

ENGINE = "slipd.recording.replay"
"""The module that loads the engine: once for all processes of a pool, and never in this one."""


def own_stamp() -> str:
    """Return a hash of the source code of slipd."""
    return source_stamp(Path(__file__).parents[2])


def replay_job(job: Job) -> Run:
    """Replay a recording, in whatever process this is; whatever goes wrong with one recording is its result."""
    try:
        return run_config(job.path, job.config.text, job.config.name)
    except SlipdError as error:
        return str(error) if isinstance(error.__cause__, OSError) else LastingFault(str(error))
    except MemoryError:
        return f"{job.path}: not enough memory to replay it"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return f"{job.path}: an error of slipd, please report it: {type(error).__name__}: {error} ({where})"


def here(work: Work) -> Iterator[Finished]:
    """Replay one recording after the other in this process."""
    ready = False
    for job in work:
        if not isinstance(job, Finished) and not ready:
            from slipd.compile_kernels import compile_kernels  # here: where all results are kept, no engine is loaded

            compile_kernels()
            ready = True
        yield job if isinstance(job, Finished) else Finished(job, replay_job(job))


def in_processes(work: Work) -> Iterator[Finished]:
    """Replay in one process for each core.

    Where a process dies, for want of memory for example, the recordings that were being replayed are tried again, each
    in a process of its own. So the one that kills its process is found, and no other is lost.
    """
    cores = len(os.sched_getaffinity(0))
    pool: ProcessPoolExecutor | None = None  # started with the first job; not needed if every result is cached

    @_uninterrupted()
    def submit(job: Job) -> Future[Run]:
        nonlocal pool
        if pool is not None:
            with contextlib.suppress(BrokenProcessPool):
                return pool.submit(replay_job, job)
            pool.shutdown(cancel_futures=True)
        pool = _pool(cores)
        return pool.submit(replay_job, job)

    def outcome(job: Job, future: Future[Run]) -> Run:
        try:
            return future.result()
        except BrokenProcessPool:
            return _alone(job)

    try:
        yield from _in_turn(work, submit, outcome, lambda: AHEAD * cores)
    finally:
        if pool is not None:
            pool.shutdown(cancel_futures=True)


def _alone(job: Job) -> Run:
    with _pool(1) as pool:
        try:
            with _uninterrupted():
                future = pool.submit(replay_job, job)
            return future.result()
        except BrokenProcessPool:
            return f"{job.path}: the process that replayed it ended; is there enough memory?"


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C back while processes start, which would end with tracebacks.

    They inherit the mask; this process needs a handler too, because a thread of a library may receive the signal.
    """
    pressed: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    resource_tracker.ensure_running()  # its start would lift the mask
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
    if pressed:
        for child in multiprocessing.active_children():
            child.terminate()
        raise KeyboardInterrupt


def _pool(processes: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([ENGINE])
    return ProcessPoolExecutor(processes, context, _begin_worker)


def _begin_worker() -> None:
    """Let Ctrl-C end this process at once, without a traceback, and the end of the batch too, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_batch, daemon=True).start()


def _end_with_batch() -> None:
    batch = multiprocessing.parent_process()
    if batch is not None:
        batch.join()
    os._exit(1)


def on_dask(address: str) -> Executor:
    """Return the executor that replays on the workers of a Dask cluster; each opens the recordings by their paths.

    Args:
        address: That of the scheduler, for example ``tcp://10.0.0.5:8786``.

    Raises:
        SlipdError: Dask is not installed, or no scheduler answers; the executor raises it where the scheduler ends.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError("--dask needs the package distributed: pip install 'slipd[batch]'") from error
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SlipdError(f"--dask {address}: no Dask scheduler answers there: {error}") from error

    def execute(work: Work) -> Iterator[Finished]:
        stamp = own_stamp()
        executor = client.get_executor(pure=False)

        def submit(job: Job) -> Future[Run]:
            future: Future[Run] = executor.submit(_replay_as, stamp, job)
            return future

        with client:
            try:
                yield from _in_turn(work, submit, _outcome, lambda: AHEAD * max(sum(client.nthreads().values()), 1))
            except (OSError, CancelledError) as error:
                raise SlipdError(
                    f"--dask {address}: the connection to the scheduler ended; the same command continues the batch"
                ) from error

    return execute


def _replay_as(stamp: str, job: Job) -> Run:
    """Replay on another machine, if its slipd is the one whose results the cache names."""
    if own_stamp() != stamp:
        return f"{job.path}: the worker on {socket.gethostname()} has another slipd; install the same version there"
    return replay_job(job)


def _outcome(job: Job, future: Future[Run]) -> Run:
    error = future.exception()
    return future.result() if error is None else f"{job.path}: no Dask worker could replay it: {error}"


def _in_turn(
    work: Work,
    submit: Callable[[Job], Future[Run]],
    outcome: Callable[[Job, Future[Run]], Run],
    most: Callable[[], int],
) -> Iterator[Finished]:
    """Hand out jobs, at most so many at a time, and yield each result."""
    running: dict[Future[Run], Job] = {}

    def completed() -> Iterator[Finished]:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job = running.pop(future)
            yield Finished(job, outcome(job, future))

    for job in work:
        if isinstance(job, Finished):
            yield job
            continue
        running[submit(job)] = job
        if len(running) >= most():
            yield from completed()
    while running:
        yield from completed()
