"""Commands of a gripper: what each does to the force in effect, and those that wait to be sent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

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
