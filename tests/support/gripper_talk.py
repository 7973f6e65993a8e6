"""A gripper session with its gripper on a perfect line, and how to bring it to each of its states."""

from __future__ import annotations

from typing import Any

from gripper_peers import PEERS, SentCommand
from millisecond_bench import GripperBench

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
        "waiting": "deaf, open",
        "inactive": "inactive, open, run 30",
        "active": "open, run 30",
        "activation queued": "inactive, open, run 30, activate",
        "cleared": "inactive, open, run 30, activate, run 1",
        "activating": "inactive, open, run 30, activate, run 6",
    },
    "wsg": {
        "closed": "",
        "waiting": "deaf, open",
        "silent": "open, run 300, deaf, run 1200",
        "inactive": "inactive, open, run 300",
        "active": "open, run 300",
        "faulty": "fault, open, run 300",
        "activation queued": "open, run 300, activate",
        "activating": "open, run 300, activate, send",
        "reactivation queued": "open, run 300, activate, send, activate",
        "settling": "open, run 300, activate, send, halt, send",
    },
    "external_gripper": {
        "closed": "",
        "unregistered": "open",
        "waiting": "open, reportless, run 30",
        "silent": "open, run 30, deaf, run 600",
        "inactive": "inactive, open, run 30",
        "active": "open, run 30",
        "faulty": "fault, open, run 30",
        "activation queued": "open, run 30, activate",
        "activating": "open, run 30, activate, deaf, send",
    },
}
"""For each gripper and state, the script that leads there."""


class Talk(GripperBench):
    """A session and its gripper, and the commands that it gets."""

    def __init__(self, device: str, script: str = "") -> None:
        peer: Any = PEERS[device]()
        super().__init__(peer.session, peer)
        if device == "robotiq_2f":
            peer.gripper._write_output((0x0100, 0, 0), -(10**10))
        self.commands: list[SentCommand] = []
        self.refuses = False
        self.play(script)

    def play(self, script: str) -> Talk:
        """Go through the steps of a script: permits with their force, pauses in ms, and what the gripper does."""
        for word, *numbers in (step.split() for step in script.split(", ") if step):
            if word in PERMITS:
                self.ask(word, *map(float, numbers))
            elif word in PAUSES_MS:
                self.run(float(numbers[0] if numbers else PAUSES_MS[word]) / 1000)
            elif word in ("deaf", "hear", "refuse"):
                self.mute, self.refuses = word == "deaf", word == "refuse"
            else:
                getattr(next(each for each in (self, self.session, self.gripper) if hasattr(each, word)), word)()
        return self

    def ask(self, word: str, force_n: float = 8.0) -> bool:
        """Execute a permit, or "drop"."""
        if word == "drop":
            return bool(self.session.drop())
        kind, width_m = PERMITS[word]
        permit = Permit(kind, width_m, force_n=None if kind in ("activate", "halt") else force_n)
        return bool(self.session.execute(permit, self.now_ns))

    def reportless(self) -> None:
        """The driver of an external gripper registers, and reports nothing."""
        self.gripper.driver._next_ns = 10**18

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        commands = self.gripper.commands(data)
        self.commands += commands
        refused = self.refuses and commands
        self.deliver(self.gripper.refuse(data) if refused else self.gripper.hear(data, self.now_ns))
