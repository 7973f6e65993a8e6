"""The reflex as a closed loop: from the last byte of the reading that shows the danger to the gripper's command.

All lines are real pseudo-terminals, and this process is at the far end of each: it writes the fingers' readings, it is
the gripper, and it subscribes to the warnings. Beside the command stands the warning of the same reading: with the bus
idle the command should come first, for it is what helps. Trials with the bus idle and with a poll outstanding take
turns.
"""

from __future__ import annotations

import contextlib
import os
import select
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
import zmq
from bench import child, processes, traffic
from bench.tables import Table
from fuzz.hand import FORCE_TABLE, OPEN_M, Hand
from grasp_table import grasp_table

from slipd.devices import bota
from slipd.devices.bota import bota_text
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.true_contact import Pad
from slipd_client.errors import RequestRefused
from slipd_client.grip import GripClient
from slipd_client.messages import MESSAGE_LIMITS, decode

MS = 1_000_000
READING_NS = 5 * MS
CALM, DANGER = 0.42, 0.485
"""Pull over grip where friction carries `traffic.MU`: short of a warning, and beyond it."""

SLEW = 0.002
"""By so much it changes from reading to reading but for the danger itself; a quick fall would be a slip."""

FINGERS = ("left", "right")
RATES = {"slip_hz": 10.0, "wrench_hz": 10.0}
GRIP_N, MOST_N = 4.0, 25.0
RAISE_N_PER_S = 10.0
"""Little an act, so that one grasp serves many trials."""

REPLY_NS = 2 * MS
"""From a request to the gripper's answer; a real one takes 5 to 10 ms."""

IDLE_NS = (7 * MS, 11 * MS)
"""So long behind an answer the bus is free, and the next poll is not due."""

OUTSTANDING_NS = MS
"""So long behind a poll the danger comes, before it is answered."""

SETTLE_NS = 500 * MS
"""From one trial to the next: the pull is calm again, the warning has ended, and so has the period of the reflex."""

PATIENCE_NS = 100 * MS
READY_S = 20.0
LEASE_MS = 200
STEP_NS, MOVE_NS, PULL_NS = 30 * MS, 400 * MS, 1_500 * MS
"""Between two attempts; for a movement to end; for the pull to grow from nothing."""

REGRIP_N = 18.0
"""Above it the grasp begins anew."""

HEAD = ("round", "command p50", "command p99", "warning p50", "warning p99", "p50 ratio", "trials", "no command")


@dataclass
class _Times:
    """Trials of one kind, µs: the command and the warning of each; how many had no command."""

    command_us: list[float] = field(default_factory=list)
    warning_us: list[float] = field(default_factory=list)
    missed: int = 0

    def add(self, trial: _Trial) -> None:
        """One more trial."""
        if trial.command_ns and trial.warning_ns:
            self.command_us.append((trial.command_ns - trial.written_ns) * 1e-3)
            self.warning_us.append((trial.warning_ns - trial.written_ns) * 1e-3)
        else:
            self.missed += 1

    def join(self, other: _Times) -> None:
        """Another round of the same kind."""
        self.command_us += other.command_us
        self.warning_us += other.warning_us
        self.missed += other.missed

    def figures(self) -> tuple[float, float, float, float, float, int, int]:
        """The columns behind the first.

        Raises:
            BenchError: No trial had a command.
        """
        if not self.command_us:
            raise child.BenchError(f"the reflex commanded nothing in {self.missed} trials")
        command, warning = (np.percentile(us, (50, 99)) for us in (self.command_us, self.warning_us))
        ratio = float(command[0] / warning[0])
        return (*map(float, (*command, *warning)), ratio, len(self.command_us), self.missed)


@dataclass
class _Trial:
    """One danger: when its last byte was about to be written, and what came of it; 0: nothing yet."""

    written_ns: int = 0
    command_ns: int = 0
    warning_ns: int = 0


class _World:
    """The far ends of all lines.

    Args:
        fds: Of the lines ``left.wrench``, ``right.wrench`` and ``gripper``.
        warnings: A socket that hears the warnings.
    """

    def __init__(self, fds: dict[str, int], warnings: zmq.Socket[bytes]) -> None:
        self._fd, self._warnings = fds, warnings
        self._rng = Random(1)
        self.hand = Hand(self._rng)
        self._heard = dict.fromkeys(fds, b"")
        self._poll = select.poll()
        for fd in self._fd.values():
            self._poll.register(fd, select.POLLIN)
        self._poll.register(warnings.getsockopt(zmq.FD), select.POLLIN)
        self._reading_ns = time.monotonic_ns()
        self._turn = traffic.rotation()
        self._patch = {"left": traffic.PATCH, "right": traffic.PATCH.mirrored()}
        self._pads = {finger: _pad() for finger in self._patch}
        self._shares = {finger: Pad().shares(patch) for finger, patch in self._patch.items()}
        self._begun_ns = self._reading_ns
        self._answer, self._answer_ns = b"", 0
        self.polled_ns = self.answered_ns = 0
        self.trial: _Trial | None = None
        self.pull = self.goal = 0.0

    def go_on(self, span_ns: int) -> None:
        """Lets everything go on for so long."""
        self.run(time.monotonic_ns() + span_ns)

    def run(self, until_ns: int) -> None:
        """Lets everything go on until then, or until a trial has all it waits for."""
        while (now_ns := time.monotonic_ns()) < until_ns and not self._is_over():
            due_ns = min(until_ns, self._reading_ns, self._answer_ns or until_ns)
            if due_ns > now_ns:
                # poll waits whole milliseconds; the rest is spent looking, as a device's own clock is exact
                self._poll.poll((due_ns - now_ns) // MS)
            self._listen()
            now_ns = time.monotonic_ns()
            if now_ns >= self._reading_ns:
                self._reading_ns = max(self._reading_ns + READING_NS, now_ns)
                self.pull += min(max(self.goal - self.pull, -SLEW), SLEW)
                for finger in FINGERS:
                    self.read(finger, self.pull)
                    self._image(finger)
            if self._answer_ns and now_ns >= self._answer_ns:
                os.write(self._fd["gripper"], self._answer)
                self.answered_ns, self._answer_ns = time.monotonic_ns(), 0

    def _is_over(self) -> bool:
        trial = self.trial
        return trial is not None and bool(trial.command_ns and trial.warning_ns)

    def read(self, finger: str, pull: float) -> int:
        """Writes one reading; returns when."""
        now_ns = time.monotonic_ns()
        self.hand.advance(now_ns)
        normal_n = self.hand.grip_n
        noise = [self._rng.gauss(0.0, 0.005) for _ in range(3)]
        fx, fy, fz = force = np.array((noise[0], pull * normal_n + noise[1], noise[2] - normal_n))
        cx, cy = self._patch[finger].centre_m
        torque = np.array((cy * fz, -cx * fz, cx * fy - cy * fx)) - np.cross(traffic.LEVER_M, force)
        force, torque = self._turn.T @ force, self._turn.T @ torque
        frame = bota.encode_frame(force.tolist(), torque.tolist(), now_ns // 1000)
        now_ns = time.monotonic_ns()
        with contextlib.suppress(BlockingIOError):
            os.write(self._fd[f"{finger}.wrench"], frame)
        return now_ns

    def _image(self, finger: str) -> None:
        now_ns = time.monotonic_ns()
        scan = self._pads[finger].advance(now_ns - self._begun_ns, self.hand.grip_n * self._shares[finger])
        with contextlib.suppress(BlockingIOError):
            os.write(self._fd[f"{finger}.pad"], scan)

    def _listen(self) -> None:
        """Takes what came, the gripper's line first: what is stamped later seems slower."""
        with contextlib.suppress(BlockingIOError):
            self._take_command(os.read(self._fd["gripper"], 4096), time.monotonic_ns())
        with contextlib.suppress(zmq.Again):
            while True:
                frames = self._warnings.recv_multipart(zmq.NOBLOCK)
                self._take_warning(frames[1], time.monotonic_ns())
        for finger in (f"{name}.wrench" for name in FINGERS):
            with contextlib.suppress(BlockingIOError):
                commands, self._heard[finger] = bota_text.parse_commands(
                    self._heard[finger] + os.read(self._fd[finger], 4096)
                )
                for command in commands:
                    os.write(self._fd[finger], bota_text.encode_ack(command.letter))

    def _take_command(self, data: bytes, now_ns: int) -> None:
        self._answer = self.hand.receive(data, now_ns)
        trial, forced = self.trial, any(told.forces for told in self.hand.told)
        if forced and trial is not None and trial.written_ns and not trial.command_ns:
            trial.command_ns = now_ns
        if not self.hand.told:
            self.polled_ns = now_ns
        self.hand.told.clear()
        self._answer_ns = now_ns + REPLY_NS

    def _take_warning(self, body: bytes, now_ns: int) -> None:
        trial = self.trial
        if trial is None or not trial.written_ns or trial.warning_ns:
            return
        if decode(body, MESSAGE_LIMITS)["level"] in ("warning", "slipping"):
            trial.warning_ns = now_ns

    def endanger(self, *, outstanding: bool) -> _Trial:
        """One trial, from calm to calm."""
        self.go_on(SETTLE_NS)
        while not self._is_time(outstanding=outstanding):
            self.go_on(MS // 10)
        trial = self.trial = _Trial()
        self._reading_ns = time.monotonic_ns() + READING_NS
        self.pull = self.goal = DANGER
        trial.written_ns = self.read("left", DANGER)
        self.run(trial.written_ns + PATIENCE_NS)
        self.trial, self.goal = None, CALM
        return trial

    def _is_time(self, *, outstanding: bool) -> bool:
        now_ns = time.monotonic_ns()
        if outstanding:
            return (
                bool(self._answer_ns)
                and self.polled_ns > self.answered_ns
                and now_ns >= self.polled_ns + OUTSTANDING_NS
            )
        return not self._answer_ns and IDLE_NS[0] <= now_ns - self.answered_ns <= IDLE_NS[1]


def _pad() -> PvdfPad:
    pad = Pad()
    return PvdfPad(pad.rows, pad.cols, PvdfElectronics(rate_hz=float(traffic.PAD_HZ)), np.random.default_rng(1))


def run(folder: Path, *, rounds: int, trials: int) -> list[Table]:
    """Measure: ``trials`` of each kind a round."""
    kinds = {False: [_Times() for _ in range(rounds)], True: [_Times() for _ in range(rounds)]}
    with (
        processes.Lines([f"{finger}.{side}" for finger in FINGERS for side in ("wrench", "pad")]) as fingers,
        processes.Lines(["gripper"]) as bus,
        processes.daemon(folder, fingers, RATES, extra=_gripper(bus.path["gripper"])) as served,
        _subscribed(served.endpoint) as warnings,
        GripClient(served.requests) as requester,
    ):
        world = _World(fingers.fd | bus.fd, warnings)
        _grip(world, requester)
        for number in range(rounds):
            for trial in range(2 * trials):
                outstanding = bool(trial % 2)
                if world.hand.grip_n > REGRIP_N:
                    _grip(world, requester)
                kinds[outstanding][number].add(world.endanger(outstanding=outstanding))
            served.process.check()
    return [_table(kinds[False], "bus idle"), _table(kinds[True], "a poll outstanding")]


def _grip(world: _World, requester: GripClient) -> None:
    """Takes hold of the object, with the least that is asked for here."""
    until_s = time.monotonic() + READY_S
    world.pull = world.goal = 0.0
    steps = [("gripper.activate", {"drop": True}), ("gripper.close", {"force_n": GRIP_N})]
    if world.hand.holds:
        steps[0] = ("gripper.open", {"drop": True})
    while steps:
        world.go_on(STEP_NS)
        op, fields = steps[0]
        try:
            requester.request("lease.acquire", ttl_ms=LEASE_MS)
            requester.request(op, **fields)
            steps.pop(0)
            world.go_on(MOVE_NS)
        except RequestRefused as refusal:
            if time.monotonic() > until_s:
                raise child.BenchError(f"the daemon refuses {op}: {refusal}") from refusal
            if refusal.code == "fault_latched":
                requester.request("fault.ack")
    world.goal = CALM
    world.go_on(PULL_NS)
    if not world.hand.holds:
        raise child.BenchError("the emulated gripper does not hold what it was told to grip")


@contextlib.contextmanager
def _subscribed(endpoint: str) -> Iterator[zmq.Socket[bytes]]:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = context.socket(zmq.SUB)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.SUBSCRIBE, b"warning")
    socket.connect(endpoint)
    try:
        yield socket
    finally:
        socket.close()
        context.term()


def _gripper(path: str) -> str:
    """What the config of the fingers lacks."""
    return f"""
[gripper]
device = "robotiq_2f"
port = "{path}"
rate_hz = 50.0
force_table = {[list(row) for row in FORCE_TABLE]}
width_table = [[0.0, {OPEN_M}], [1.0, 0.0]]
speed_table = [[0, 0.02], [255, 0.15]]
max_force_n = {MOST_N}
{grasp_table(OPEN_M)}
[reflex]
enabled = true
raise_n_per_s = {RAISE_N_PER_S}
"""


def _table(rounds: list[_Times], bus: str) -> Table:
    table = Table(f"Reflex, {bus}: from the last byte of the danger to the gripper's command, µs", HEAD)
    for number, times in enumerate(rounds):
        table.rows.append((str(number + 1), *times.figures()))
    together = _Times()
    for times in rounds:
        together.join(times)
    table.rows.append(("all", *together.figures()))
    ratios = [float(row[5]) for row in table.rows[:-1]]
    table.notes.append(
        "Warning: the same reading's message at a subscriber in the process that also is the gripper; both are stamped "
        "there. Command: the first byte that sets a force, at the gripper's end of its line."
    )
    if bus == "bus idle":
        reached = "yes" if float(table.rows[-1][5]) <= 1.0 else "no"
        table.notes.append(
            f"p50 ratio, command over warning, least to most {min(ratios):.2f} to {max(ratios):.2f}; wanted: at most "
            f"1; reached: {reached}."
        )
    else:
        table.notes.append(
            f"The danger comes {OUTSTANDING_NS / MS:g} ms after a poll that is answered after {REPLY_NS / MS:g} ms; "
            "the gripper needs 5 ms between its answer and the next frame, which is then the command of the reflex and "
            "not a poll."
        )
    return table
