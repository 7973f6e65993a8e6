"""Commands of a gripper: what each does to the force in effect, those that wait, and the queue that sends them.

A queue sends commands one at a time, and repeats an unanswered one a limited number of times. It handles commands,
answers and time, but does not know what they mean. When a command stays unanswered, all waiting commands are dropped
with it, because a later motion would come as a surprise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from slipd.devices.shared.device_interface import DecoderHealth

STOP = "stop"
"""Kind of the command that no drop removes."""
SETS_FORCE = ("move", "force")
"""Kinds of the commands that only an active gripper obeys."""
_ACTIVATES = ("clear", "activate")


@dataclass(frozen=True, slots=True)
class Command:
    """One command.

    Attributes:
        kind: "activate" (of a Robotiq after "clear"), "move", "force", "stop", "acknowledge" or another.
        force_n: Force that it sets or moves with, N on one pad; None if it has none.
    """

    kind: str
    force_n: float | None

    @property
    def activates(self) -> bool:
        """Whether it makes the gripper ready, so that earlier forces no longer apply."""
        return self.kind in _ACTIVATES

    def force_after(self, force_n: float | None) -> float | None:
        """Return the force in effect after this command, given the one before, N."""
        return self.force_n if self.activates or self.force_n is not None else force_n


C = TypeVar("C", bound=Command)


class WaitingCommands(Generic[C]):
    """Commands that wait, in order, and the forces of those before.

    Attributes:
        waiting: Commands that are not sent yet.
        acknowledged_n: Force that the gripper acknowledged last, N; None if none since it was made ready.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start again: nothing waits, nothing was sent."""
        self.waiting: list[C] = []
        self.acknowledged_n: float | None = None
        self._sent_n: float | None = None

    @property
    def force_n(self) -> float | None:
        """Force in effect after all waiting commands, N; None if none was set since the gripper was made ready."""
        force_n = self._sent_n
        for command in self.waiting:
            force_n = command.force_after(force_n)
        return force_n

    def forget_force(self) -> None:
        """Record that the gripper no longer has the force that was sent."""
        self._sent_n = self.acknowledged_n = None

    def drop(self) -> bool:
        """Drop waiting commands except a stop; return whether there were any."""
        kept = [command for command in self.waiting if command.kind == STOP]
        dropped = len(kept) < len(self.waiting)
        self.waiting = kept
        return dropped

    def send(self) -> C:
        """Take out the next command, which is sent now."""
        command = self.waiting.pop(0)
        self._sent_n = command.force_after(self._sent_n)
        return command

    def acknowledged(self, command: Command) -> None:
        """Record that the gripper acknowledged a command."""
        self.acknowledged_n = command.force_after(self.acknowledged_n)


ATTEMPTS = 3
"""A command that is unanswered this often is lost."""


@dataclass(frozen=True, slots=True)
class QueuedCommand(Command):
    """One command of a queue; a newer one of the same kind replaces an older one.

    Attributes:
        name: Its name, for people.
        data: Bytes to send.
        number: Number that identifies its answer.
    """

    name: str
    data: bytes
    number: int

    def supersedes(self, older: QueuedCommand) -> bool:
        """Return whether an older, unanswered command is not repeated because this one waits."""
        return self.kind == older.kind or (self.activates and older.force_n is not None)


class CommandQueue(WaitingCommands[QueuedCommand], ABC):
    """Commands that wait, and the one command whose answer is awaited; a subclass makes the commands of its gripper.

    Args:
        answer_ns: Time allowed for an answer.
        health: Its ``lost`` counts unanswered commands.

    Attributes:
        outstanding: The command that was sent and is not answered.
        failure: Why the last command was lost; "" if it was not.
        echo_ok: Whether the gripper applied the force that it was sent last; None if it reported none yet.
    """

    def __init__(self, answer_ns: int, health: DecoderHealth) -> None:
        self._answer_ns = answer_ns
        self._health = health
        super().__init__()

    def reset(self) -> None:
        """Start again: nothing waits, nothing was lost."""
        super().reset()
        self.outstanding: QueuedCommand | None = None
        self.failure = ""
        self.echo_ok: bool | None = None
        self._attempts = 0
        self._due_ns = 0

    @abstractmethod
    def move(self, width_m: float, speed_mps: float | None, force_n: float) -> None:
        """Queue a move that the gripper can make; speed None: its usual one."""

    @abstractmethod
    def set_force(self, force_n: float) -> None:
        """Queue a force that the gripper has; a move that waits is queued with that force."""

    @abstractmethod
    def acknowledge(self) -> None:
        """Queue the acknowledgement of a fault."""

    @property
    def due_ns(self) -> int | None:
        """When `on_time` is due, ns; None if there is nothing to send."""
        return self._due_ns if self.waiting or self.outstanding is not None else None

    def drop(self) -> bool:
        """Drop waiting commands except a stop, and repeat no other; return whether anything was dropped."""
        dropped = super().drop()
        if self.outstanding is not None and self.outstanding.kind != STOP:
            self._attempts = ATTEMPTS
        return dropped

    def drop_grip(self, failure: str) -> None:
        """Drop everything if a force is waiting or unanswered, because the gripper cannot obey."""
        unanswered = [] if self.outstanding is None else [self.outstanding]
        if any(command.kind in SETS_FORCE for command in (*self.waiting, *unanswered)):
            self.give_up(failure)

    def replace(self, commands: Iterable[QueuedCommand], keep: Collection[str] = ()) -> None:
        """Queue these commands in place of the waiting ones, after those of the kinds ``keep``."""
        self.waiting = [command for command in self.waiting if command.kind in keep]
        self.waiting += commands

    def interrupt(self, command: QueuedCommand) -> None:
        """Send this command at once in place of all others, and await no other answer."""
        self.waiting, self.outstanding = [command], None
        self._attempts = self._due_ns = 0

    def on_time(self, now_ns: int) -> bytes:
        """Return the command that is due at ``now_ns``; empty if none is."""
        due_ns = self.due_ns
        if due_ns is None or now_ns < due_ns:
            return b""
        if self.outstanding is not None:
            self._handle_timeout(self.outstanding)
        if not self.waiting:
            return b""
        self.outstanding = self.send()
        self._attempts += 1
        self._due_ns = now_ns + self._answer_ns
        return self.outstanding.data

    def handle_answer(self, now_ns: int, failure: str = "") -> None:
        """Handle the answer to the outstanding command; drop waiting commands if it reports a failure."""
        if self.outstanding is not None and not failure:
            self.acknowledged(self.outstanding)
        self.outstanding, self.failure = None, ""
        self._attempts, self._due_ns = 0, now_ns
        if failure:
            self.give_up(failure)

    def give_up(self, failure: str) -> None:
        """Drop everything, and record the reason."""
        self.waiting, self.outstanding = [], None
        self._attempts = 0
        self.failure = failure

    def _handle_timeout(self, command: QueuedCommand) -> None:
        self._health.lost += 1
        self.outstanding = None
        if self._attempts >= ATTEMPTS:
            self.give_up(f"no answer to {command.name}")
        elif any(newer.supersedes(command) for newer in self.waiting):
            self._attempts = 0
        else:
            self.waiting.insert(0, command)
