"""Tests in a fork of this process, which has imported all libraries: nothing is imported twice."""

from __future__ import annotations

import os
import resource
import signal
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import hypothesis.strategies  # noqa: F401 - imported once, for all forks
import numba
import numpy as np  # noqa: F401
import pydantic  # noqa: F401
import pytest
import scipy.optimize  # noqa: F401
import zmq  # noqa: F401
from mutate.children import use_mutant

OPTIONS = (
    *("-q", "--tb=native", "-p", "no:cacheprovider", "-m", "not long and not process"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
)


RunPytest = Callable[[list[str], list[object]], int]
"""Runs pytest with arguments and plugins, and returns its exit code."""


class _Only:
    """A plugin of pytest that runs these tests alone, in this order."""

    def __init__(self, tests: Sequence[str]) -> None:
        self._places = {test: place for place, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted((item for item in items if item.nodeid in self._places), key=self._place)

    def _place(self, item: pytest.Item) -> int:
        return self._places[item.nodeid]


def in_fork(run: Callable[[RunPytest], int], limit_s: int | None = None, *, recompile: bool = False) -> int:
    """Run a function in a fork without output; return the status of the fork, 0 only where the function returned 0.

    Args:
        run: The function. Its argument runs pytest with arguments and plugins, and returns pytest's exit code.
        limit_s: Processor time after which the fork is killed, s; None: no limit.
        recompile: Compile all kernels again: the cache does not know the mutant.
    """
    with tempfile.TemporaryDirectory(prefix="slipd-kernels-") as cache:
        if (child := os.fork()) == 0:
            if limit_s is not None:
                resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
            if recompile:
                numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = cache
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(1, 2)
            code = 1
            try:
                code = run(lambda arguments, plugins: int(pytest.main([*OPTIONS, *arguments], plugins)))
            finally:
                os._exit(code)
        return os.waitpid(child, 0)[1]


def noticed_as(
    root: Path,
    path: Path,
    source: str,
    tests: list[str],
    limit_s: int,
    *,
    only: Sequence[str] | None = None,
    recompile: bool = False,
) -> str:
    """Return how tests notice a mutant of a file, "killed" or "too slow"; "" where they pass.

    Processes that they start run it too.

    Args:
        root: Folder of the package.
        path: The file.
        source: The mutant.
        tests: Arguments of pytest.
        limit_s: Longest processor time of the tests, s.
        only: Node ids of the tests to run of these, in this order; None: all.
        recompile: See `in_fork`.
    """
    module = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")

    with tempfile.TemporaryDirectory(prefix="slipd-mutant-") as folder:

        def run(run_pytest: RunPytest) -> int:
            use_mutant(module, path, source, folder)
            return run_pytest(["-x", *tests], [] if only is None else [_Only(only)])

        status = in_fork(run, limit_s, recompile=recompile)
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
            return "too slow"
        return "killed" if status else ""
