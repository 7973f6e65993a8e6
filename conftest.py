"""Fixtures that every test gets."""

from __future__ import annotations

import asyncio
import functools
import inspect
import signal
import tomllib
from collections.abc import AsyncIterator, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from hypothesis import HealthCheck, settings

# Started in the background of a shell or under nohup, this process ignores Ctrl-C or SIGHUP, and so would every process
# it starts.
for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

# How long an example takes says nothing on a machine that others use as well. The examples are the same in every run,
# so that a change is judged and not the day; `pytest --hypothesis-profile=explore` draws new ones, `long` many of them.
settings.register_profile("explore", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("long", settings.get_profile("explore"), max_examples=2000, stateful_step_count=60)
settings.register_profile("repeatable", settings.get_profile("explore"), derandomize=True)
settings.load_profile("repeatable")


@pytest.fixture(scope="session", autouse=True)
def _own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what daemons of the tests store apart from those of this user."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SLIPD_STATE_DIR", str(tmp_path_factory.mktemp("state")))
        yield


ROOT = Path(__file__).parent
COVERED = tuple(
    ROOT / "tests" / "unit" / Path(*package.split(".")[1:])
    for package in tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["coverage"]["run"]["source_pkgs"]
)
"""Tests of the rooms that are covered to the last branch. Tracing doubles the time of a test, so others go without."""


def pytest_configure(config: pytest.Config) -> None:
    """End the first of the two measurements that pytest-cov starts in a process of pytest-xdist; it is never saved."""
    coverage = _coverage(config)
    if coverage is not None and hasattr(config, "workerinput"):
        coverage.cov.stop()


@functools.cache
def _is_covered(path: Path) -> bool:
    return any(map(path.is_relative_to, COVERED))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let every asynchronous test end without a pending task; the others need no event loop, and get none."""
    for item in items:
        if item.get_closest_marker("statistics") or not _is_covered(item.path):
            item.add_marker(pytest.mark.uncovered)
        if isinstance(item, pytest.Function) and inspect.iscoroutinefunction(item.obj):
            item.fixturenames.insert(0, _no_task_is_leaked.__name__)


@pytest.hookimpl(wrapper=True)
def pytest_runtestloop(session: pytest.Session) -> Generator[None, Any, Any]:
    """Trace no work of pytest between the tests, nor of the process that hands them out."""
    coverage = _coverage(session.config)
    if coverage is not None:
        coverage.pause()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Trace a test that is to cover something, and the fixtures that are made for it."""
    coverage = _coverage(item.config)
    if coverage is None or item.get_closest_marker("uncovered"):
        return (yield)
    coverage.resume()
    try:
        return (yield)
    finally:
        coverage.pause()


def _coverage(config: pytest.Config) -> Any:
    """Return what begins and ends the tracing; None without ``--cov``."""
    plugin = config.pluginmanager.getplugin("_cov")
    return None if plugin is None else plugin.cov_controller


@pytest_asyncio.fixture
async def _no_task_is_leaked() -> AsyncIterator[None]:
    """Fails a test that leaves an asyncio task pending behind it."""
    before = asyncio.all_tasks()
    yield
    await asyncio.sleep(0)
    leaked = {task for task in asyncio.all_tasks() - before if not task.done()} - {asyncio.current_task()}
    names = sorted(task.get_name() for task in leaked)
    assert not leaked, f"tasks left pending: {names}"
