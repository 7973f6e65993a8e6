"""A daemon's peers for a client, and slipctl in this process or in one of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from client_peers import PATIENCE_S, Daemon, Publisher

from slipd_client import lease_keeper
from slipd_client.aio import AsyncGripClient
from slipd_client.client_base import GripClientBase
from slipd_client.grip import GripClient
from slipd_client.slipctl import main
from slipd_client.subscriber import SILENCE_S

SLIPCTL = """
import sys
from slipd_client import slipctl, subscriber
subscriber.SubscriberBase.__init__.__kwdefaults__["silence_s"] = float(sys.argv.pop(1))
sys.exit(slipctl.main())
"""


@pytest.fixture
def slipctl() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts slipctl as a process of its own, with its output in pipes unless told otherwise."""
    with ExitStack() as stack:

        def start(*arguments: str, silence_s: float = SILENCE_S, **options: Any) -> subprocess.Popen[str]:
            command = [sys.executable, "-c", SLIPCTL, str(silence_s), *arguments]
            pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "encoding": "utf-8"}
            process = stack.enter_context(subprocess.Popen(command, **(pipes | options)))
            stack.callback(process.kill)
            return process

        yield start


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Runs slipctl in this process; returns its exit code, output and errors."""

    def run(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        try:
            code = main(arguments)
        except SystemExit as end:
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def publish(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/publish"


@pytest.fixture
def requests(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/requests"


@pytest.fixture
def publisher(publish: str) -> Iterator[Publisher]:
    with closing(Publisher(publish)) as publisher:
        yield publisher


@pytest.fixture
def start_daemon(requests: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Daemon]]:
    """Starts daemons; unless a test says otherwise, clients wait for them however long this machine stands still."""
    monkeypatch.setattr(GripClientBase.__init__, "__kwdefaults__", {"keys": None, "timeout_s": PATIENCE_S})
    with ExitStack() as stack:
        yield lambda **options: stack.enter_context(closing(Daemon(requests, **options)))


@pytest.fixture
def no_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clients wait no longer than needed for a daemon that is not there."""
    monkeypatch.setitem(GripClientBase.__init__.__kwdefaults__, "timeout_s", 0.05)


@pytest.fixture
def daemon(start_daemon: Callable[..., Daemon]) -> Daemon:
    return start_daemon()


@pytest.fixture(autouse=True)
def long_leases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless a test says otherwise, no lease ends or is renewed while this machine does something else."""
    for kind in (GripClient, AsyncGripClient):
        monkeypatch.setattr(kind.lease.__wrapped__, "__defaults__", (60_000,))


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leases are renewed often, and no stall ends them all the same."""
    monkeypatch.setattr(lease_keeper, "RENEWALS", 10_000)


@pytest.fixture
def stepped(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], Any]:
    """Lets a module wait in a time of its own, in which no stall counts; returns its clock."""
    now_s = [0.0]

    def sleep(seconds: float) -> None:
        now_s[0] += seconds

    clock = SimpleNamespace(monotonic=lambda: now_s[0], sleep=sleep)

    def step(module: Any) -> Any:
        monkeypatch.setattr(module, "time", clock)
        return clock

    return step
