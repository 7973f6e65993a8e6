"""One run of the daemon: the engine, and the sources and sinks of its events except the links.

One callback carries a reading from its bytes to the published message: record the event, let the engine handle it, send
the outputs. There is no queue, task or await in between.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slipd.config import Config
from slipd.engine.engine import Engine
from slipd.events import Event, HostNotice, Output, Publish, Reply, Request, Tick, Write
from slipd.gripper.stored_state import rig_of
from slipd.io.access import RuntimeDirectory, guard
from slipd.io.log_lines import log_kept
from slipd.io.publisher import Publisher
from slipd.io.request_server import RequestServer
from slipd.io.transport import Links
from slipd.io.zmtp.endpoint import check_free
from slipd.recording.run_files import state_dir
from slipd.recording.run_recordings import RunRecordings
from slipd.recording.state_file import StateFile
from slipd_client.messages import STATUS_TOPIC, encode
from slipd_client.paths import log_file, publish_endpoint, requests_endpoint, runtime_dir
from slipd_client.repairs import summary

KEEP_NS = 100_000_000
"""Period at which the state for the next run is kept, ns: a kill loses no more than this much of it. A change of the
grip force is kept at the next tick."""


@dataclass(frozen=True, slots=True)
class Endpoints:
    """The endpoints that the daemon serves."""

    publish: str
    requests: str


class ServiceRun:
    """One run of the daemon. Entering claims its resources, `open` serves its endpoints, and leaving releases them.

    Args:
        config: The rig.
        record: New file for every event and message; None: nothing is recorded.
        stop: Set where a failure ends the run.
        show_status: Called with a line that sums up each message of the topic ``status``.
        now_ns: The clock of the run; None: CLOCK_MONOTONIC. A simulation passes its own.

    Attributes:
        config: The rig.
        stop: As above.
        recordings: All recordings of the run.
        publisher: Sends the messages; from `open` on.
        requests: Takes the requests; from `open` on.
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
        now_ns = now_ns or time.monotonic_ns
        self.engine = Engine(config, boot=self.boot, wall_minus_monotonic_ns=time.time_ns() - now_ns())
        self.config, self.stop = config, stop
        self._record, self._show_status, self._now_ns = record, show_status, now_ns
        self.links: Links | None = None
        self._failure: BaseException | None = None
        self._over = False
        self.events_handled = self.ticks_handled = self._kept_ns = 0
        self._kept_n: float | None = None
        self._state: StateFile | None = None
        self._state_problem = ""
        self._stack = ExitStack()

    def __enter__(self) -> ServiceRun:
        bus = self.config.bus
        with ExitStack() as stack:
            self._allowed = guard(bus)
            self._home: RuntimeDirectory | None = None
            if None in (bus.publish, bus.requests):
                self._home = stack.enter_context(RuntimeDirectory(runtime_dir()))
                stack.enter_context(log_kept(log_file()))
            for endpoint, access in ((bus.publish, self._allowed.publish), (bus.requests, self._allowed.requests)):
                if endpoint is not None:
                    check_free(endpoint, access)
            self.recordings = RunRecordings(self.config, self.boot, self.engine.wall, self._record)
            stack.callback(self.recordings.close)  # after the sockets, with the last messages
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def open(self) -> None:
        """Serve the endpoints, then create the recording, so that a run that fails to start leaves no file."""
        self._open_bus()
        self.recordings.open(self._now_ns())
        if self.config.restart.gap_s > 0.0:
            path = state_dir() / f"state-{rig_of(self.config)}.json"
            self._state = self._stack.enter_context(closing(StateFile(path)))
            if (restored := self._state.read()) is not None:
                self.handle(restored)

    def _open_bus(self) -> None:
        bus, allowed, enter = self.config.bus, self._allowed, self._stack.enter_context
        self.publisher = enter(Publisher(bus.publish or publish_endpoint(), allowed.publish))
        requests = RequestServer(
            bus.requests or requests_endpoint(),
            lambda client, body: self.handle(Request(client, body)),
            allowed.requests,
            requesters=allowed.requesters,
            per_second=bus.requests_hz,
        )
        self.requests = enter(requests)
        self.endpoints = Endpoints(self.publisher.endpoint, self.requests.endpoint)
        if self._home is not None:
            self._home.share(self.publisher.endpoint)
            self._home.share(self.requests.endpoint)

    def end(self) -> None:
        """Keep the state and stop the sensors, unless the run failed; events while the links close are ignored."""
        self._over = True
        if self._failure is not None:
            return
        self._keep_state(self._now_ns())
        if self.links is not None:
            for write in self.engine.farewell():
                self.links.write(write.link, write.data)

    def handle(self, event: Event, t_ns: int | None = None) -> None:
        """Handle one event at ``t_ns``, or now; a failure ends the run, and no later event or byte passes."""
        if self._over:
            return
        self.events_handled += 1
        t_ns = self._now_ns() if t_ns is None else t_ns
        try:
            if self.recordings.active:
                self.recordings.event(event, t_ns)
            for output in self.engine.handle(event, t_ns):
                self._send(output, t_ns)
        except Exception as error:  # of any kind: the run must end and report it
            self._fail(error)

    def tick(self, tick: Tick, t_ns: int) -> None:
        """Pass the time to the engine, then changes of the recordings and of the state that is kept."""
        self.handle(tick, t_ns)
        if self._over:
            return
        self.ticks_handled += 1
        self.report_recordings()
        if t_ns - self._kept_ns >= KEEP_NS or self.engine.kept.force_n != self._kept_n:
            self._keep_state(t_ns)

    def _keep_state(self, t_ns: int) -> None:
        self._kept_ns, self._kept_n = t_ns, self.engine.kept.force_n
        if self._state is None:
            return
        self._state.keep(self.engine.kept.text(t_ns))
        if self._state.problem != self._state_problem:
            self._state_problem = self._state.problem
            self.handle(HostNotice("state", self._state_problem))

    def report_recordings(self) -> None:
        """Pass changes of the recordings to the engine."""
        t_ns = self._now_ns()
        for change in self.recordings.changes(t_ns, lambda: self.engine.kept.first_events(t_ns)):
            self.handle(change)

    def on_loop_fault(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """End the run because a callback outside the engine failed, such as that of a socket or task."""
        loop.default_exception_handler(context)
        self._fail(context.get("exception") or RuntimeError(context["message"]))

    def _fail(self, failure: BaseException) -> None:
        self._failure, self._over = self._failure or failure, True
        self.stop.set()

    def raise_failure(self) -> None:
        """Raise the failure that ended the run, if there is one."""
        if self._failure is not None:
            raise self._failure

    def _send(self, output: Output, t_ns: int) -> None:
        if isinstance(output, Publish):
            payload = encode(output.body)
            self.publisher.publish(output.topic, payload, output.frame)
            if self.recordings.active:
                self.recordings.published(output, payload, t_ns)
            if output.topic == STATUS_TOPIC:
                self._show_status(summary(output.body))
        elif isinstance(output, Write):
            if self.links is not None:
                self.links.write(output.link, output.data)
        elif isinstance(output, Reply):
            self.requests.reply(output.client, output.body)
        else:
            self.recordings.handle(output, t_ns)
