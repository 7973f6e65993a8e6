"""A gripper session with its gripper on a perfect line, and how to bring it to each of its states."""

from __future__ import annotations

from typing import Any

from gripper_peers import PEERS, SentCommand
from gripper_walks import MS

from slipd.types.permit import Permit

PERMITS: dict[str, tuple[Any, float | None]] = {
    "move": ("move", 0.02),
    "close": ("move", 0.0),
    "force": ("set_force", None),
    "activate": ("activate", None),
    "halt": ("halt", None),
}
"""What a word of a script asks for: kind of the permit, and width."""

PAUSES_MS = {"run": 40, "wait": 900}

STATES = {
    "robotiq_2f": {
        "closed": "deaf",
        "waiting": "deaf, start",
        "inactive": "inactive, start, run 30",
        "active": "start, run 30",
        "activation queued": "inactive, start, run 30, activate",
        "cleared": "inactive, start, run 30, activate, run 1",
        "activating": "inactive, start, run 30, activate, run 6",
    },
    "wsg": {
        "closed": "",
        "waiting": "deaf, start",
        "silent": "start, run 300, deaf, run 1200",
        "inactive": "inactive, start, run 300",
        "active": "start, run 300",
        "faulty": "fault, start, run 300",
        "activation queued": "start, run 300, activate",
        "activating": "start, run 300, activate, send",
        "reactivation queued": "start, run 300, activate, send, activate",
        "settling": "start, run 300, activate, send, halt, send",
    },
    "external_gripper": {
        "closed": "",
        "unregistered": "start",
        "waiting": "start, reportless, run 30",
        "silent": "start, run 30, deaf, run 600",
        "inactive": "inactive, start, run 30",
        "active": "start, run 30",
        "faulty": "fault, start, run 30",
        "activation queued": "start, run 30, activate",
        "activating": "start, run 30, activate, deaf, send",
    },
}
"""For each gripper and state, the script that leads there."""


class Talk:
    """A session and its gripper on a perfect line; time advances only in `run`."""

    def __init__(self, device: str, script: str = "") -> None:
        self.peer: Any = PEERS[device]()
        if device == "robotiq_2f":
            self.peer.gripper._write_output((0x0100, 0, 0), -(10**10))
        self.session = self.peer.session
        self.now_ns = 0
        self.commands: list[SentCommand] = []
        self.written = b""
        self.deaf = self.refuses = False
        self.play(script)

    def play(self, script: str) -> Talk:
        """Go through the steps of a script: permits with their force, pauses, and what the gripper does."""
        for word, *numbers in (step.split() for step in script.split(", ") if step):
            if word in PERMITS:
                self.ask(word, *map(float, numbers))
            elif word in PAUSES_MS:
                self.run(int(numbers[0]) if numbers else PAUSES_MS[word])
            elif word in ("deaf", "hear", "refuse"):
                self.deaf, self.refuses = word == "deaf", word == "refuse"
            else:
                getattr(next(each for each in (self, self.session, self.peer) if hasattr(each, word)), word)()
        return self

    def ask(self, word: str, force_n: float = 8.0) -> bool:
        """Execute a permit, or "drop"."""
        if word == "drop":
            return bool(self.session.drop())
        kind, width_m = PERMITS[word]
        permit = Permit(kind, width_m, force_n=None if kind in ("activate", "halt") else force_n)
        return bool(self.session.execute(permit, self.now_ns))

    def start(self) -> None:
        self.peer.opened(self.now_ns)
        self.exchange(self.session.start(self.now_ns))

    def reportless(self) -> None:
        """The driver of an external gripper registers, and reports nothing."""
        self.peer.driver._next_ns = 10**18

    def exchange(self, data: bytes) -> None:
        self.written += data
        commands = self.peer.commands(data)
        self.commands += commands
        refused = self.refuses and commands
        for answer in self.peer.refuse(data) if refused else self.peer.hear(data, self.now_ns):
            if not self.deaf:
                self.session.receive(answer, self.now_ns)

    def send(self) -> None:
        """Exchange what is due now."""
        while (due_ns := self.session.next_deadline()) is not None and due_ns <= self.now_ns:
            self.exchange(self.session.on_time(self.now_ns))

    def run(self, ms: int) -> Talk:
        for _ in range(ms):
            self.now_ns += MS
            for data in self.peer.advance(self.now_ns):
                if not self.deaf:
                    self.session.receive(data, self.now_ns)
            self.send()
        return self
