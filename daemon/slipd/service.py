"""The daemon: assembles the rooms, runs them in one task group, and ends them in order."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Callable, Coroutine, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from slipd.compile_kernels import compile_kernels, interruptible
from slipd.config import Config
from slipd.events import HostNotice
from slipd.io.host.config_reload import ConfigReload
from slipd.io.host.run_signals import EndSignals
from slipd.io.host.scheduling import realtime_priority
from slipd.io.host.systemd import SystemdNotifier, Watchdog, stage_checks
from slipd.io.ticker import Ticker
from slipd.io.transport import Links
from slipd.io.zmtp.listener import raise_descriptor_limit
from slipd.service_run import Endpoints, ServiceRun

LOSS_REPORT_S = 10.0
"""Period of the log lines about data lost on this host, s: often enough to find the cause, too rare to flood the
log."""

NOTICE_FAULTS = {"config": "config-kept", "realtime": "realtime-refused"}
"""Topic of a notice → id of its repair (docs/health.md)."""

NO_SYSTEMD = SystemdNotifier({})

_log = logging.getLogger(__name__)


async def serve(
    config: Config,
    *,
    record: Path | None = None,
    on_ready: Callable[[Endpoints], None] = lambda _: None,
    stop: asyncio.Event | None = None,
    ends: EndSignals | None = None,
    reload: ConfigReload | None = None,
    notices: Mapping[str, str] = {},
    notifier: SystemdNotifier = NO_SYSTEMD,
) -> None:
    """Run the daemon until ``stop``, a signal of ``ends``, or a config that ``reload`` finds.

    Resources that only one daemon may hold are claimed first, so that a second daemon is refused before it compiles its
    kernels.

    Args:
        config: The rig.
        record: New file for every event and message; None: nothing is recorded.
        on_ready: Called once the endpoints are served and the kernels are compiled.
        stop: Setting it ends the run.
        ends: Signals that end the run; handled from here on once the kernels are compiled.
        reload: Waits for another config.
        notices: Notices that ``status`` shows from the start, by topic.
        notifier: Reports to systemd.

    Raises:
        LinkError: An endpoint cannot be bound, a key file is invalid, or another daemon holds the runtime directory.
        KeyboardInterrupt: SIGINT came before the kernels were ready.
        RecordingError: The recording cannot be created, or its disk failed; a failing disk does not end the run.
    """
    stop = stop or asyncio.Event()
    with ExitStack() as stack:
        with interruptible():
            run = stack.enter_context(ServiceRun(config, record, stop, notifier.status))
            compile_kernels()
        raise_descriptor_limit()
        if ends is not None:
            ends.handle(stop)
        run.open()
        refused = stack.enter_context(realtime_priority(config.realtime.priority))
        asyncio.get_running_loop().set_exception_handler(run.on_loop_fault)
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        async with asyncio.TaskGroup() as tasks, Links(tasks, run.engine.links.values(), run.handle) as links:
            run.links = links
            helpers = [
                tasks.create_task(work, name=name)
                for name, work in _helpers(run, links, config, stop, reload, notifier).items()
            ]
            run.report_recordings()
            _report_notices(run, {**notices, "realtime": refused})
            on_ready(run.endpoints)
            run.recorders.kept = True
            notifier.ready()
            await stop.wait()
            (notifier.stopping if reload is None or reload.found is None else notifier.reloading)()
            run.end()
            for helper in helpers:
                helper.cancel()
    run.raise_failure()


def _helpers(
    run: ServiceRun,
    links: Links,
    config: Config,
    stop: asyncio.Event,
    reload: ConfigReload | None,
    notifier: SystemdNotifier,
) -> dict[str, Coroutine[Any, Any, None]]:
    """Return what runs beside the links, by the names of the tasks."""
    helpers = {
        "ticker": Ticker(run.tick, lambda: run.events_handled, run.engine.wall.minus_monotonic_ns).run(),
        "losses": _report_losses(links),
    }
    if reload is not None:
        helpers["reload"] = reload.watch(config, run.handle, stop)
    if notifier.watchdog_s is not None:
        checks = stage_checks(links, lambda: run.ticks_handled, *run.listeners())
        helpers["watchdog"] = Watchdog(notifier.feed, notifier.watchdog_s, checks).run()
    return helpers


def _report_notices(run: ServiceRun, notices: Mapping[str, str]) -> None:
    for topic, text in notices.items():
        if text:
            _log.warning("%s: %s", topic, text, extra={"slipd_fault": NOTICE_FAULTS[topic]})
            run.handle(HostNotice(topic, text))


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
                    _log.warning(
                        "%s: %d writes dropped, %d datagrams lost before they were read so far",
                        name,
                        *lost,
                        extra={"slipd_stream": name},
                    )
                reported[name] = lost
