"""Run the daemon on a config file, and start it again when SIGHUP asks for it and the file has changed."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from slipd.config import Config, hints, load
from slipd.errors import SlipdError
from slipd.io.host.config_reload import ConfigReload, kept_text
from slipd.io.host.run_signals import EndSignals, handled_signals
from slipd.io.host.scheduling import PollingSelector
from slipd.io.host.systemd import SystemdNotifier
from slipd.service import serve
from slipd.service_run import Endpoints

_log = logging.getLogger(__name__)


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


async def serve_file(
    file: Path, record: Path | None, on_ready: Callable[[Endpoints], None], selector: PollingSelector
) -> None:
    """Run the daemon until SIGINT or SIGTERM; a run that has begun always closes its recordings.

    SIGHUP reads the file again. A changed config starts a new run in this process, with a boot id of its own: as after
    any start, the lease and the learned friction are gone, and a gripper keeps its force. A file with
    faults, or a config with which no run can start, changes nothing: the config before is kept, and ``status`` shows
    why.

    SIGHUP ends the daemon instead where standard input is a terminal, which was then closed. Under ``nohup`` it is
    ignored.

    Args:
        file: The config.
        record: As for `slipd.service.serve`; later runs record beside it, to files with a number.
        on_ready: Called with the endpoints of each run.
        selector: That of the running loop; polls where ``[realtime] poll`` of the config in force says so.

    Raises:
        SlipdError: The first run cannot start, neither the changed config nor the one before can, or the recording of a
            run failed.
    """
    notifier = SystemdNotifier()
    config = load(file)
    before: Config | None = None
    refused: SlipdError | None = None
    with _requests_to_reload() as requested, EndSignals(*_ending(requested)) as ends:
        while not ends.received:
            reload = None if requested is None else ConfigReload(file, requested)
            ready = _Ready(on_ready)
            selector.polls = config.realtime.poll
            for hint in hints(config, str(file)) if refused is None else ():
                _log.warning("%s", hint)
            try:
                await serve(
                    config,
                    record=None if record is None else _free_name(record, first=before is None and refused is None),
                    on_ready=ready,
                    ends=ends,
                    reload=reload,
                    notices={"config": "" if refused is None else kept_text(refused)},
                    notifier=notifier,
                )
            except SlipdError as error:
                if ready.reached:
                    raise
                if refused is not None:
                    raise SlipdError(
                        f"{file}: neither the changed config nor the one before can start\n"
                        f"  changed: {refused}\n  before: {error}"
                    ) from error
                if before is None:
                    raise
                config, before, refused = before, None, error
                _log.error("%s", kept_text(refused), extra={"slipd_fault": "config-kept"})
                continue
            if reload is None or reload.found is None:
                return
            config, before, refused = reload.found, config, None
        notifier.stopping()


def _ending(requested: asyncio.Event | None) -> tuple[signal.Signals, ...]:
    """Return the signals that end the daemon: SIGHUP too where it does not reload."""
    return (signal.SIGINT, signal.SIGTERM, *((signal.SIGHUP,) if requested is None else ()))


class _Ready:
    """Passes on that a run serves, and remembers it."""

    def __init__(self, on_ready: Callable[[Endpoints], None]) -> None:
        self._on_ready = on_ready
        self.reached = False

    def __call__(self, endpoints: Endpoints) -> None:
        self.reached = True
        self._on_ready(endpoints)


@contextlib.contextmanager
def _requests_to_reload() -> Iterator[asyncio.Event | None]:
    """Yield the event that SIGHUP sets; None where SIGHUP must not reload."""
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN or (sys.stdin is not None and sys.stdin.isatty()):
        yield None
        return
    requested = asyncio.Event()
    with handled_signals({signal.SIGHUP: requested.set}):
        yield requested


def _free_name(path: Path, *, first: bool) -> Path:
    """Return the path for the first run; for a later one, the first free path with a number."""
    if first:
        return path
    numbered = (path.with_stem(f"{path.stem}-{number}") for number in itertools.count(2))
    return next(name for name in numbered if not name.exists())
