"""The daemon: puts the rooms together, keeps them in one task group, and ends them in order.

One callback carries what arrives from the bytes to the published message: record the event, let the engine handle it,
send what comes out. No queue, no task and no await in between.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import secrets
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slipd.bus.authentication import guard
from slipd.bus.publisher import Publisher
from slipd.bus.requests import RequestServer
from slipd.bus.runtime import RuntimeDirectory
from slipd.config import Config
from slipd.pipeline.engine import Engine
from slipd.pipeline.events import Event, Publish, Record, Reply, Request, Tick, Write
from slipd.pipeline.warm_up import warm_up
from slipd.recording.on_request import RequestedRecordings, state_dir
from slipd.recording.writer import Recorder
from slipd.transport import Links
from slipd.zmtp.listener import raise_descriptor_limit
from slipd_client.messages import encode
from slipd_client.paths import publish_endpoint, requests_endpoint, runtime_dir

#: How often time itself enters the engine: sessions and staleness (20 ms at the least) are judged by it.
TICK_S = 0.005

#: How often it is told that more was lost on this host: often enough to find the cause, too seldom to flood the log.
LOSSES_TOLD_S = 10.0

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Where the daemon serves."""

    publish: str
    requests: str


async def serve(
    config: Config,
    *,
    record: Path | None = None,
    on_ready: Callable[[Endpoints], None] = lambda _: None,
    stop: asyncio.Event | None = None,
) -> None:
    """Runs the daemon until SIGINT, SIGTERM or ``stop``.

    Args:
        config: The rig.
        record: File that every event and message is written to; None: nothing is recorded.
        on_ready: Called once the endpoints serve and the kernels are compiled.
        stop: Set it to end the run.

    Raises:
        LinkError: An endpoint cannot be bound, a key file is none, or another daemon holds the runtime directory.
        RecordingError: The recording cannot be created.
    """
    warm_up()
    raise_descriptor_limit()
    stop = stop or asyncio.Event()
    with ExitStack() as stack:
        run = stack.enter_context(_Run(config, record, stop))
        stack.enter_context(_signals(stop))
        asyncio.get_running_loop().set_exception_handler(run.on_loop_fault)
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        async with asyncio.TaskGroup() as tasks, Links(tasks, run.engine.links.values(), run.take) as links:
            run.links = links
            ticker = tasks.create_task(_tick(run.tick), name="ticker")
            teller = tasks.create_task(_tell_losses(links), name="losses")
            on_ready(run.endpoints)
            await stop.wait()
            ticker.cancel()
            run.end()
            teller.cancel()
    run.raise_failure()


class _Run:
    """One run: the engine and everything that its events come from and go to, but for the links."""

    def __init__(self, config: Config, record: Path | None, stop: asyncio.Event) -> None:
        self.boot = secrets.token_hex(8)
        self.links: Links | None = None
        wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self.engine = Engine(config, boot=self.boot, wall_minus_monotonic_ns=wall_minus_monotonic_ns)
        self._config, self._record, self._stop = config, record, stop
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._failure: BaseException | None = None
        self._over = False
        self._stack = ExitStack()

    def __enter__(self) -> _Run:
        with ExitStack() as stack:
            self._open_bus(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def _open_bus(self, stack: ExitStack) -> None:
        bus = self._config.bus
        allowed = guard(bus)
        home = stack.enter_context(RuntimeDirectory(runtime_dir())) if None in (bus.publish, bus.requests) else None
        self._recorder = self._open_recorder(stack)
        self._requested = RequestedRecordings(state_dir(), self._make_recorder)
        stack.callback(self._requested.close)
        publisher = Publisher(bus.publish or publish_endpoint(), allowed.publish)
        self._publisher = stack.enter_context(publisher)
        requests = RequestServer(
            bus.requests or requests_endpoint(),
            self._on_request,
            allowed.requests,
            requesters=allowed.requesters,
            per_second=bus.requests_hz,
        )
        self._requests = stack.enter_context(requests)
        self.endpoints = Endpoints(self._publisher.endpoint, self._requests.endpoint)
        if home is not None:
            home.share(self._publisher.endpoint)
            home.share(self._requests.endpoint)

    def _open_recorder(self, stack: ExitStack) -> Recorder | None:
        if self._record is None:
            return None
        recorder = self._make_recorder(self._record)
        stack.callback(recorder.close)
        return recorder

    def _make_recorder(self, path: Path, prepare: Callable[[], None] | None = None) -> Recorder:
        return Recorder(
            path,
            config_text=self._config.text,
            boot=self.boot,
            wall_minus_monotonic_ns=self._wall_minus_monotonic_ns,
            prepare=prepare,
        )

    def end(self) -> None:
        """Stops the sensors, unless the engine failed; what comes while the links close is not taken any more."""
        self._over = True
        if self.links is not None and self._failure is None:
            for write in self.engine.farewell():
                self.links.write(write.link, write.data)

    def take(self, event: Event) -> None:
        """Takes one event now; a failure ends the run."""
        if self._over:
            return
        try:
            self._handle(event, time.monotonic_ns())
        except Exception as error:  # whatever it is: the run must end and say so
            self._failure = self._failure or error
            self._stop.set()

    def tick(self, tick: Tick) -> None:
        """Lets time enter the engine, behind what became of a recording meanwhile."""
        failed = self._requested.failed()
        if failed is not None:
            self.take(failed)
        self.take(tick)

    def on_loop_fault(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """A callback outside the engine failed (a socket, a task): silence would be the worst answer."""
        loop.default_exception_handler(context)
        self._failure = self._failure or context.get("exception") or RuntimeError(context["message"])
        self._stop.set()

    def raise_failure(self) -> None:
        """Raises what ended the run, if anything did."""
        if self._failure is not None:
            raise self._failure

    def _handle(self, event: Event, t_ns: int) -> None:
        recorder = self._recorder
        if recorder is not None:
            recorder.event(event, t_ns)
        self._requested.record_event(event, t_ns)
        for output in self.engine.handle(event, t_ns):
            if isinstance(output, Publish):
                payload = encode(output.body)
                self._publisher.publish(output.topic, payload)
                if recorder is not None:
                    recorder.published(output.topic, payload, t_ns)
                self._requested.record_published(output.topic, payload, t_ns)
            elif isinstance(output, Write):
                if self.links is not None:
                    self.links.write(output.link, output.data)
            elif isinstance(output, Reply):
                self._requests.reply(output.client, output.body)
            elif isinstance(output, Record):
                self._requested.take(output, t_ns)

    def _on_request(self, client: bytes, body: dict[str, Any]) -> None:
        self.take(Request(client, body))


async def _tick(take: Callable[[Tick], None]) -> None:
    """Lets time enter the engine, without drifting; how late the loop was shows in the recorded times."""
    loop = asyncio.get_running_loop()
    due = loop.time()
    while True:
        awake_ns = time.monotonic_ns()  # read first, so that the difference is never negative
        take(Tick(time.clock_gettime_ns(time.CLOCK_BOOTTIME) - awake_ns))
        due = max(due + TICK_S, loop.time())
        await asyncio.sleep(due - loop.time())


async def _tell_losses(links: Links) -> None:
    """Logs, now and then and at the end, what links lost on this host; the engine cannot know of it."""
    told: dict[str, tuple[int, int]] = {}
    while True:
        try:
            await asyncio.sleep(LOSSES_TOLD_S)
        finally:
            for name, refused in links.refused_writes.items():
                lost = refused, links.overruns[name]
                if lost != told.get(name, (0, 0)):
                    _log.warning("%s: %d writes dropped, %d datagrams lost unread so far", name, *lost)
                told[name] = lost


@contextlib.contextmanager
def _signals(stop: asyncio.Event) -> Iterator[None]:
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(ValueError, RuntimeError):  # not the main thread: whoever owns it ends the run
            loop.add_signal_handler(number, stop.set)
    try:
        yield
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            with contextlib.suppress(ValueError, RuntimeError):
                loop.remove_signal_handler(number)
