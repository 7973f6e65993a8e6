"""What a Robotiq gripper is asked to do: the states of the session, and the queue of its register writes.

An activation is two writes, "clear" and "activate", after which the fingers open and close fully. While it is queued
the gripper is unchanged; once "clear" is sent it is not active, even if a reading already on the line reports so.

A newer write replaces older ones that it supersedes. There are three kinds of motion: a full write moves the fingers to
a position, a write of the force register alone changes the force (and speed), and a write of the action register alone
stops the fingers.
"""

from __future__ import annotations

from dataclasses import dataclass

from slipd.devices.robotiq_2f.robotiq_registers import ACTIVATE, FORCE_ADDRESS, FULL, GO, OUTPUT_ADDRESS, Units
from slipd.devices.shared import modbus
from slipd.devices.shared.gripper_session import MOTIONS, REPORTS, Event, State, Table
from slipd.devices.shared.waiting_commands import STOP, Command, WaitingCommands

_REPORTS = REPORTS | {Event.REPORTED_ACTIVATING: State.ACTIVATING}
_ALWAYS = {Event.ACTIVATE: State.ACTIVATION_QUEUED, Event.FELL_SILENT: State.WAITING}
_DROPPED = dict.fromkeys((Event.DROP, Event.GIVE_UP), State.WAITING)

TRANSITIONS: Table = {
    State.CLOSED: {},
    State.WAITING: {**_ALWAYS, **_REPORTS},
    State.INACTIVE: {**_ALWAYS, **_REPORTS},
    State.ACTIVE: {**_ALWAYS, **_REPORTS, **MOTIONS},
    State.ACTIVATION_QUEUED: {**_ALWAYS, **_DROPPED, Event.CLEAR_SENT: State.CLEARED},
    State.CLEARED: {
        **_ALWAYS,
        **_DROPPED,
        Event.CLEAR_REPEATED: State.ACTIVATION_QUEUED,
        Event.ACTIVATION_SENT: State.ACTIVATING,
    },
    State.ACTIVATING: {
        **_ALWAYS,
        **_REPORTS,
        Event.ACTIVATION_REPEATED: State.CLEARED,
        Event.GIVE_UP: State.WAITING,
    },
}
"""States of the session; after a queued activation is dropped, it handles the last report again.

An unanswered "clear" or "activate" is queued again. A gripper that fell silent may have lost power: its state is that
before any status.
"""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.CLEARED, State.ACTIVATING})
"""In these states the gripper accepts no motion."""


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal of the fingers: position byte and speed byte."""

    position: int
    speed: int


@dataclass(frozen=True, slots=True)
class RegisterWrite(Command):
    """One register write; "clear" and "activate" together are an activation.

    Attributes:
        request: Modbus request.
        goal: Goal of a "move".
    """

    request: modbus.Request
    goal: Goal | None


_WHOLE = ("clear", "activate", "move", STOP)
_SUPERSEDED_BY = {
    "activate": _WHOLE,
    "move": _WHOLE,
    STOP: _WHOLE,
    "force": ("clear", "activate", "move", "force"),
}
"""For each kind, the newer kinds after which an unanswered write is not repeated; a "clear" always is."""


class WriteQueue(WaitingCommands[RegisterWrite]):
    """Waiting writes, in order.

    Args:
        unit: Modbus address of the gripper.
        units: Converts force bytes.

    Attributes:
        requested: Position byte sent last since the activation; None if none was sent.
    """

    def __init__(self, unit: int, units: Units) -> None:
        self._unit, self._units = unit, units
        self._clear = self._write("clear", (0, 0, 0))
        self._activation = self._write("activate", (ACTIVATE << 8, 0, 0))
        self._halt = self._write(STOP, (ACTIVATE << 8,))
        super().__init__()

    def reset(self) -> None:
        """Start again: nothing waits, nothing was sent."""
        super().reset()
        self.requested: int | None = None
        self._sent_goal = Goal(0, 0)

    def activate(self) -> None:
        """Queue an activation, and nothing else."""
        self.waiting = [self._clear, self._activation]

    def move(self, goal: Goal, force: int) -> None:
        """Queue a move, and nothing else."""
        self.waiting = [self._go(goal, force)]

    def set_force(self, force: int, unanswered: RegisterWrite | None) -> None:
        """Queue a force; a move that waits, or is ``unanswered`` and would be repeated, is queued with that force."""
        newest = self.waiting[-1] if self.waiting else unanswered
        goal = None if newest is None else newest.goal
        halts = [write for write in self.waiting if write.kind == STOP]
        self.waiting = [*halts, self._set(force) if goal is None else self._go(goal, force)]

    def halt(self) -> None:
        """Queue a halt before all else; keep a waiting force, but not that of a move that never began."""
        forces = [write.request.registers[-1] & FULL for write in self.waiting if write.force_n is not None]
        starts_move = any(write.goal and write.goal.position != self._sent_goal.position for write in self.waiting)
        self.waiting = [self._halt] if starts_move else [self._halt, *map(self._set, forces[-1:])]

    def send(self) -> RegisterWrite:
        """Take out the next write, which is sent now."""
        write = super().send()
        if write.kind == "clear":
            self.requested = None
        elif write.goal is not None:
            self.requested, self._sent_goal = write.goal.position, write.goal
        return write

    def repeat(self, write: RegisterWrite) -> bool:
        """Queue an unanswered write again; return False if a newer one supersedes it."""
        if write.kind == "clear":
            self.activate()
            return True
        if any(newer.kind in _SUPERSEDED_BY[write.kind] for newer in self.waiting):
            return False
        self.waiting.append(write)
        return True

    def _go(self, goal: Goal, force: int) -> RegisterWrite:
        registers = (ACTIVATE | GO) << 8, goal.position, goal.speed << 8 | force
        return self._write("move", registers, goal=goal, force=force)

    def _set(self, force: int) -> RegisterWrite:
        return self._write("force", (self._sent_goal.speed << 8 | force,), FORCE_ADDRESS, force=force)

    def _write(
        self,
        kind: str,
        registers: tuple[int, ...],
        address: int = OUTPUT_ADDRESS,
        *,
        goal: Goal | None = None,
        force: int | None = None,
    ) -> RegisterWrite:
        request = modbus.Request(self._unit, modbus.WRITE, write_address=address, registers=registers)
        return RegisterWrite(kind, None if force is None else self._units.newtons(force), request, goal)
