"""Sends commands one at a time: one that is not answered is sent again, but a bounded number of times.

The part of a gripper's session that several share: it knows commands, answers and time, nothing of what they mean. A
command that is repeated later than that would come as a surprise, so then all that wait are dropped with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from slipd.devices.health import DecoderHealth

ATTEMPTS = 3
"""A command that is unanswered so often is lost."""


@dataclass(frozen=True, slots=True)
class Command:
    """One command.

    Attributes:
        name: What it is, for people.
        kind: A newer command of the same kind replaces an older one.
        data: The bytes to write.
        force: The force that it sets or moves with, N in the gripper's own way of counting; None where there is none.
        number: By which its answer is known, where answers carry one.
        renews: It makes the gripper ready: forces sent before are void, and unanswered ones are not repeated.
    """

    name: str
    kind: int | str
    data: bytes
    force: float | None = None
    number: int = 0
    renews: bool = False

    def force_after(self, force: float | None) -> float | None:
        """Return the force that is set once this is sent, where ``force`` was."""
        return self.force if self.renews or self.force is not None else force

    def makes_void(self, older: Command) -> bool:
        """Return whether an older command, unanswered, is not repeated once this waits."""
        return self.kind == older.kind or (self.renews and older.force is not None)


class Commands:
    """What waits to be sent, and the one command whose answer is waited for.

    Args:
        answer_ns: How long an answer may take.
        health: Its ``lost`` counts unanswered commands.

    Attributes:
        waiting: In their order.
        outstanding: Was sent and is not answered.
        trouble: Why the last command was lost; "" where it was not.
    """

    def __init__(self, answer_ns: int, health: DecoderHealth) -> None:
        self._answer_ns = answer_ns
        self._health = health
        self.reset()

    def reset(self) -> None:
        """Begin anew: nothing waits, nothing was lost."""
        self.waiting: list[Command] = []
        self.outstanding: Command | None = None
        self.trouble = ""
        self._force: float | None = None  # that was sent
        self._attempts = 0
        self._due_ns = 0

    @property
    def due_ns(self) -> int | None:
        """When `on_time` is due; None where nothing is to be sent."""
        return self._due_ns if self.waiting or self.outstanding is not None else None

    @property
    def force(self) -> float | None:
        """The force that is set once all that waits is sent; None where none was."""
        force = self._force
        for command in self.waiting:
            force = command.force_after(force)
        return force

    def void(self) -> None:
        """Take note that the gripper does not know any more what it was told."""
        self._force = None

    def drop(self, keep: Sequence[int | str]) -> bool:
        """Forget what waits but for these kinds, and repeat nothing else; True where anything was forgotten."""
        kept = [command for command in self.waiting if command.kind in keep]
        dropped = len(kept) < len(self.waiting)
        self.waiting = kept
        if self.outstanding is not None and self.outstanding.kind not in keep:
            self._attempts = ATTEMPTS
        return dropped

    def replace(self, commands: Iterable[Command], keep: Sequence[Command] = ()) -> None:
        """Let these wait instead of what waits, behind those of ``keep`` that do."""
        self.waiting = [command for command in self.waiting if command in keep]
        self.waiting += commands

    def interrupt(self, command: Command) -> None:
        """Send this at once, instead of all else; no other answer is waited for."""
        self.waiting, self.outstanding = [command], None
        self._attempts = self._due_ns = 0

    def holds(self, kinds: Iterable[int | str]) -> bool:
        """Say whether a command of these kinds waits or is unanswered."""
        here = [*self.waiting, *([self.outstanding] if self.outstanding is not None else [])]
        return any(command.kind in kinds for command in here)

    def on_time(self, now_ns: int) -> bytes:
        """Return the command that is due at ``now_ns``; empty when none is."""
        due_ns = self.due_ns
        if due_ns is None or now_ns < due_ns:
            return b""
        if self.outstanding is not None:
            self._time_out(self.outstanding)
        if not self.waiting:
            return b""
        self.outstanding = self.waiting.pop(0)
        self._force = self.outstanding.force_after(self._force)
        self._attempts += 1
        self._due_ns = now_ns + self._answer_ns
        return self.outstanding.data

    def answered(self, now_ns: int, trouble: str = "") -> None:
        """Take the answer to the outstanding command; what waits is given up where it says that there is trouble."""
        self.outstanding, self.trouble = None, ""
        self._attempts, self._due_ns = 0, now_ns
        if trouble:
            self.give_up(trouble)

    def give_up(self, trouble: str) -> None:
        """Drop everything, for a reason."""
        self.waiting, self.outstanding = [], None
        self._attempts = 0
        self.trouble = trouble

    def _time_out(self, command: Command) -> None:
        self._health.lost += 1
        self.outstanding = None
        if self._attempts >= ATTEMPTS:
            self.give_up(f"no answer to {command.name}")
        elif any(newer.makes_void(command) for newer in self.waiting):
            self._attempts = 0
        else:
            self.waiting.insert(0, command)
