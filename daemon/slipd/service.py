"""The daemon: assembles the rooms, runs them in one task group, and ends them in order.

One callback carries a reading from its bytes to the published message: record the event, let the engine handle it, send
the outputs. There is no queue, task or await in between.
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
from functools import partial
from pathlib import Path
from typing import Any

from slipd.bus.authentication import guard
from slipd.bus.publisher import Publisher
from slipd.bus.request_server import RequestServer
from slipd.bus.runtime_directory import RuntimeDirectory
from slipd.config import Config
from slipd.engine.engine import Engine
from slipd.engine.warm_up import warm_up
from slipd.events import Event, Publish, Record, Reply, Request, Tick, Write
from slipd.recording.mcap_file import check_new
from slipd.recording.recorder_watch import RecorderWatch
from slipd.recording.requested_recordings import RequestedRecordings, check_room, private_directory, state_dir
from slipd.recording.writer import Recorder, Room
from slipd.ticker import Ticker
from slipd.transport import Links
from slipd.zmtp.endpoint import check_free
from slipd.zmtp.listener import raise_descriptor_limit
from slipd_client.messages import encode
from slipd_client.paths import publish_endpoint, requests_endpoint, runtime_dir

LOSS_REPORT_S = 10.0
"""Period of the log lines about data lost on this host, s: often enough to find the cause, too rare to flood the
log."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Endpoints:
    """The endpoints that the daemon serves."""

    publish: str
    requests: str


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
        run = stack.enter_context(_Run(config, record, stop))
        warm_up()
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


class _Run:
    """One run: the engine, and the sources and sinks of its events except the links.

    Attributes:
        events_handled: Number of events that entered the engine.
    """

    def __init__(self, config: Config, record: Path | None, stop: asyncio.Event) -> None:
        self.boot = secrets.token_hex(8)
        self.links: Links | None = None
        wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self.engine = Engine(config, boot=self.boot, wall_minus_monotonic_ns=wall_minus_monotonic_ns)
        self._config, self._record, self._stop = config, record, stop
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._failure: BaseException | None = None
        self._over = False
        self.events_handled = 0
        self._stack = ExitStack()
        self._recorder: Recorder | None = None
        self._recording: RecorderWatch | None = None
        self.ready = False

    def __enter__(self) -> _Run:
        bus = self._config.bus
        with ExitStack() as stack:
            self._allowed = guard(bus)
            in_home = None in (bus.publish, bus.requests)
            self._home = stack.enter_context(RuntimeDirectory(runtime_dir())) if in_home else None
            for endpoint, access in ((bus.publish, self._allowed.publish), (bus.requests, self._allowed.requests)):
                if endpoint is not None:
                    check_free(endpoint, access)
            if self._record is not None:
                check_new(self._record)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def open(self) -> None:
        """Serve the endpoints, then create the recording, so that a run that fails to start leaves no file."""
        self._requested = self._stack.enter_context(contextlib.closing(self._requested_recordings()))
        recording = self._stack.enter_context(ExitStack())  # closed after the sockets, with the last messages
        self._open_bus(self._stack)
        if self._record is not None:
            self._recorder = self._make_recorder(self._record)
            self._recording = RecorderWatch("", self._recorder, time.monotonic_ns())
            recording.callback(self._close_recording, self._recording)

    def _open_bus(self, stack: ExitStack) -> None:
        bus, allowed = self._config.bus, self._allowed
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
        if self._home is not None:
            self._home.share(self._publisher.endpoint)
            self._home.share(self._requests.endpoint)

    def _requested_recordings(self) -> RequestedRecordings:
        limits, folder = self._config.recording, state_dir()
        room = Room(limits.max_bytes, limits.min_free_bytes)

        def prepare() -> None:
            private_directory(folder)
            check_room(folder, room, limits.max_files)

        return RequestedRecordings(folder, partial(self._make_recorder, room=room), prepare)

    def _make_recorder(
        self, path: Path, prepare: Callable[[], None] | None = None, *, room: Room | None = None
    ) -> Recorder:
        return Recorder(
            path,
            config_text=self._config.text,
            boot=self.boot,
            wall_minus_monotonic_ns=self._wall_minus_monotonic_ns,
            prepare=prepare,
            room=room,
        )

    def _close_recording(self, recording: RecorderWatch) -> None:
        if not self.ready:
            recording.recorder.discard()
        recording.close()

    def report_recording(self) -> None:
        """Pass changes of the recording of the whole run to the engine."""
        if self._recording is not None and (change := self._recording.poll(time.monotonic_ns())):
            self.handle(change)

    def end(self) -> None:
        """Stop the sensors, unless the engine failed; events that arrive while the links close are ignored."""
        self._over = True
        if self.links is not None and self._failure is None:
            for write in self.engine.farewell():
                self.links.write(write.link, write.data)

    def handle(self, event: Event, t_ns: int | None = None) -> None:
        """Handle one event at ``t_ns``, or now; a failure ends the run."""
        if self._over:
            return
        self.events_handled += 1
        try:
            self._handle(event, time.monotonic_ns() if t_ns is None else t_ns)
        except Exception as error:  # of any kind: the run must end and report it
            self._failure = self._failure or error
            self._stop.set()

    def tick(self, tick: Tick, t_ns: int) -> None:
        """Pass the time to the engine, then changes of the recordings."""
        self.handle(tick, t_ns)
        self.report_recording()
        for change in self._requested.changes(time.monotonic_ns()):
            self.handle(change)

    def on_loop_fault(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """End the run because a callback outside the engine failed, such as that of a socket or task."""
        loop.default_exception_handler(context)
        self._failure = self._failure or context.get("exception") or RuntimeError(context["message"])
        self._stop.set()

    def raise_failure(self) -> None:
        """Raise the failure that ended the run, if there is one."""
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
                self._requested.handle(output, t_ns)

    def _on_request(self, client: bytes, body: dict[str, Any]) -> None:
        self.handle(Request(client, body))


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
