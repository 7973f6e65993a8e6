"""Random and hostile requests at a daemon without sockets: nothing beyond the limits ever reaches the gripper.

A round is one seed: clients, devices, faults and clocks. The messages take the way of real ones, from their frames
through the request server's own judgement to the engine and the bytes for the gripper.
"""

from __future__ import annotations

import gc
import os
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, cast

import msgpack
import numpy as np
from fuzz.asking import FINGERS, MOST_CAPTURED, Ask, Asker, Captured, Seen
from fuzz.book import BUDGET_N, CEILING_N, LEAST_N, LOWER_N_PER_S, MOST_N, RAISE_N_PER_S, REFLEX_N_PER_S, STEP_N, Book
from fuzz.hand import FAULTS, FORCE_TABLE, OPEN_M, Hand, Said
from fuzz.request_report import AGAIN, LOOKED_AT_NS, UNJUDGED, Found
from grasp_table import grasp_table

from slipd import config
from slipd.bus.request_server import RequestServer
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
    Request,
    Tick,
    Write,
)
from slipd.zmtp.peer import Peer
from slipd_client.messages import ERROR_CODES, MESSAGE_LIMITS, MessageError, decode, encode

MS = 1_000_000
STRICT, ROUND = 1_000_000, 10_000
"""Messages of a strict run, and of one round."""

RESTART_EVERY = 2_500
"""Messages per run of the daemon; what was captured in one run is also sent to the next ones."""

BEGIN_NS = 1_000_000 * MS
TICK_NS = 5 * MS
READING_NS = 10 * MS
REPLY_NS = 6 * MS
OVERLOAD = 2
"""Status bits of the force sensor for a reading beyond its range."""

NEVER_DONE = ("hello", "status")
"""Requests that change nothing, so that a repetition is harmless."""

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


class _Connection:
    """The part of a peer that the request server reads."""

    kind = b"DEALER"
    key = b""
    slot = 0
    account = SimpleNamespace(name=b"process")


class _Server(RequestServer):
    """The real request server without its socket and without its rate limit."""

    def __init__(self, on_request: Callable[[bytes, dict[str, Any]], None]) -> None:
        super().__init__("", on_request, per_second=1e12)
        self._peer = cast("Peer", _Connection())
        self.sent: list[tuple[bytes, bytes]] = []

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        """Packs a reply as it would be sent."""
        self.sent.append((client.partition(b"\0")[2], encode(body)))

    def take(self, client: bytes, frames: tuple[bytes, ...]) -> None:
        """A message came."""
        self._names = {self._peer: b"process\0" + client}
        self._on_message(self._peer, list(frames))


class _Run:
    """One round while it is played."""

    def __init__(self, seed: int) -> None:
        self.rng = Random(seed)
        self.found = Found()
        self.book, self.seen, self.hand = Book(), Seen(), Hand(self.rng)
        self._asker = Asker(self.rng, self.seen)
        self._seed = seed
        self._settings = config.parse(CONFIG + (REFLEX if seed % 2 else ""), "fuzz.toml")
        self._server = _Server(self.ask)
        self.now_ns = BEGIN_NS
        self._runs = 0
        self._suspended_ns = 0
        self._answers: list[tuple[int, bytes, Said | None]] = []
        self._writes: list[bytes] = []
        self._state = dict.fromkeys(FINGERS, "good")
        self._pull = dict.fromkeys(FINGERS, 0.0)
        self._up: set[str] = set()
        self.took_ns: list[int] = []
        self.kinds: list[str] = []
        self._restart()

    # -- messages

    def play(self, count: int, until: str = "") -> None:
        """Sends so many messages; fewer where a fault is found whose words contain ``until``."""
        for number in range(count):
            self._pass_time()
            if number % RESTART_EVERY == RESTART_EVERY - 1:
                self._restart()
            elif self.rng.random() < 0.006:
                self._strike()
            self._look()
            self._send(self._asker.next(), number)
            if until and any(until in fault for fault in self.book.violations + self.found.bad):
                break

    def _send(self, ask: Ask, number: int) -> None:
        self.found.messages[ask.kind] += 1
        self._server.sent.clear()
        try:
            begun_ns = time.process_time_ns()
            self._server.take(ask.client, ask.frames)
            took_ns = time.process_time_ns() - begun_ns
        except Exception as error:
            self.found.faults.append(f"message {number} ({ask.kind}): {type(error).__name__}: {error}")
            took_ns = 0
        self.took_ns.append(took_ns)
        self.kinds.append(ask.kind)
        self._estimator(ask, number)
        self._deliver()

    def ask(self, client: bytes, body: dict[str, Any]) -> None:
        """The engine's part, as in the service; what it writes is looked at behind the message."""
        self._engage(Request(client, body))

    def _estimator(self, ask: Ask, number: int) -> None:
        """What the daemon answered."""
        if [client for client, _ in self._server.sent] != [ask.client]:
            self.found.faults.append(f"message {number} ({ask.kind}): {len(self._server.sent)} replies")
            return
        try:
            reply = decode(self._server.sent[0][1], MESSAGE_LIMITS)
        except MessageError as error:
            self.found.faults.append(f"message {number} ({ask.kind}): a reply that no client reads: {error}")
            return
        refusal = None if reply["ok"] is True else reply["error"]
        if refusal is not None and (refusal["code"] not in ERROR_CODES or not refusal["message"]):
            self.found.faults.append(f"message {number} ({ask.kind}): refused with {refusal}")
        if refusal is not None and refusal["code"] == "fault_latched":
            self.seen.faulty = True
        if ask.again is not None and not self._is_late(ask, ask.again, reply, number):
            return
        body = _body(ask.frames)
        if body is None:
            if reply["ok"] is not False:
                self.found.faults.append(f"message {number} ({ask.kind}): granted, and it is no request")
            return
        if reply["ok"]:
            self.book.grant(ask.client, body, self.seen.boot, reply["result"], self.now_ns)
            self.seen.faulty = self.seen.faulty and body.get("op") != "fault.ack"
        if body.get("op") not in NEVER_DONE:
            self.seen.captured.append(Captured(ask.client, ask.frames[0], reply))
            del self.seen.captured[:-MOST_CAPTURED]

    def _is_late(self, ask: Ask, old: Captured, reply: dict[str, Any], number: int) -> bool:
        """Whether a captured request is done for the first time.

        It may be answered as before to whoever sent it first, and must not be done again.
        """
        self.found.replays += 1
        if not reply["ok"]:
            return False
        if ask.client == old.client and reply == old.reply:
            self.found.cached += 1
            return False
        first = old.reply.get("error", {}).get("code", "granted")
        if first in UNJUDGED:
            self.found.late += 1
            old.client, old.reply = ask.client, reply
            return True
        what = f"{_body(ask.frames)} of {old.client!r}, {first}, was granted to {ask.client!r}"
        self.found.accepted_replays.append(f"message {number}: {what}")
        return False

    def _look(self) -> None:
        """What clients can know."""
        seen, book = self.seen, self.book
        seen.now_ns, seen.holder = self.now_ns, book.holder_at(self.now_ns)
        seen.active, seen.holds = book.is_active, book.held
        seen.force_n = book.grip_n

    # -- the world

    def _pass_time(self) -> None:
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
        """The loop was held up, or the host slept: nothing happens until then."""
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
        """One reading of a finger, where it says anything."""
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

    def _strike(self) -> None:
        """Something fails, or is well again."""
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

    def _restart(self) -> None:
        """Another run of the daemon; the gripper and what it holds stay."""
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
        """One event, and what comes of it."""
        self._engage(event)
        self._deliver()

    def _engage(self, event: Event) -> None:
        for output in self.engine.handle(event, self.now_ns):
            if isinstance(output, Reply):
                self._server.reply(output.client, output.body)
            elif isinstance(output, Write) and output.link == "gripper":
                self._writes.append(output.data)
            elif isinstance(output, Record) and output.name:  # the disk, which has room or not, is as quick as a call
                state = self.rng.choice(("running", "limited", "failed"))
                self._engage(RecordingChanged(output.name, output.name, state, "" if state == "running" else "full"))
            elif isinstance(output, Publish) and output.body.get("reflex"):
                self.book.react(output.body["reflex"], output.body["force_command_n"], self.now_ns)

    def _deliver(self) -> None:
        """What was written reaches the gripper, which answers a little later."""
        for data in self._writes:
            if "gripper" in self._up:
                answer = self.hand.receive(data, self.now_ns)
                self._answers.append((self.now_ns + REPLY_NS, answer, self.hand.said))
                for told in self.hand.told:
                    self.book.write(told, self.now_ns)
                self.hand.told.clear()
        self._writes.clear()


def _body(frames: tuple[bytes, ...]) -> dict[str, Any] | None:
    """The map of a request, read as leniently as msgpack can; None where there is none."""
    try:
        body = msgpack.unpackb(frames[0], strict_map_key=False) if len(frames) == 1 else None
    except Exception:
        return None
    return body if isinstance(body, dict) else None


def fuzz(seed: int, count: int = ROUND, until: str = "") -> Found:
    """One round; its slow messages are timed again, by playing the same round once more.

    Args:
        seed: Of the round.
        count: Number of messages.
        until: Part of the words of a fault that ends the round.
    """
    run = _Run(seed)
    gc.collect()
    gc.freeze()  # as in the service
    run.play(count, until)
    took_ns = np.array(run.took_ns)
    kinds = run.kinds
    for _ in range(AGAIN):
        if took_ns.max() <= LOOKED_AT_NS:
            break
        other = _Run(seed)
        other.play(int(np.flatnonzero(took_ns > LOOKED_AT_NS)[-1]) + 1)
        again_ns = np.array(other.took_ns)
        took_ns[: len(again_ns)] = np.minimum(took_ns[: len(again_ns)], again_ns)
    gc.unfreeze()
    found = run.found
    found.took_ns = took_ns
    found.slowest = [(int(took_ns[n]), kinds[n], seed, int(n)) for n in np.argsort(took_ns)[-3:]]
    found.violations = [f"seed {seed}: {what}" for what in run.book.violations]
    found.accepted_replays = [f"seed {seed}: {what}" for what in found.accepted_replays]
    found.faults = [f"seed {seed}: {what}" for what in found.faults]
    if run.hand.bad_frames:
        found.faults.append(f"seed {seed}: the gripper got {run.hand.bad_frames} frames that are none")
    found.granted = Counter(run.book.granted)
    found.commands, found.acts = run.book.commands, run.book.acts
    del run
    gc.collect()
    found.memory_kb = {os.getpid(): (_memory_kb(),) * 2}
    return found


def _memory_kb() -> int:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    raise RuntimeError("the kernel does not tell the memory of a process")
