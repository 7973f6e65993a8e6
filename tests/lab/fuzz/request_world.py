"""The world around a daemon that is fuzzed with requests: devices, gripper, faults and clocks, all by one seed."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

from fuzz.asking import FINGERS, Seen
from fuzz.book import BUDGET_N, CEILING_N, LEAST_N, LOWER_N_PER_S, MOST_N, RAISE_N_PER_S, REFLEX_N_PER_S, STEP_N, Book
from fuzz.hand import FAULTS, FORCE_TABLE, OPEN_M, Hand, Said
from grasp_table import grasp_table

from slipd import config
from slipd.devices import bota
from slipd.engine.engine import Engine
from slipd.events import (
    Bytes,
    Event,
    LinkDown,
    LinkUp,
    Publish,
    Record,
    RecordingChanged,
    Reply,
    Tick,
    Write,
)

MS = 1_000_000
BEGIN_NS = 1_000_000 * MS
TICK_NS = 5 * MS
READING_NS = 10 * MS
REPLY_NS = 6 * MS
OVERLOAD = 2
"""Status bits of the force sensor for a reading beyond its range."""
CONFIG = f"""
[rates]
slip_hz = 1.0
wrench_hz = 1.0
status_hz = 1.0
[finger.left]
mu = 0.5
[finger.left.wrench]
device = "bota"
port = "left"
rate_hz = 100.0
[finger.right]
mu = 0.5
[finger.right.wrench]
device = "bota"
port = "right"
rate_hz = 100.0
[gripper]
device = "robotiq_2f"
port = "gripper"
rate_hz = 50.0
force_table = {[list(row) for row in FORCE_TABLE]}
width_table = [[0.0, {OPEN_M}], [1.0, 0.0]]
speed_table = [[0, 0.02], [255, 0.15]]
min_force_n = {LEAST_N}
max_force_n = {MOST_N}
step_n = {STEP_N}
raise_n_per_s = {RAISE_N_PER_S}
lower_n_per_s = {LOWER_N_PER_S}
budget_n = {BUDGET_N}
"""

REFLEX = f"""
{grasp_table(OPEN_M)}
[reflex]
enabled = true
ceiling_n = {CEILING_N}
raise_n_per_s = {REFLEX_N_PER_S}
calm_s = 0.1
lower_n_per_s = 1.0
"""
"""Config of every second round: the object slips at times, and the reflex acts."""

MOST_PULL, STATIC, DYNAMIC = 0.7, 0.5, 0.36
"""Largest pull as a share of the grip force, and what static and dynamic friction carry of it."""
PULL_PER_READING = 0.006
"""Growth of the pull from reading to reading, as a share of the grip force."""


class RequestWorld:
    """The daemon's engine with its devices.

    Args:
        seed: Of everything that is drawn.
        reply: Called with the client and the body of each reply.
    """

    def __init__(self, seed: int, reply: Callable[[bytes, dict[str, Any]], None]) -> None:
        self.rng = Random(seed)
        self.book, self.seen, self.hand = Book(), Seen(), Hand(self.rng)
        self._seed = seed
        self._settings = config.parse(CONFIG + (REFLEX if seed % 2 else ""), "fuzz.toml")
        self._reply = reply
        self.now_ns = BEGIN_NS
        self._runs = 0
        self._suspended_ns = 0
        self._answers: list[tuple[int, bytes, Said | None]] = []
        self._writes: list[bytes] = []
        self._state = dict.fromkeys(FINGERS, "good")
        self._pull = dict.fromkeys(FINGERS, 0.0)
        self._up: set[str] = set()

    def pass_time(self) -> None:
        """Let some time pass, with the readings, answers and ticks that fall into it."""
        rng = self.rng
        choice = rng.random()
        if choice < 0.25:
            return
        step_ns = round(rng.expovariate(1.0 / (2.0 * MS))) if choice < 0.99 else rng.randint(20, 400) * MS
        until_ns = self.now_ns + step_ns
        if choice > 0.998:
            self._jump(until_ns)
        while True:
            due_ns = min(self._next_tick_ns, self._next_reading_ns, *(due for due, _, _ in self._answers[:1]))
            if due_ns > until_ns:
                break
            self.now_ns = max(self.now_ns, due_ns)
            self._do_due()
        self.now_ns = until_ns

    def _jump(self, until_ns: int) -> None:
        """Stall the loop, or suspend the host: nothing happens until then."""
        if self.rng.random() < 0.5:
            self._suspended_ns += self.rng.randint(51, 5_000) * MS
            self.book.sleep()
        self.now_ns = until_ns

    def _do_due(self) -> None:
        if self._answers and self._answers[0][0] <= self.now_ns:
            _, answer, said = self._answers.pop(0)
            if said is not None:
                self.book.hear(said, self.now_ns)
            if answer:
                self._handle(Bytes("gripper", answer))
        if self._next_reading_ns <= self.now_ns:
            self._next_reading_ns = self.now_ns + READING_NS
            for finger in FINGERS:
                self._read(finger)
        if self._next_tick_ns <= self.now_ns:
            self._next_tick_ns = self.now_ns + TICK_NS
            self.book.tick()
            self._handle(Tick(self._suspended_ns))

    def _read(self, finger: str) -> None:
        """Send one reading of a finger, unless it is silent."""
        state, rng = self._state[finger], self.rng
        if state == "silent" or f"{finger}.wrench" not in self._up:
            return
        self.hand.advance(self.now_ns)
        normal_n = self.hand.grip_n + rng.gauss(0.0, 0.02)
        carried_n = self._carry(finger) * normal_n
        force = (rng.gauss(0.0, 0.02), carried_n + rng.gauss(0.0, 0.02), -normal_n)
        status = OVERLOAD if state == "overload" else 0
        frame = bota.encode_frame(force, (0.0, 0.0, rng.gauss(0.0, 1e-4)), self.now_ns // 1000, status=status)
        self.book.feel(finger, self.now_ns, normal_n, good=not status)
        self._handle(Bytes(f"{finger}.wrench", frame))

    def _carry(self, finger: str) -> float:
        """Return the pull that friction carries, as a share of the grip force: it grows, slips, and is let go."""
        pull = self._pull[finger] + PULL_PER_READING
        self._pull[finger] = pull if pull < MOST_PULL else -self.rng.uniform(0.0, 1.0) * MOST_PULL
        return max(pull, 0.0) if pull < STATIC else DYNAMIC

    def strike(self) -> None:
        """Let something fail, or recover."""
        rng, hand = self.rng, self.hand
        choice = rng.randrange(14)
        if choice < 4:
            self._state[rng.choice(FINGERS)] = ("good", "good", "silent", "overload")[choice]
        elif choice < 6:
            link = rng.choice([f"{finger}.wrench" for finger in FINGERS] + ["gripper"])
            self._unplug(link) if link in self._up else self._plug(link)
        elif choice < 7:
            hand.fault = rng.choice(FAULTS)
        elif choice < 8:
            hand.power_cycle()
        elif choice < 9:
            setattr(hand, rng.choice(("silent", "deaf", "lying", "garbled")), True)
        elif choice < 10:
            hand.object_there = not hand.object_there
        else:
            hand.silent = hand.deaf = hand.lying = hand.garbled = False
            self._state = dict.fromkeys(FINGERS, "good")
            for link in self.engine.links:
                if link not in self._up:
                    self._plug(link)

    def _plug(self, link: str) -> None:
        self._up.add(link)
        self._handle(LinkUp(link, f"serial of {link}"))

    def _unplug(self, link: str) -> None:
        self._up.discard(link)
        if link == "gripper":
            self._answers.clear()
            self.book.lose_gripper()
        else:
            self.book.lose_finger(link.partition(".")[0])
        self._handle(LinkDown(link, "unplugged"))

    def restart(self) -> None:
        """Start another run of the daemon; the gripper keeps what it holds."""
        self._runs += 1
        self.seen.boot = f"{self._seed:08x}-{self._runs}"
        self.engine = Engine(self._settings, boot=self.seen.boot, wall_minus_monotonic_ns=0)
        self.book.restart()
        self._answers.clear()
        self._next_tick_ns = self._next_reading_ns = self.now_ns
        self._up.clear()
        for link in self.engine.links:
            self._plug(link)

    def _handle(self, event: Event) -> None:
        """Handle one event and all that follows from it."""
        self.engage(event)
        self.deliver()

    def engage(self, event: Event) -> None:
        """Let the engine handle an event; what it writes waits for `deliver`."""
        for output in self.engine.handle(event, self.now_ns):
            if isinstance(output, Reply):
                self._reply(output.client, output.body)
            elif isinstance(output, Write) and output.link == "gripper":
                self._writes.append(output.data)
            elif isinstance(output, Record) and output.name:  # the disk, which has room or not, is as quick as a call
                state = self.rng.choice(("running", "limited", "failed"))
                self.engage(RecordingChanged(output.name, output.name, state, "" if state == "running" else "full"))
            elif isinstance(output, Publish) and output.body.get("reflex"):
                self.book.react(output.body["reflex"], output.body["force_command_n"], self.now_ns)

    def deliver(self) -> None:
        """Pass what was written to the gripper, which answers a little later."""
        for data in self._writes:
            if "gripper" in self._up:
                answer = self.hand.receive(data, self.now_ns)
                self._answers.append((self.now_ns + REPLY_NS, answer, self.hand.said))
                for told in self.hand.told:
                    self.book.write(told, self.now_ns)
                self.hand.told.clear()
        self._writes.clear()
