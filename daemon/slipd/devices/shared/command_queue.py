"""Queue that sends commands one at a time, repeats an unanswered one a limited number of times, and its sessions.

Several gripper sessions share it. It handles commands, answers and time, but does not know what they mean. When a
command stays unanswered, all waiting commands are dropped with it, because a later motion would come as a surprise.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.gripper_session import Event, GripperSessionBase, State, check_range
from slipd.devices.shared.waiting_commands import SETS_FORCE, STOP, Command, WaitingCommands

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


Range = tuple[float, float]
UNKNOWN_RANGE = 0.0, math.inf
Queue = TypeVar("Queue", bound=CommandQueue)


class QueuedGripperSession(GripperSessionBase[Queue]):
    """Session that sends one command at a time, to a gripper that reports its own ranges.

    A subclass sets ``decoder`` too.

    Attributes:
        width_range_m: Smallest and largest width between the pads, m; (0, inf) until the gripper reports them.
        force_range_n: Smallest and largest force, N on one pad; likewise.
        speed_range_mps: Smallest and largest speed, m/s; None if it cannot be set, or until the gripper reports them.
    """

    decoder: Any

    def _reset(self, state: State) -> None:
        super()._reset(state)
        self.decoder.forget()
        self.identity = ""
        self._set_ranges()
        self._fault = ""  # in the last reading

    @property
    def command_lost(self) -> bool:
        """Whether the last command was refused, was never acknowledged, or reached a gripper that could not obey."""
        return bool(self._queue.failure)

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: a force has no steps."""
        return force_n

    def drop(self) -> bool:
        """Drop commands that are not sent yet, except a stop; do not repeat unanswered ones."""
        dropped = self._queue.drop()
        self._follow_activation()
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge a fault if the gripper reports one."""
        self._queue.failure = ""
        if self._fault:
            self._queue.acknowledge()
            self._follow_activation()

    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        if not self._accepts(Event.MOVE):
            return False
        if speed_mps is not None:
            check_range("speed", speed_mps, self.speed_range_mps or (0.0, 0.0), "m/s")
        check_range("width", width_m, self.width_range_m, "m")
        self._handle_event(Event.MOVE)
        self._queue.move(width_m, speed_mps, self._in_range(force_n))
        return True

    def _set_force(self, force_n: float) -> None:
        self._queue.set_force(self._in_range(force_n))

    def _set_ranges(
        self, width_m: Range = UNKNOWN_RANGE, force_n: Range = UNKNOWN_RANGE, speed_mps: Range | None = None
    ) -> None:
        """Set the ranges that the gripper reports."""
        self.width_range_m, self.force_range_n, self.speed_range_mps = width_m, force_n, speed_mps

    def _in_range(self, force_n: float) -> float:
        """Return the nearest force that the gripper has."""
        least, most = self.force_range_n
        return min(max(force_n, least), most)

    def _follow_activation(self) -> None:
        """Update the state with the outcome of a queued activation."""
        if any(command.activates for command in self._queue.waiting):
            return
        sent = self._queue.outstanding
        if sent is not None and sent.activates:
            self._handle_event(Event.ACTIVATION_SENT)
        elif self._handle_event(Event.ACTIVATION_GONE):
            self._repeat_report()
