"""Random walks of a gripper session against its emulated gripper, on a line that loses, delays, refuses and breaks.

Every millisecond something may happen: a permit, a drop, an acknowledgement, a fault, silence, a loss of power, a new
link. Whatever the session writes is read back from the bytes and judged against what it was permitted.
"""

from __future__ import annotations

from random import Random
from typing import Any

from gripper_peers import PEERS, SentCommand
from nanoseconds import MS

from slipd.types.permit import Permit

STEPS = 4_000
FORCE_STEP_N = 0.2
"""A force byte of the Robotiq is less than this."""


class Walk:
    """One walk; it stops with an AssertionError at the first thing that must not be."""

    def __init__(self, device: str, seed: int) -> None:
        self.rng = rng = Random(f"{device} {seed}")
        self.peer = PEERS[device](rng)
        self.session: Any = self.peer.session
        self.now_ns = 0
        self.loss, self.refusal = rng.choice(((0.0, 0.0), (0.05, 0.0), (0.02, 0.1), (0.5, 0.1)))
        self.eager = rng.choice((0.02, 0.1, 0.4))
        self.anew = rng.choice((1, 1, 8))
        self.mute_until_ns = 0
        self.restless = rng.choice((0.003, 0.02))
        self.replies: list[tuple[int, bytes]] = []
        self.goal_m: float | None = None  # of the last move, unless it was halted, dropped or replaced
        self.may_activate = False
        self.sent: set[SentCommand] = set()
        self.obeyed_n: set[float] = set()  # forces that the gripper received

    def run(self) -> None:
        self.open()
        for _ in range(STEPS):
            self.now_ns += MS
            self.receive()
            if self.rng.random() < self.eager:
                self.act()
            if self.rng.random() < self.restless:
                self.disturb()
            while (due := self.session.next_deadline()) is not None and due <= self.now_ns:
                self.write(self.session.on_time(self.now_ns))

    def open(self) -> None:
        self.replies.clear()
        self.sent.clear()
        self.obeyed_n.clear()
        self.goal_m, self.may_activate = None, False
        self.peer.opened(self.now_ns)
        self.write(self.session.start(self.now_ns))

    def receive(self) -> None:
        self.replies += [(self.now_ns, data) for data in self.peer.advance(self.now_ns)]
        due = [data for at_ns, data in self.replies if at_ns <= self.now_ns]
        self.replies = [reply for reply in self.replies if reply[0] > self.now_ns]
        for data in due:
            if self.now_ns >= self.mute_until_ns:
                self.session.receive(data, self.now_ns)
        acknowledged_n = self.session.force_acknowledged_n
        if acknowledged_n is not None:
            assert min(abs(acknowledged_n - force_n) for force_n in self.obeyed_n) < 1e-6, "no such force was received"

    def write(self, data: bytes) -> None:
        commands = self.peer.commands(data)
        for command in commands:
            self.judge(command)
        chance = self.rng.random()
        if chance < self.loss:
            return
        if chance < self.loss + self.refusal:
            answers = self.peer.refuse(data)
        else:
            answers = self.peer.hear(data, self.now_ns)
            self.obeyed_n |= {command.force_n for command in commands if command.force_n is not None}
        late_ns = self.rng.choice((0, 1, 6, 6, 30)) * MS
        self.replies += [(self.now_ns + late_ns, answer) for answer in answers if answer]

    def judge(self, command: SentCommand) -> None:
        """Whatever is on the wire was permitted, and is the newest that was."""
        if command.kind == "activate":
            assert self.may_activate, "activated without a permit"
        if command.kind == "move":
            assert self.goal_m is not None, "moved without a permit, or behind a halt"
            assert abs(command.width_m - self.goal_m) < 1e-3, "moved to another width than permitted"
        if command.force_n is not None and command not in self.sent:  # an older force may be repeated before the newest
            assert abs(command.force_n - self.session.force_sent_n) < 1e-6, "sent another force than it says"
        self.sent.add(command)

    def act(self) -> None:
        kind = self.rng.choice((*("activate",) * self.anew, *("move", "set_force", "halt") * 4, "drop", "acknowledge"))
        if kind == "drop":
            dropped = self.session.drop()
            self.may_activate = self.may_activate and not dropped
        elif kind == "acknowledge":
            self.session.acknowledge()
        else:
            self.permit(self.make(kind))

    def make(self, kind: Any) -> Permit:
        if kind in ("activate", "halt"):
            return Permit(kind)
        force_n = self.rng.uniform(*self.peer.forces_n)
        if kind == "set_force":
            return Permit(kind, force_n=force_n)
        return Permit(kind, self.rng.choice(self.peer.widths_m), self.rng.choice((None, 0.1)), force_n)

    def permit(self, permit: Permit) -> None:
        session = self.session
        state, activating, told_n = session._state, session.activating, session.force_sent_n
        taken = session.execute(permit, self.now_ns)
        if not taken:
            assert (session.force_sent_n, session.activating) == (told_n, activating), "a refusal changes nothing"
            if permit.kind != "halt":
                assert session._state is state
            return
        if permit.kind in ("move", "set_force"):
            assert not activating
            assert 0.0 <= permit.force_n - session.force_sent_n < FORCE_STEP_N
        if permit.kind == "activate":
            assert session.activating
        self.may_activate = permit.kind == "activate" or (self.may_activate and permit.kind != "halt")
        if permit.kind != "set_force":
            self.goal_m = permit.width_m

    def disturb(self) -> None:
        chance = self.rng.random()
        if chance < 0.3:
            self.mute_until_ns = max(self.mute_until_ns, self.now_ns + self.rng.choice((50, 700, 1300, 1300)) * MS)
        elif chance < 0.33:
            self.session.stop()
            assert self.session.next_deadline() is None
            for permit in map(self.make, ("activate", "move", "set_force", "halt")):
                assert not self.session.execute(permit, self.now_ns)
            assert self.session.on_time(self.now_ns) == b""
            self.open()
        else:
            self.replies += [(self.now_ns, data) for data in self.peer.disturb()]


def walk(device: str, seeds: range) -> None:
    """Walk, once a seed."""
    for seed in seeds:
        try:
            Walk(device, seed).run()
        except AssertionError as error:
            error.add_note(f"{device}, seed {seed}")
            raise
