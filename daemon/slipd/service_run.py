"""One run of the daemon: the engine, and the sources and sinks of its events except the links.

One callback carries a reading from its bytes to the published message: record the event, let the engine handle it, send
the outputs. There is no queue, task or await in between.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from slipd.config import Config
from slipd.engine.engine import Engine
from slipd.events import Event, HostNotice, Publish, Record, Reply, Request, Tick, Write
from slipd.grasp.stored_state import rig_of
from slipd.io.bus.authentication import guard
from slipd.io.bus.publisher import Publisher
from slipd.io.bus.request_server import RequestServer
from slipd.io.bus.runtime_directory import RuntimeDirectory
from slipd.io.log_lines import log_kept
from slipd.io.transport import Links
from slipd.io.zmtp.endpoint import check_free
from slipd.io.zmtp.listener import Listener
from slipd.recording.incidents import Incidents
from slipd.recording.mcap_file import RecordingFile, check_new
from slipd.recording.requested_recordings import (
    RecorderWatch,
    RequestedRecordings,
    check_room,
    private_directory,
    state_dir,
)
from slipd.recording.run_files import KIND, ContinuousRecording, RunFiles, run_name
from slipd.recording.state_file import StateFile
from slipd.recording.writer import Recorder, Room
from slipd_client.health.repairs import summary
from slipd_client.messages import GRASP_TOPIC, STATUS_TOPIC, WARNING_TOPIC, encode
from slipd_client.paths import log_file, publish_endpoint, requests_endpoint, runtime_dir

T = TypeVar("T")

KEEP_NS = 100_000_000
"""Time between two looks at the state that is kept for the next run: what a kill may cost of it."""


@dataclass(frozen=True, slots=True)
class Endpoints:
    """The endpoints that the daemon serves."""

    publish: str
    requests: str


class ServiceRun:
    """One run, from its claims on resources to its end.

    Args:
        config: The rig.
        record: New file for every event and message; None: nothing is recorded.
        stop: Set where a failure ends the run.
        show_status: Called with a line that sums up each message of the topic ``status``.
        now_ns: The clock of the run; None: CLOCK_MONOTONIC. A simulation passes its own.

    Attributes:
        events_handled: Number of events that entered the engine.
        ticks_handled: Number of ticks among them.
    """

    def __init__(
        self,
        config: Config,
        record: Path | None,
        stop: asyncio.Event,
        show_status: Callable[[str], None],
        now_ns: Callable[[], int] | None = None,
    ) -> None:
        self.boot = secrets.token_hex(8)
        self.links: Links | None = None
        now_ns = now_ns or time.monotonic_ns
        self.engine = Engine(config, boot=self.boot, wall_minus_monotonic_ns=time.time_ns() - now_ns())
        self._config, self._record, self._stop, self._now_ns = config, record, stop, now_ns
        self._failure: BaseException | None = None
        self._over = False
        self.events_handled = self.ticks_handled = 0
        self._show_status = show_status
        self._stack = ExitStack()
        self._recording: RecorderWatch | None = None
        self._continuous: ContinuousRecording | None = None
        self._incidents: Incidents | None = None
        self._recorders: list[Recorder | RequestedRecordings | ContinuousRecording | Incidents] = []
        self._state: StateFile | None = None
        self._state_problem = ""
        self._kept_ns = 0
        self._recordings_dir = Path(config.recording.directory or state_dir())
        self.ready = False

    def __enter__(self) -> ServiceRun:
        bus = self._config.bus
        with ExitStack() as stack:
            self._allowed = guard(bus)
            in_home = None in (bus.publish, bus.requests)
            self._home = stack.enter_context(RuntimeDirectory(runtime_dir())) if in_home else None
            if in_home:
                stack.enter_context(log_kept(log_file()))
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
        self._recorders.append(self._requested)
        files = self._stack.enter_context(contextlib.closing(RunFiles(self._recordings_dir, self.boot)))
        recording = self._stack.enter_context(ExitStack())  # closed after the sockets, with the last messages
        self._open_bus(self._stack)
        if self._record is not None:
            recorder = self._make_recorder(self._record)
            self._recording = RecorderWatch("", recorder, self._now_ns())
            self._recorders.append(recorder)
            recording.callback(self._close_recording, self._recording)
        elif self._config.recording.continuous.enabled:
            self._continuous = recording.enter_context(contextlib.closing(self._continuous_recording(files)))
            self._recorders.append(self._continuous)
        if self._config.recording.incidents.enabled:
            self._incidents = recording.enter_context(contextlib.closing(self._incidents_of(files)))
            self._recorders.append(self._incidents)
        if self._config.restart.gap_s > 0.0:
            path = state_dir() / f"state-{rig_of(self._config)}.json"
            self._state = self._stack.enter_context(contextlib.closing(StateFile(path)))
            if (restored := self._state.read()) is not None:
                self.handle(restored)

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

    def listeners(self) -> tuple[Listener, Listener]:
        """Return the publisher and the request server."""
        return self._publisher, self._requests

    def _requested_recordings(self) -> RequestedRecordings:
        limits, folder = self._config.recording, self._recordings_dir
        room = Room(limits.max_bytes, limits.min_free_bytes)

        def prepare() -> None:
            private_directory(folder)
            check_room(folder, room, limits.max_files)

        return RequestedRecordings(folder, partial(self._make_recorder, room=room), prepare)

    def _continuous_recording(self, files: RunFiles) -> ContinuousRecording:
        folder, limits = self._recordings_dir, self._config.recording
        continuous = limits.continuous
        room = Room(sys.maxsize, limits.min_free_bytes)

        def prepare() -> None:
            private_directory(folder)
            files.delete_oldest(KIND, continuous.keep_files - 1, continuous.keep_bytes - continuous.file_bytes)

        recordings = RequestedRecordings(folder, partial(self._make_recorder, room=room, place=files.place), prepare)
        return ContinuousRecording(recordings, continuous, run_name(self.boot, self.engine.wall))

    def _incidents_of(self, files: RunFiles) -> Incidents:
        folder, limits = self._recordings_dir, self._config.recording

        def prepare() -> None:
            private_directory(folder)
            check_room(folder, Room(sys.maxsize, limits.min_free_bytes), sys.maxsize)

        def create(path: Path, first: int) -> RecordingFile:
            return self._of_run(RecordingFile)(path, first=first)

        return Incidents(files, limits.incidents, run_name(self.boot, self.engine.wall), create, prepare)

    def _make_recorder(self, path: Path, prepare: Callable[[], None] | None = None, **options: Any) -> Recorder:
        return self._of_run(Recorder)(path, prepare=prepare, **options)

    def _of_run(self, make: Callable[..., T]) -> Callable[..., T]:
        """Return what makes a recording that begins now, with what its head says of the run."""
        wall_ns = self.engine.wall.minus_monotonic_ns
        return partial(make, config_text=self._config.text, boot=self.boot, wall_minus_monotonic_ns=wall_ns)

    def _close_recording(self, recording: RecorderWatch) -> None:
        if not self.ready:
            recording.recorder.discard()
        recording.close()

    def report_recording(self) -> None:
        """Pass changes of the recording of the whole run to the engine."""
        t_ns = self._now_ns()
        if self._recording is not None and (change := self._recording.poll(t_ns)):
            self.handle(change)
        if self._continuous is not None:
            for change in self._continuous.changes(t_ns, lambda: self.engine.kept.first_events(t_ns)):
                self.handle(change)
        if self._incidents is not None and (saved := self._incidents.change(t_ns)):
            self.handle(saved)

    def end(self) -> None:
        """Stop the sensors, unless the run failed; events that arrive while the links close are ignored."""
        self._over = True
        if self.links is not None and self._failure is None:
            for write in self.engine.farewell():
                self.links.write(write.link, write.data)

    def handle(self, event: Event, t_ns: int | None = None) -> None:
        """Handle one event at ``t_ns``, or now; a failure ends the run, and no later event or byte passes."""
        if self._over:
            return
        self.events_handled += 1
        try:
            self._handle(event, self._now_ns() if t_ns is None else t_ns)
        except Exception as error:  # of any kind: the run must end and report it
            self._fail(error)

    def tick(self, tick: Tick, t_ns: int) -> None:
        """Pass the time to the engine, then changes of the recordings."""
        self.handle(tick, t_ns)
        if self._over:
            return
        self.ticks_handled += 1
        self.report_recording()
        for change in self._requested.changes(self._now_ns()):
            self.handle(change)
        if self._state is not None and t_ns - self._kept_ns >= KEEP_NS:
            self._kept_ns = t_ns
            self._state.keep(self.engine.kept.text(t_ns))
            if self._state.problem != self._state_problem:
                self._state_problem = self._state.problem
                self.handle(HostNotice("state", self._state_problem))

    def on_loop_fault(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """End the run because a callback outside the engine failed, such as that of a socket or task."""
        loop.default_exception_handler(context)
        self._fail(context.get("exception") or RuntimeError(context["message"]))

    def _fail(self, failure: BaseException) -> None:
        self._failure, self._over = self._failure or failure, True
        self._stop.set()

    def raise_failure(self) -> None:
        """Raise the failure that ended the run, if there is one."""
        if self._failure is not None:
            raise self._failure

    def _handle(self, event: Event, t_ns: int) -> None:
        for recorder in self._recorders:
            recorder.event(event, t_ns)
        for output in self.engine.handle(event, t_ns):
            if isinstance(output, Publish):
                payload = encode(output.body)
                self._publisher.publish(output.topic, payload, output.frame)
                if output.topic == STATUS_TOPIC:
                    self._show_status(summary(output.body))
                for recorder in self._recorders:
                    recorder.published(output.topic, payload, t_ns)
                if self._incidents is not None:
                    if output.topic == WARNING_TOPIC:
                        self._incidents.note_warning(output.body, t_ns)
                    elif output.topic == GRASP_TOPIC:
                        self._incidents.note_grasp(output.body, t_ns)
            elif isinstance(output, Write):
                if self.links is not None:
                    self.links.write(output.link, output.data)
            elif isinstance(output, Reply):
                self._requests.reply(output.client, output.body)
            elif isinstance(output, Record):
                self._requested.handle(output, t_ns)

    def _on_request(self, client: bytes, body: dict[str, Any]) -> None:
        self.handle(Request(client, body))
