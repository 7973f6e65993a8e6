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

from slipd.config import Config, load
from slipd.errors import SlipdError
from slipd.host.config_reload import ConfigReload, kept_text
from slipd.host.run_signals import handled_signals
from slipd.host.systemd_notify import SystemdNotifier
from slipd.service import serve
from slipd.service_run import Endpoints

_log = logging.getLogger(__name__)


async def serve_file(file: Path, record: Path | None, on_ready: Callable[[Endpoints], None]) -> None:
    """Run the daemon until SIGINT or SIGTERM.

    SIGHUP reads the file again. A changed config starts a new run in this process, with a boot id of its own: as after
    any start, the lease, the tares and the learned friction are gone, and a gripper keeps its force. A file with
    faults, or a config with which no run can start, changes nothing: the config before is kept, and ``status`` shows
    why.

    SIGHUP ends the daemon instead where standard input is a terminal, which was then closed. Under ``nohup`` it is
    ignored.

    Args:
        file: The config.
        record: As for `slipd.service.serve`; later runs record beside it, to files with a number.
        on_ready: Called with the endpoints of each run.

    Raises:
        SlipdError: The first run cannot start, or the recording of a run failed.
    """
    notifier = SystemdNotifier()
    config, kept = load(file), ""
    before: Config | None = None
    with _requests_to_reload() as requested:
        while True:
            reload = None if requested is None else ConfigReload(file, requested)
            ready = _Ready(on_ready)
            try:
                await serve(
                    config,
                    record=None if record is None else _free_name(record, first=before is None and not kept),
                    on_ready=ready,
                    reload=reload,
                    notices={"config": kept},
                    notifier=notifier,
                )
            except SlipdError as error:
                if ready.reached or before is None:
                    raise
                config, before, kept = before, None, kept_text(error)
                _log.error("%s", kept)
                continue
            if reload is None or reload.found is None:
                return
            config, before, kept = reload.found, config, ""


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
