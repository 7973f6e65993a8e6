"""The whole engine and the virtual gripper in one process, under a clock that only the test moves.

Nothing here waits, sleeps or draws a number that the seed does not fix: the same seed gives the same run to the byte.
"""

from __future__ import annotations

import copy
import functools
import hashlib
from dataclasses import replace
from random import Random
from typing import Any

from simulation.line import Fault, Line
from simulation.watch import Watch

from slipd import config
from slipd.devices import DEVICES, Decoder
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkDown, LinkUp, Output, Publish, Reply, Request, Tick, Write
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import Script
from slipd.tools.sim.virtual_gripper import LINES, VirtualRig
from slipd_client import messages

MS = 1_000_000
SECOND = 1_000 * MS
STEP_NS = 1_250_000
"""The force sensors' period."""

TICK_EVERY = 4
"""Steps between two ticks of the engine: 5 ms, as in the service."""

BEGIN_NS = 50 * SECOND
"""CLOCK_MONOTONIC at the start."""

WALL_NS = 1_700_000_000 * SECOND
BOOT = "bed"
FINGERS = ("left", "right")
NEVER_S = 1e6
GRIP_N = 8.0
QUIET = Script(
    lift_s=1.2,
    ramp_s=0.1,
    pour_s=NEVER_S,
    pour_until_s=NEVER_S,
    drain_s=NEVER_S,
    tug_s=NEVER_S,
    set_down_s=NEVER_S,
)
"""The box is lifted a moment after it is gripped, and nothing else happens to it."""

LIMITS = {
    "step_n = 2.0": "step_n = 3.0",
    "lower_n_per_s = 2.0": "lower_n_per_s = 20.0",
    "budget_n = 25.0": "budget_n = 1000.0",
}

ANSWER_S, READY_S, TARE_S, HELD_S = 0.05, 0.75, 0.05, 0.7
"""The gripper answers after the first; after the second streams run; then a tare; then the grip and the lift."""

STIFF = PvdfElectronics(tau_s=1e9)
"""A pad that reads force itself: it need not have seen the contact begin."""


def settings(*, charge: bool = False, streams: dict[str, str] | None = None) -> config.Config:
    """The demo's rig, its status told at every fourth tick, its grip changed as fast as a moving load needs.

    Args:
        charge: Its pads leak their charge; else they read force.
        streams: Lines added to the tables of streams, such as ``left.wrench``.
    """
    text = config.shipped("demo.toml").read_text(encoding="utf-8")
    if not charge:
        text = text.replace("charge_tau_s = 2.0", "").replace("threshold = 0.005", "threshold = 0.04")
    for slow, fast in LIMITS.items():
        text = text.replace(slow, fast)
    for stream, lines in (streams or {}).items():
        header = f"[finger.{stream}]\n"
        text = text.replace(header, f"{header}{lines}\n")
    return config.parse(f"{text}\n[rates]\nstatus_hz = 50.0\n", "bed.toml")


class Bed:
    """One run.

    Args:
        seed: Of the noise, and of every fault that draws from `rng`.
        charge: The pads leak their charge, as PVDF does.
        streams: Lines added to the config's tables of streams.

    Attributes:
        now_ns: CLOCK_MONOTONIC of the host.
        watch: What must hold of every message, and what was told so far.
    """

    def __init__(self, seed: int, *, charge: bool = False, streams: dict[str, str] | None = None) -> None:
        self.seed, self.rng = seed, Random(seed)
        self.rig = VirtualRig(Scene(script=QUIET), seed)
        if not charge:
            for finger in (self.rig._left, self.rig._right):
                finger.pad._electronics = replace(finger.pad._electronics, tau_s=STIFF.tau_s)
        self.settings = settings(charge=charge, streams=streams)
        self.wall_ns = WALL_NS
        self.engine = self.engine_at(WALL_NS)
        self.now_ns, self._world_ns, self._event_ns = BEGIN_NS, 0, BEGIN_NS
        self.events: list[tuple[int, Event]] = []
        self._told = b""  # a digest of all that was told
        self.watch = Watch(self.settings)
        streams = self.settings.streams()
        self.lines = {line: Line(line.replace("-", "."), _listener(streams[line.replace("-", ".")])) for line in LINES}
        self._steps, self._asked, self._suspended_ns = 0, 0, 0

    def engine_at(self, wall_ns: int) -> Engine:
        """An engine that has seen nothing, begun with the wall clock so far ahead of CLOCK_MONOTONIC."""
        return Engine(self.settings, boot=BOOT, wall_minus_monotonic_ns=wall_ns)

    def line(self, link: str) -> Line:
        """The line of a link, such as ``left.pad``."""
        return self.lines[link.replace(".", "-")]

    @property
    def said_ns(self) -> int:
        """How long the devices have run: the world's own clock, which no suspension stops."""
        return self._world_ns

    # -- faults

    def strike(self, fault: Fault | None, *streams: str) -> None:
        """A fault befalls lines from now on, all lines if none is named; None: they are sound again."""
        for stream in streams or self.lines:
            self.line(stream).fault = fault

    def recover(self, within_s: float = 1.0) -> None:
        """All lines are sound again: both fingers are stable in time."""
        self.strike(None)
        for finger in FINGERS:
            assert self.recovery_s("stable", finger) <= within_s, f"seed {self.seed}: {finger}"

    def struck(
        self,
        stream: str,
        fault: Fault,
        seconds: float,
        *,
        level: str = "unknown",
        reasons: list[str] | None = None,
        healths: tuple[int, ...] = (0, 1, 2, 3),
        message: str = "",
        lies: bool = False,
    ) -> None:
        """A fault befalls a line of the left finger for a while; then that has a level, and later both are stable.

        Args:
            stream: The line.
            fault: The fault.
            seconds: How long it lasts.
            level: Level of the left finger at its end.
            reasons: Its reasons; None: any.
            healths: Possible health of the stream.
            message: Part of the message about it.
            lies: What came through is untrue and was believed until it was found out.
        """
        self.strike(fault, stream)
        self.run(seconds)
        health = self.health(stream)
        assert (self.level(), self.level("right")) == (level, "stable")
        assert reasons in (None, self.reasons())
        assert health["health"] in healths
        assert message in health["message"]
        self.recover()
        if lies:
            self.watch.faults.clear()

    # -- the world goes on

    def run(self, seconds: float) -> None:
        """Lets time pass."""
        until_ns = self.now_ns + round(seconds * SECOND)
        while self.now_ns < until_ns:
            self.step()

    def step(self) -> None:
        """One step of the world; the engine hears what has arrived."""
        self._steps += 1
        self._world_goes_on()
        self._deliver()
        if self._steps % TICK_EVERY == 0:
            self.feed(Tick(self._suspended_ns), self.now_ns)
            self.watch.tick(self.now_ns)

    def _world_goes_on(self) -> None:
        self._world_ns += STEP_NS
        self.now_ns += STEP_NS
        said = self.rig.advance(self._world_ns)
        for name, line in self.lines.items():
            data, line.answers = line.answers + said[name], b""
            line.say(data, self.now_ns)

    def suspend(self, seconds: float) -> None:
        """The host sleeps: its monotonic clock stands still, and what the devices say meanwhile is lost."""
        self._suspended_ns += round(seconds * SECOND)
        self.watch.suspended(self.now_ns)
        for line in self.lines.values():
            line.queue.clear()

    def _deliver(self) -> None:
        arrived = [
            (due, said, line, data, true)
            for line in self.lines.values()
            for due, said, data, true in line.take(self.now_ns)
        ]
        arrived.sort(key=lambda piece: piece[0])
        for due, said, line, data, true in arrived:
            self._event_ns = max(self._event_ns, due)
            if line.listener.receive(data, due) and true:
                self.watch.fresh(line.link, said)
            if line.up:
                self.feed(Bytes(line.link, data), self._event_ns)

    # -- what enters the engine

    def feed(self, event: Event, t_ns: int) -> dict[str, Any] | None:
        """Hands the engine an event, and does what it says; returns the reply where it makes one."""
        self._event_ns = max(self._event_ns, t_ns)
        self.events.append((self._event_ns, event))
        reply = None
        for output in self.engine.handle(event, self._event_ns):
            self._told = hashlib.sha256(self._told + _bytes_of(output)).digest()
            if isinstance(output, Write):
                line = self.line(output.link)
                if not line.deaf:
                    line.answers += self.rig.receive(output.link.replace(".", "-"), output.data, self._world_ns)
            elif isinstance(output, Reply):
                reply = output.body
            elif isinstance(output, Publish):
                self.watch.hear(output, self._event_ns)
        return reply

    def ask(self, op: str, **fields: Any) -> dict[str, Any]:
        """Makes a request; returns its reply."""
        self._asked += 1
        envelope = {"v": 1, "id": self._asked, "op": op, "boot": BOOT, "deadline_ns": self.now_ns + 100 * MS}
        reply = self.feed(Request(b"bed", envelope | fields), self.now_ns)
        if reply is None:
            raise RuntimeError(f"no reply to {op}")
        return reply

    def plug(self, link: str, identity: str | None = None) -> None:
        """A port was opened: its device boots anew."""
        line = self.line(link)
        line.up, line.answers = True, b""
        line.queue.clear()
        self.rig.opened(link.replace(".", "-"), self._world_ns)
        self.feed(LinkUp(link, identity or f"serial of {link}"), self.now_ns)

    def unplug(self, link: str, reason: str = "unplugged") -> None:
        """A port went away."""
        line = self.line(link)
        line.up = False
        line.queue.clear()
        self.watch.lost(link)
        self.feed(LinkDown(link, reason), self.now_ns)

    # -- the story

    def hold(self) -> Bed:
        """Begins: as `free`, and the box is gripped, lifted and held."""
        self.free()
        self.close()
        return self

    def free(self) -> Bed:
        """Begins: streams run, the gripper is active, and both fingers are tared; nothing is held."""
        for line in LINES:
            self.plug(line.replace("-", "."))
        self.run(ANSWER_S)
        self._do("lease.acquire", ttl_ms=200)
        self._do("gripper.activate", drop=True)
        self.run(READY_S - ANSWER_S)
        for finger in FINGERS:
            self._do("tare", finger=finger, seconds=TARE_S)
        self.run(2 * TARE_S)
        return self

    def close(self) -> None:
        """Grips the box; the script lifts it a moment later."""
        self._do("lease.acquire", ttl_ms=200)
        self._do("gripper.close", force_n=GRIP_N, speed_mps=0.15)
        self.run(HELD_S)

    def _do(self, op: str, **fields: Any) -> None:
        reply = self.ask(op, **fields)
        if not reply["ok"]:
            raise RuntimeError(f"seed {self.seed}: {op}: {reply['error']}")

    # -- what came of it

    def level(self, finger: str = "left") -> str:
        """The level last told."""
        return self.watch.levels[finger]

    def reasons(self, finger: str = "left") -> list[str]:
        """Its reasons."""
        return self.watch.reasons[finger]

    def health(self, stream: str) -> dict[str, Any]:
        """What ``status`` last said of a stream."""
        return self.watch.status["streams"][stream]

    def recovery_s(self, level: str, finger: str = "left", patience_s: float = 1.0) -> float:
        """How long it takes until a level is told; inf when it is not within ``patience_s``."""
        begun_ns = self.now_ns
        while self.now_ns - begun_ns <= patience_s * SECOND:
            if self.level(finger) == level:
                return (self.now_ns - begun_ns) / SECOND
            self.step()
        return float("inf")

    def replays(self) -> bool:
        """Whether the same events tell the same, to the byte."""
        engine, told = self.engine_at(self.wall_ns), b""
        for t_ns, event in self.events:
            for output in engine.handle(event, t_ns):
                told = hashlib.sha256(told + _bytes_of(output)).digest()
        return told == self._told


@functools.cache
def _held(seed: int) -> Bed:
    bed = Bed(seed).hold()
    bed.watch.changes.clear()
    return bed


def held_bed(seed: int) -> Bed:
    """A bed that holds the box, of its own: what all of one seed have in common is run once."""
    return copy.deepcopy(_held(seed))


def _listener(stream: config.Stream) -> Decoder:
    device = DEVICES[stream.device]
    return device.decoder(**({} if device.needs_tables else config.device_options(stream)))


def _bytes_of(output: Output) -> bytes:
    if isinstance(output, Publish):
        return output.topic.encode() + messages.encode(output.body)
    if isinstance(output, Write):
        return output.link.encode() + output.data
    return output.client + messages.encode(output.body)
