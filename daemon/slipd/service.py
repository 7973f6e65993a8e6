"""The daemon: assembles the rooms, runs them in one task group, and ends them in order.

A config file is served until the run ends, and again when the file has changed.
"""

from __future__ import annotations

import asyncio
import gc
import itertools
import logging
import signal
import time
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from slipd.compile_kernels import compile_kernels, interruptible
from slipd.config import Config, hints, load
from slipd.errors import SlipdError, one_line
from slipd.events import Event, HostNotice
from slipd.io.event_loop import Ticker, realtime_priority
from slipd.io.run_signals import EndSignals, changed_config, kept_text, reload_requests
from slipd.io.systemd import SystemdNotifier, watch_stages
from slipd.io.transport import Links
from slipd.io.zmtp.listener import raise_descriptor_limit
from slipd.service_run import Endpoints, ServiceRun

LOSS_REPORT_S = 10.0
"""Period of the log lines about data lost on this host, s: often enough to find the cause, too rare to flood the
log."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ProcessControl:
    """How a process of its own controls a run: by signals, by its config file, and through systemd.

    Attributes:
        ends: Signals that end the run, once the kernels are compiled; None: none do.
        changed: Waits until the file holds another config than the given one, and returns it; meanwhile it reports
            notices to the given function. None: the file is not read again.
        config_fault: Why the config in force is not that of the file, for people; "" where it is.
        notifier: Reports to systemd.
    """

    ends: EndSignals | None = None
    changed: Callable[[Config, Callable[[Event], None]], Coroutine[Any, Any, Config]] | None = None
    config_fault: str = ""
    notifier: SystemdNotifier = SystemdNotifier({})  # noqa: RUF009 - without systemd it has no state


NO_CONTROL = ProcessControl()


async def serve(
    config: Config,
    *,
    record: Path | None = None,
    on_ready: Callable[[Endpoints], None] = lambda _: None,
    stop: asyncio.Event | None = None,
    control: ProcessControl = NO_CONTROL,
) -> Config | None:
    """Run the daemon until ``stop`` is set, or the process ends the run.

    Resources that only one daemon may hold are claimed first, so that a second daemon is refused before it compiles its
    kernels.

    Args:
        config: The rig.
        record: New file for every event and message; None: nothing is recorded.
        on_ready: Called once the endpoints are served and the kernels are compiled.
        stop: Setting it ends the run.
        control: How the process controls the run; by default it does not.

    Returns:
        The changed config of the file, which ended the run; None where something else did.

    Raises:
        LinkError: An endpoint cannot be bound, a key file is invalid, or another daemon holds the runtime directory.
        KeyboardInterrupt: SIGINT came before the kernels were ready.
        RecordingError: The recording cannot be created, or its disk failed; a failing disk does not end the run.
    """
    stop = stop or asyncio.Event()
    with ExitStack() as stack:
        with interruptible():
            run = ServiceRun(config, record, stop, lambda text: control.notifier.send(f"STATUS={one_line(text)}"))
            stack.callback(run.raise_failure)  # last of all: it counts more than a recording that cannot be closed
            stack.enter_context(run)
            compile_kernels()
        raise_descriptor_limit()
        if control.ends is not None:
            control.ends.handle(stop)
        run.open()
        refused = stack.enter_context(realtime_priority(config.realtime.priority))
        asyncio.get_running_loop().set_exception_handler(run.on_loop_fault)
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        async with asyncio.TaskGroup() as tasks, Links(tasks, run.engine.links.values(), run.handle) as links:
            run.links = links
            helpers = {name: tasks.create_task(work, name=name) for name, work in _helpers(run, links, control).items()}
            _report_start(run, control.config_fault, refused)
            on_ready(run.endpoints)
            run.recordings.kept = True
            control.notifier.send("READY=1")
            reload = helpers.get("reload")
            if reload is not None:
                reload.add_done_callback(lambda _: stop.set())
            await stop.wait()
            found: Config | None = reload.result() if reload is not None and reload.done() else None
            reloading = "RELOADING=1", f"MONOTONIC_USEC={time.monotonic_ns() // 1000}"
            control.notifier.send(*(("STOPPING=1",) if found is None else reloading))
            run.end()
            for helper in helpers.values():
                helper.cancel()
    return found


def _report_start(run: ServiceRun, config_fault: str, refused: str) -> None:
    """Report the recordings, and what is wrong with the run from its start; each text is "" where nothing is.

    Args:
        run: The run.
        config_fault: Why the config in force is not that of the file.
        refused: Why the run has no real-time priority.
    """
    run.report_recordings()
    if refused:
        _log.warning("realtime: %s", refused, extra={"slipd_fault": "realtime-refused"})
    for topic, text in (("config", config_fault), ("realtime", refused)):
        if text:
            run.handle(HostNotice(topic, text))


def _helpers(run: ServiceRun, links: Links, control: ProcessControl) -> dict[str, Coroutine[Any, Any, Any]]:
    """Return what runs beside the links, by the names of the tasks; "reload" returns the changed config."""
    notifier = control.notifier
    helpers: dict[str, Coroutine[Any, Any, Any]] = {
        "ticker": Ticker(run.tick, lambda: run.events_handled, run.engine.wall.minus_monotonic_ns).run(),
        "losses": _report_losses(links),
    }
    if notifier.watchdog_s is not None:
        listeners = run.publisher, run.requests
        helpers["watchdog"] = watch_stages(
            lambda: notifier.send("WATCHDOG=1"), notifier.watchdog_s, links, lambda: run.ticks_handled, listeners
        )
    if control.changed is not None:
        helpers["reload"] = control.changed(run.config, run.handle)
    return helpers


async def _report_losses(links: Links) -> None:
    """Log, periodically and at the end, what the links lost on this host; the engine cannot see it."""
    reported: dict[str, tuple[int, int]] = {}
    while True:
        try:
            await asyncio.sleep(LOSS_REPORT_S)
        finally:
            for name, lost in links.losses.items():  # also of the time since the last look, when it is cancelled
                if lost != reported.get(name, (0, 0)):
                    _log.warning(
                        "%s: %d commands not sent (line down, or not read), %d datagrams lost so far",
                        name,
                        *lost,
                        extra={"slipd_stream": name},
                    )
                reported[name] = lost


def run_command(config: Path, record: Path | None) -> None:
    """Run the daemon until a signal ends it.

    Args:
        config: Config of the rig.
        record: New file for every event and message; None: nothing is recorded.

    Raises:
        ConfigError: The config cannot be read or has faults.
        SlipdError: The daemon cannot start, or its recording failed.
    """
    try:
        asyncio.run(serve_file(config, record))
    except BaseExceptionGroup as group:
        first: BaseException = group
        while isinstance(first, BaseExceptionGroup):  # the first failure inside task groups
            first = first.exceptions[0]
        raise first from group


async def serve_file(file: Path, record: Path | None) -> None:
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

    Raises:
        SlipdError: The first run cannot start, neither the changed config nor the one before can, or the recording of a
            run failed.
    """
    notifier, config, requested = SystemdNotifier(), load(file), reload_requests()
    before: Config | None = None  # the config to go back to
    refused: SlipdError | None = None  # why the config of the file is not in force
    served = False

    def show(endpoints: Endpoints) -> None:
        """Print the endpoints of a run, for people and for programs that start the daemon."""
        nonlocal served
        served = True
        print(f"publish: {endpoints.publish}\nrequests: {endpoints.requests}", flush=True)

    hangup = [signal.SIGHUP] if requested is None else []  # ends the daemon where it does not reload
    with EndSignals(signal.SIGINT, signal.SIGTERM, *hangup) as ends:
        while not ends.received:
            for hint in hints(config, str(file)) if refused is None else ():
                _log.warning("%s", hint)
            changed = None if requested is None else partial(changed_config, file, requested)
            first, served = before is None and refused is None, False
            try:
                found = await serve(
                    config,
                    record=None if record is None else _free_name(record, first=first),
                    on_ready=show,
                    control=ProcessControl(ends, changed, "" if refused is None else kept_text(refused), notifier),
                )
            except SlipdError as error:
                if served or first:
                    raise
                if before is None:
                    raise SlipdError(
                        f"{file}: neither the changed config nor the one before can start\n"
                        f"  changed: {refused}\n  before: {error}"
                    ) from error
                config, before, refused = before, None, error
                _log.error("%s", kept_text(error), extra={"slipd_fault": "config-kept"})
            else:
                if found is None:
                    return
                config, before, refused = found, config, None
        notifier.send("STOPPING=1")


def _free_name(path: Path, *, first: bool) -> Path:
    """Return the path for the first run; for a later one, the first free path with a number."""
    if first:
        return path
    numbered = (path.with_stem(f"{path.stem}-{number}") for number in itertools.count(2))
    return next(name for name in numbered if not name.exists())
