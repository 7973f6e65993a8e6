"""The service under a clock that only this program moves: hours of work need no waiting.

`ServiceRun` is the daemon's own: engine, sockets, recordings, incidents. Only the links and the clock are simulated.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from pathlib import Path
from random import Random
from typing import Any

from shifts.faulty_lines import FaultyLines
from shifts.shift_program import Newest, ShiftProgram
from shifts.slow_rig import MS, SECOND, STEP_NS, SlowRig, settings

from slipd.engine.engine import Engine
from slipd.events import Event, Output, Publish, Reply, Request, Tick
from slipd.service_run import ServiceRun

BEGIN_NS = 50 * SECOND
"""CLOCK_MONOTONIC at the start."""

START_S = 8.0
"""Without faults: the sensors boot."""

RENEW_NS = 80 * MS
TURN_STEPS = 20
"""After so many steps the sockets are served."""

MOST_WAITING, MOST_QUEUED = 300, 8_000
"""Messages that wait for the subscriber, and entries that wait for a disk, before the simulation lets them catch up:
both have less time for a second than in a real run."""

CATCH_UP_S = 0.002
MOST_FAULTS_LISTED = 20


class LogCounter(logging.Handler):
    """Counts the lines of the log by level and by the id of their fault."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.counts: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        """Count a line."""
        self.counts[getattr(record, "slipd_fault", record.levelname.lower())] += 1


class _Overheard:
    """The engine; a function sees each of its outputs."""

    def __init__(self, engine: Engine, look: Callable[[Output], None]) -> None:
        self._engine, self._look = engine, look
        self.links, self.farewell, self.kept = engine.links, engine.farewell, engine.kept

    def handle(self, event: Event, t_ns: int) -> list[Output]:
        outputs = self._engine.handle(event, t_ns)
        for output in outputs:
            self._look(output)
        return outputs


class ShiftRun:
    """One run.

    Args:
        folder: For the recordings.
        seed: Of noise, jobs and faults.
        file_s: Longest time in one file of the continuous recording.

    Attributes:
        t_ns: CLOCK_MONOTONIC of the run.
        service: The daemon's own run.
        engine: Its engine.
        lines: The lines and their faults.
        program: The robot program.
        messages: Number of messages by topic.
        events: Number of events that entered.
        wrong: What did not hold, in words; the first few.
    """

    def __init__(self, folder: Path, seed: int, file_s: float) -> None:
        self.t_ns = BEGIN_NS
        self.service = ServiceRun(settings(folder, file_s), None, asyncio.Event(), lambda _: None, lambda: self.t_ns)
        self.engine = self.service.engine
        self.service.engine = _Overheard(self.engine, self._look)  # type: ignore[assignment]
        self.messages: Counter[str] = Counter()
        self.wrong: list[str] = []
        self._rig = SlowRig(seed)
        self.lines = FaultyLines(self._rig, Random(seed))
        self._newest = Newest()
        self.program = ShiftProgram(
            self._rig, self._newest, self._ask, self._switch, lambda: self._age_ns, Random(seed + 1)
        )
        self._plan = self.program.run()
        self._program_due_ns = self._renew_due_ns = 0
        self._numbers: dict[str, int] = {}
        self._asked = self._steps = 0
        self._reply: dict[str, Any] = {}
        self._lost: dict[str, int] = {}

    @property
    def events(self) -> int:
        """Number of events that entered the daemon."""
        return self.service.events_handled

    @property
    def hours(self) -> float:
        """Simulated time since the start."""
        return self._age_ns / (3600 * SECOND)

    @property
    def lost_entries(self) -> int:
        """Number of entries that recordings lost, as ``status`` reports them."""
        return sum(self._lost.values())

    @property
    def slips(self) -> int:
        """How often the box slid."""
        return self._rig.slips

    @property
    def _age_ns(self) -> int:
        return self.t_ns - BEGIN_NS

    async def play(
        self, hours: float, every_s: float, sample: Callable[[], Awaitable[None]], most_s: float = math.inf
    ) -> None:
        """Run for some hours of simulated time; call ``sample`` again and again between two jobs.

        The run ends between two jobs, or earlier where ``most_s`` of real time have passed.

        The daemon must be open, and serves on the running loop.
        """
        self.service.links = self  # type: ignore[assignment]
        next_ns, until_s = 0, time.monotonic() + most_s
        end_ns = hours * 3600 * SECOND
        while (self._age_ns < end_ns or self.program.holder) and time.monotonic() < until_s:
            self._step()
            if self._steps % TURN_STEPS == 0:
                await self._let_others_run()
            if self._age_ns >= next_ns and not self.program.holder:
                next_ns += round(every_s * SECOND)
                await sample()
            self.lines.calm = self._age_ns < START_S * SECOND
        self.service.raise_failure()

    def write(self, link: str, data: bytes) -> None:
        """Take what the daemon writes to a device, in place of `slipd.io.transport.Links`."""
        self.lines.write(link, data, self._age_ns)

    def _switch(self, on: bool) -> None:
        self.lines.off = not on

    def _step(self) -> None:
        self._steps += 1
        self.t_ns += STEP_NS
        was_stalled = self.lines.stalled
        events = self.lines.step(self._age_ns)
        for event in events:
            self.service.handle(event, self.t_ns)
        if self.lines.stalled:
            return
        self.service.tick(Tick(self.lines.suspended_ns, was_stalled), self.t_ns)
        if self._age_ns >= START_S * SECOND:
            self._work()

    def _work(self) -> None:
        now_ns = self._age_ns
        if self.program.holder and now_ns >= self._renew_due_ns:
            self._renew_due_ns = now_ns + RENEW_NS
            self._ask(self.program.holder, "lease.renew")
        if now_ns >= self._program_due_ns:
            self._program_due_ns = now_ns + round(next(self._plan) * SECOND)

    def _ask(self, client: bytes, op: str, **fields: Any) -> dict[str, Any]:
        self._asked += 1
        envelope = {"v": 1, "id": self._asked, "op": op, "boot": self.service.boot}
        self._reply = {}
        body = envelope | {"deadline_ns": self.t_ns + 100 * MS} | fields
        self.service.handle(Request(client, body), self.t_ns)
        return self._reply or {"ok": op == "record.start", "error": {"code": "none yet"}}

    def _look(self, output: Output) -> None:
        if isinstance(output, Publish):
            self._hear(output.topic, output.body)
        elif isinstance(output, Reply):
            self._reply = output.body

    def _hear(self, topic: str, body: dict[str, Any]) -> None:
        self.messages[topic] += 1
        if body["seq"] != self._numbers.get(topic, 0):
            self._blame(f"{topic} has seq {body['seq']} behind {self._numbers.get(topic, 0) - 1}")
        self._numbers[topic] = body["seq"] + 1
        if topic == "gripper":
            self._newest.gripper = body
        elif topic == "status":
            self._newest.status = body
            for recording in (body["recording"], body["run_recording"]):
                if recording is not None and recording["lost"]:
                    self._lost[recording["path"]] = recording["lost"]
        elif topic == "warning":
            finger = body["finger"]
            if body["previous"] != self._newest.levels[finger]:
                self._blame(f"{finger} was {self._newest.levels[finger]}, reported as {body['previous']} before")
            self._newest.levels[finger] = body["level"]
        elif topic.startswith("slip."):
            self._check_level(body)

    def _check_level(self, body: dict[str, Any]) -> None:
        if body["level"] != self._newest.levels[body["finger"]]:
            self._blame(f"{body['finger']} is {body['level']} without a warning of the change")
        if any(value is not None and not math.isfinite(value) for value in (body["utilisation"], body["normal_n"])):
            self._blame(f"{body['finger']}: a number that is not finite")

    def _blame(self, what: str) -> None:
        if len(self.wrong) < MOST_FAULTS_LISTED:
            self.wrong.append(f"at {self._age_ns * 1e-9:.3f} s: {what}")

    async def _let_others_run(self) -> None:
        """Serve the sockets, and let subscribers and disks catch up."""
        await asyncio.sleep(0)
        while self._behind():  # noqa: ASYNC110 - threads and another process
            await asyncio.sleep(CATCH_UP_S)

    def _behind(self) -> bool:
        service = self.service
        if any(peer.waiting > MOST_WAITING for peer in service._publisher._listener.peers):
            return True
        if service._incidents is not None and service._incidents._queue.qsize() > MOST_QUEUED:
            return True
        files = (service._requested, service._continuous._recordings) if service._continuous else ()
        for recordings in files:
            running = [watch.recorder for watch in (recordings._running, *recordings._ended) if watch is not None]
            if any(one._queue.qsize() > MOST_QUEUED or not (one.begun or one.finished) for one in running):
                return True
        return False
