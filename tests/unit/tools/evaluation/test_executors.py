"""Replays in processes and on a Dask cluster; a process that dies takes no other recording with it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from multiprocessing import active_children
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.errors import SlipdError
from slipd.tools.evaluation import executors
from slipd.tools.evaluation.config_run import RECORDED, run_config
from slipd.tools.evaluation.executors import Finished, Job, NamedConfig, here, in_processes, on_dask

OWN = NamedConfig(RECORDED, None)
XELA = RECORDINGS / "xela.mcap"
JOB = Job(XELA, OWN, "xela")
KNOWN = Finished(Job(Path("known.mcap"), OWN, "known"), "known before", kept=True)


def test_every_executor_gives_the_same_and_passes_on_what_is_known() -> None:
    expected = {XELA: run_config(XELA, None, RECORDED), KNOWN.job.path: KNOWN.run}
    for executor in (here, in_processes):
        assert {found.job.path: found.run for found in executor(iter([JOB, KNOWN]))} == expected


def test_only_a_few_jobs_are_taken_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors.os, "sched_getaffinity", lambda pid: {0})
    monkeypatch.setattr(executors, "_pool", ThreadPoolExecutor)
    taken: list[int] = []

    def work() -> Iterator[Job]:
        for number in range(100):
            taken.append(number)
            yield Job(Path(f"{number}.mcap"), OWN, "")

    runs = in_processes(work())
    next(runs)
    assert len(taken) <= 2 * executors.AHEAD
    runs.close()


class _Deadly:
    """Ends the process that it is sent to."""

    def __reduce__(self) -> tuple[object, ...]:
        return os._exit, (9,)


def test_a_process_that_dies_takes_no_other_recording_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors.os, "sched_getaffinity", lambda pid: {0})
    deadly = Job(Path("deadly.mcap"), _Deadly(), "deadly")  # type: ignore[arg-type]
    missing = [Job(Path(f"{number}.mcap"), OWN, "") for number in range(3)]
    found = {one.job.path: one.run for one in in_processes(iter([missing[0], deadly, *missing[1:]]))}
    assert found.pop(deadly.path) == "deadly.mcap: the process that replayed it ended; is there enough memory?"
    assert found == {job.path: f"{job.path}: cannot be opened: No such file or directory" for job in missing}
    assert active_children() == []


def test_an_error_of_slipd_is_the_result_of_its_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: object) -> None:
        raise KeyError("left")

    monkeypatch.setattr(executors, "run_config", broken)
    (found,) = here(iter([JOB]))
    assert isinstance(found.run, str)
    assert found.run.startswith(f"{XELA}: an error of slipd, please report it: KeyError: 'left' (test_executors.py:")


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler and a worker as processes; yields the address of the scheduler, and its process."""
    file = folder / "scheduler.json"
    dask = [str(Path(sys.executable).with_name("dask"))]
    scheduler = [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file]
    worker = [*dask, "worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--scheduler-file", file]
    with ExitStack() as stack:
        processes = []
        for command in (scheduler, worker):
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder)
            stack.callback(process.wait)
            stack.callback(process.kill)
            processes.append(process)
        yield _address(file), processes[0]


def _address(file: Path) -> str:
    for _ in range(600):
        try:
            return str(json.loads(file.read_text())["address"])
        except (OSError, ValueError):
            time.sleep(0.05)
    raise AssertionError(f"{file} was not written within 30 s")


@pytest.mark.long
def test_a_dask_cluster_gives_the_same_until_its_scheduler_ends(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with cluster(tmp_path) as (address, scheduler):
        assert {found.job: found.run for found in on_dask(address)(iter([JOB, KNOWN]))} == {
            JOB: run_config(XELA, None, RECORDED),
            KNOWN.job: KNOWN.run,
        }

        def work() -> Iterator[Job]:
            yield JOB
            scheduler.kill()
            scheduler.wait()
            yield from (JOB for _ in range(3))

        with pytest.raises(SlipdError, match=f"--dask {address}: the connection to the scheduler ended"):
            list(on_dask(address)(work()))


def test_no_scheduler_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "CONNECT_S", 0.1)
    with pytest.raises(SlipdError, match=r"--dask tcp://127\.0\.0\.1:1: no Dask scheduler answers there"):
        on_dask("tcp://127.0.0.1:1")


def test_a_worker_with_another_slipd_says_so() -> None:
    found = str(executors._replay_as("the hash of another version", JOB))
    assert re.fullmatch(rf"{XELA}: the worker on .+ has another slipd; install the same version there", found)
