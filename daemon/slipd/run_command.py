"""The command ``slipd run``: the daemon of one config, in an event loop of its own."""

from __future__ import annotations

import asyncio
from pathlib import Path

from slipd.io.host.scheduling import PollingSelector
from slipd.serve_file import serve_file
from slipd.service_run import Endpoints


def run_command(config: Path, record: Path | None) -> None:
    """Run the daemon until a signal ends it.

    Args:
        config: Config of the rig.
        record: New file for every event and message; None: nothing is recorded.

    Raises:
        ConfigError: The config cannot be read or has faults.
        SlipdError: The daemon cannot start, or its recording failed.
    """
    selector = PollingSelector()
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selector)) as runner:
        try:
            runner.run(serve_file(config, record, print_endpoints, selector))
        except BaseExceptionGroup as group:
            raise _first_of(group) from group


def print_endpoints(endpoints: Endpoints) -> None:
    """Print the endpoints of the daemon, for people and for programs that start it."""
    print(f"publish: {endpoints.publish}\nrequests: {endpoints.requests}", flush=True)


def _first_of(error: BaseException) -> BaseException:
    """Return the first failure inside task groups."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
