"""The daemon: assembles the rooms, runs them in one task group, and ends them in order."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from slipd.compile_kernels import compile_kernels
from slipd.config import Config
from slipd.service_run import Endpoints, ServiceRun
from slipd.ticker import Ticker
from slipd.transport import Links
from slipd.zmtp.listener import raise_descriptor_limit

LOSS_REPORT_S = 10.0
"""Period of the log lines about data lost on this host, s: often enough to find the cause, too rare to flood the
log."""

_log = logging.getLogger(__name__)


async def serve(
    config: Config,
    *,
    record: Path | None = None,
    on_ready: Callable[[Endpoints], None] = lambda _: None,
    stop: asyncio.Event | None = None,
) -> None:
    """Run the daemon until SIGINT, SIGTERM, SIGHUP or ``stop``.

    Resources that only one daemon may hold are claimed first, so that a second daemon is refused before it compiles its
    kernels.

    Args:
        config: The rig.
        record: New file for every event and message; None: nothing is recorded.
        on_ready: Called once the endpoints are served and the kernels are compiled.
        stop: Setting it ends the run.

    Raises:
        LinkError: An endpoint cannot be bound, a key file is invalid, or another daemon holds the runtime directory.
        RecordingError: The recording cannot be created, or its disk failed; a failing disk does not end the run.
    """
    stop = stop or asyncio.Event()
    with ExitStack() as stack:
        run = stack.enter_context(ServiceRun(config, record, stop))
        compile_kernels()
        raise_descriptor_limit()
        stack.enter_context(_ended_by_signals(stop))
        run.open()
        asyncio.get_running_loop().set_exception_handler(run.on_loop_fault)
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        async with asyncio.TaskGroup() as tasks, Links(tasks, run.engine.links.values(), run.handle) as links:
            run.links = links
            ticker = tasks.create_task(Ticker(run.tick, lambda: run.events_handled).run(), name="ticker")
            reporter = tasks.create_task(_report_losses(links), name="losses")
            run.report_recording()
            on_ready(run.endpoints)
            run.ready = True
            await stop.wait()
            ticker.cancel()
            run.end()
            reporter.cancel()
    run.raise_failure()


async def _report_losses(links: Links) -> None:
    """Log, periodically and at the end, what the links lost on this host; the engine cannot see it."""
    reported: dict[str, tuple[int, int]] = {}
    while True:
        try:
            await asyncio.sleep(LOSS_REPORT_S)
        finally:
            for name, refused in links.refused_writes.items():
                lost = refused, links.overruns[name]
                if lost != reported.get(name, (0, 0)):
                    _log.warning("%s: %d writes dropped, %d datagrams lost before they were read so far", name, *lost)
                reported[name] = lost


@contextlib.contextmanager
def _ended_by_signals(stop: asyncio.Event) -> Iterator[None]:
    """End the run in good order on SIGINT, SIGTERM, or SIGHUP unless ``nohup`` ignores it."""
    loop = asyncio.get_running_loop()
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    for number in numbers:
        with contextlib.suppress(ValueError, RuntimeError):  # not the main thread: its owner ends the run
            loop.add_signal_handler(number, stop.set)
    try:
        yield
    finally:
        for number in numbers:
            with contextlib.suppress(ValueError, RuntimeError):
                loop.remove_signal_handler(number)
