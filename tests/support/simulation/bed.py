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

from engine_rig import BOOT, WALL_NS, EngineRun
from nanoseconds import MS
from simulation.line import Fault, Line
from simulation.watch import Watch

from slipd import config
from slipd.devices import DEVICES, Decoder
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkDown, LinkUp, Output, Publish, Write
from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import Script
from slipd.tools.sim.virtual_gripper import LINES, VirtualRig
from slipd_client import messages

SECOND = 1_000 * MS
STEP_NS = 1_250_000
"""The force sensors' period."""

TICK_EVERY = 4
"""Steps between two ticks of the engine: 5 ms, as in the service."""

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
    text = shipped_config("demo.toml").read_text(encoding="utf-8")
    if not charge:
        text = text.replace("charge_tau_s = 2.0", "").replace("threshold = 0.005", "threshold = 0.04")
    for slow, fast in LIMITS.items():
        text = text.replace(slow, fast)
    for stream, lines in (streams or {}).items():
        header = f"[finger.{stream}]\n"
        text = text.replace(header, f"{header}{lines}\n")
    return config.parse(f"{text}\n[rates]\nstatus_hz = 50.0\n", "bed.toml")


class Bed(EngineRun):
    """One run.

    Args:
        seed: Of the noise, and of every fault that draws from `rng`.
        charge: The pads leak their charge, as PVDF does.
        streams: Lines added to the config's tables of streams.

    Attributes:
        watch: What must hold of every message, and what was told so far.
        suspended_ns: How long the host has slept.
    """

    def __init__(self, seed: int, *, charge: bool = False, streams: dict[str, str] | None = None) -> None:
        self.rng = Random(seed)
        self.rig = VirtualRig(Scene(script=QUIET), seed)
        if not charge:
            for pad in (self.rig.devices[f"{finger}-pad"] for finger in FINGERS):
                pad._electronics = replace(pad._electronics, tau_s=STIFF.tau_s)
        self.settings = settings(charge=charge, streams=streams)
        super().__init__(self.settings, zeros=False)
        self._world_ns, self._event_ns = 0, self.t_ns
        self.events: list[tuple[int, Event]] = []
        self._told = b""  # a digest of all that was told
        self.watch = Watch(self.settings)
        known = self.settings.streams()
        self.lines = {line: Line(line.replace("-", "."), _listener(known[line.replace("-", ".")])) for line in LINES}
        self._steps = self.suspended_ns = 0

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
        """Both fingers are stable in time."""
        for finger in FINGERS:
            assert self.recovery_s("stable", finger) <= within_s, finger

    # -- the world goes on

    def run(self, seconds: float) -> None:
        """Lets time pass."""
        until_ns = self.t_ns + round(seconds * SECOND)
        while self.t_ns < until_ns:
            self.step()

    def step(self) -> None:
        """One step of the world; the engine hears what has arrived."""
        self._steps += 1
        self._world_goes_on()
        self._deliver()
        if self._steps % TICK_EVERY == 0:
            self.tick(self.suspended_ns)
            self.watch.tick(self.t_ns)

    def _world_goes_on(self) -> None:
        self._world_ns += STEP_NS
        self.t_ns += STEP_NS
        said = self.rig.advance(self._world_ns)
        for name, line in self.lines.items():
            data, line.answers = line.answers + said[name], b""
            line.say(data, self.t_ns)

    def suspend(self, seconds: float) -> None:
        """The host sleeps: its monotonic clock stands still, and what the devices say meanwhile is lost."""
        self.suspended_ns += round(seconds * SECOND)
        self.watch.suspended(self.t_ns)
        for line in self.lines.values():
            line.queue.clear()

    def _deliver(self) -> None:
        arrived = [
            (due, said, line, data, true)
            for line in self.lines.values()
            for due, said, data, true in line.take(self.t_ns)
        ]
        arrived.sort(key=lambda piece: piece[0])
        for due, said, line, data, true in arrived:
            self._event_ns = max(self._event_ns, due)
            if line.listener.receive(data, due) and true:
                self.watch.fresh(line.link, said)
            if line.up:
                self.feed(Bytes(line.link, data), self._event_ns)

    # -- what enters the engine

    def feed(self, event: Event, t_ns: int | None = None) -> list[Output]:
        """Handle an event now, or when it arrived; times never go back."""
        self._event_ns = max(self._event_ns, self.t_ns if t_ns is None else t_ns)
        self.events.append((self._event_ns, event))
        outputs = self.engine.handle(event, self._event_ns)
        for output in outputs:
            self.hear(output, event)
        return outputs

    def hear(self, output: Output, event: Event) -> None:
        """Do what the engine says, and look at what it tells."""
        self._told = _digest(self._told, output)
        if isinstance(output, Write) and not self.line(output.link).deaf:
            said = b"".join(self.rig.devices[output.link.replace(".", "-")].receive(output.data, self._world_ns))
            self.line(output.link).answers += said
        elif isinstance(output, Publish):
            self.watch.hear(output, self._event_ns)

    def up(self, *links: str) -> None:
        """Ports were opened, all if none is named: their devices boot anew."""
        for link in links or [line.link for line in self.lines.values()]:
            line = self.line(link)
            line.up, line.answers = True, b""
            line.queue.clear()
            self.rig.devices[link.replace(".", "-")].opened(self._world_ns)
            self.feed(LinkUp(link, f"serial of {link}"))

    def down(self, link: str, reason: str = "unplugged") -> None:
        """A port went away."""
        line = self.line(link)
        line.up = False
        line.queue.clear()
        self.watch.lost(link)
        self.feed(LinkDown(link, reason))

    # -- the story

    def hold(self) -> Bed:
        """Begins: as `free`, and the box is gripped, lifted and held."""
        self.free()
        self.close()
        return self

    def free(self) -> Bed:
        """Begins: streams run, the gripper is active, and both fingers are tared; nothing is held."""
        self.up()
        self.run(ANSWER_S)
        self.lease()
        assert self.code("gripper.activate", drop=True) is None
        self.run(READY_S - ANSWER_S)
        for finger in FINGERS:
            assert self.code("tare", finger=finger, seconds=TARE_S) is None
        self.run(2 * TARE_S)
        return self

    def close(self, force_n: float = GRIP_N) -> None:
        """Grips the box; the script lifts it a moment later."""
        self.lease()
        assert self.code("gripper.close", force_n=force_n, speed_mps=0.15) is None
        self.run(HELD_S)

    # -- what came of it

    def level(self, finger: str = "left") -> tuple[str, list[str]]:
        """The level last told, and its reasons."""
        return self.watch.levels[finger], self.watch.reasons[finger]

    def health(self, stream: str) -> dict[str, Any]:
        """What ``status`` last said of a stream."""
        return self.watch.status["streams"][stream]

    def recovery_s(self, level: str, finger: str = "left", patience_s: float = 1.0) -> float:
        """How long it takes until a level is told; inf when it is not within ``patience_s``."""
        begun_ns = self.t_ns
        while self.t_ns - begun_ns <= patience_s * SECOND:
            if self.watch.levels[finger] == level:
                return (self.t_ns - begun_ns) / SECOND
            self.step()
        return float("inf")

    def replays(self) -> bool:
        """Whether the same events tell the same, to the byte."""
        engine, told = Engine(self.settings, boot=BOOT, wall_minus_monotonic_ns=WALL_NS), b""
        for t_ns, event in self.events:
            told = functools.reduce(_digest, engine.handle(event, t_ns), told)
        return told == self._told


@functools.cache
def _held(seed: int) -> Bed:
    bed = Bed(seed).hold()
    bed.watch.changes.clear()
    return bed


def held_bed(seed: int = 1) -> Bed:
    """A bed that holds the box, of its own: what all of one seed have in common is run once."""
    return copy.deepcopy(_held(seed))


def _listener(stream: config.Stream) -> Decoder:
    device = DEVICES[stream.device]
    return device.decoder(**({} if device.needs_tables else config.device_options(stream)))


def _digest(before: bytes, output: Output) -> bytes:
    """A digest of all that was told before, and of this."""
    return hashlib.sha256(before + _bytes_of(output)).digest()


def _bytes_of(output: Output) -> bytes:
    if isinstance(output, Publish):
        return output.topic.encode() + messages.encode(output.body)
    if isinstance(output, Write):
        return output.link.encode() + output.data
    return output.client + messages.encode(output.body)
