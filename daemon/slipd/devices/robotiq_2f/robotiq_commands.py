"""Commands of a Robotiq gripper: the states of its session, the queue of register writes, and the Modbus line.

An activation is two writes, "clear" and "activate", after which the fingers open and close fully. While it is queued
the gripper is unchanged; once "clear" is sent it is not active, even if a reading already on the line reports so.

A newer write replaces older ones that it supersedes. There are three kinds of motion: a full write moves the fingers to
a position, a write of the force register alone changes the force (and speed), and a write of the action register alone
stops the fingers.
"""

from __future__ import annotations

from dataclasses import dataclass

from slipd.devices.robotiq_2f.robotiq_registers import (
    ACTIVATE,
    FORCE_ADDRESS,
    FULL,
    GO,
    INPUT_ADDRESS,
    OUTPUT_ADDRESS,
    REGISTERS,
    Units,
)
from slipd.devices.shared import modbus
from slipd.devices.shared.command_queue import STOP, Command, WaitingCommands
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.gripper_states import MOTIONS, REPORTS, Event, State, Table

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
        request = modbus.Request(self._unit, modbus.WRITE, address, registers=registers)
        return RegisterWrite(kind, None if force is None else self._units.newtons(force), request, goal)


COMMAND_PAUSE_NS = 5_000_000
"""Pause between commands from the manual: the registers are refreshed at 200 Hz."""
REPLY_TIMEOUT_NS = 100_000_000
"""Time allowed for a reply: it takes 5 to 10 ms, but a USB adapter under load may delay it by several times 16 ms."""
ATTEMPTS = 3
"""Unanswered transactions in a row that count as silence; a command repeated later would come as a surprise."""
NO_REPLY = (
    "no reply at Modbus address {unit}: is the gripper powered? is `unit` its address? is the line 115200 8N1, in the"
    " robot's tool I/O settings too? is the robot's own Robotiq software removed?"
)
"""What to check where no byte comes back.

Owners report this of grippers at the tool of a UR: UniversalRobots/Universal_Robots_ROS_Driver#691,
ros-industrial-attic/robotiq#216, PickNikRobotics/ros2_robotiq_gripper#88.
"""
COMMANDS_IN_A_ROW = 2
"""Commands are sent before a poll that is due, but at most this many in a row."""


class RobotiqLine:
    """The present transaction, and when the next one may begin.

    Args:
        unit: Modbus address of the gripper.
        period_ns: Time from one poll to the next.
        health: Receives ``lost``, ``bad`` and ``bad_bytes``, and a ``note`` while nothing at all is received.

    Attributes:
        outstanding: The request that waits for its reply; None if none does.
        received: Bytes received since it was sent, at most the length of a frame.
    """

    def __init__(self, unit: int, period_ns: int, health: DecoderHealth) -> None:
        self._unit = unit
        self._period_ns = period_ns
        self._health = health
        self._polls = [
            modbus.Request(unit, function, INPUT_ADDRESS, REGISTERS)
            for function in (modbus.READ_INPUT, modbus.READ_HOLDING)
        ]
        self.open(0)

    def open(self, now_ns: int) -> None:
        """Begin on a freshly opened link: no reply is awaited, and a poll is due."""
        self.outstanding: modbus.Request | None = None
        self.received = b""
        self._unanswered = 0
        self._health.note = ""
        self._commands_in_a_row = 0
        self._poll_at_ns = self._free_at_ns = self._reply_by_ns = now_ns

    @property
    def silent(self) -> bool:
        """Whether so many transactions in a row are unanswered that the gripper's state is unknown."""
        return self._unanswered >= ATTEMPTS

    def due_ns(self, *, commands_wait: bool) -> int:
        """Return when the next transaction is due, or the reply to the present one overdue."""
        if self.outstanding is not None:
            return self._reply_by_ns
        return self._free_at_ns if commands_wait else max(self._poll_at_ns, self._free_at_ns)

    def poll_soon(self, now_ns: int) -> None:
        """Make a poll due at ``now_ns``."""
        self._poll_at_ns = now_ns

    def poll_goes_first(self, now_ns: int) -> bool:
        """Return whether an overdue poll must go before further commands."""
        return now_ns >= self._poll_at_ns and self._commands_in_a_row >= COMMANDS_IN_A_ROW

    def poll(self, now_ns: int) -> bytes:
        """Request the status; return the bytes to send."""
        self._poll_at_ns = now_ns + self._period_ns
        return self.send(self._polls[0], now_ns)

    def send(self, request: modbus.Request, now_ns: int) -> bytes:
        """Begin a transaction; return the bytes to send."""
        self.outstanding = request
        self._reply_by_ns = now_ns + REPLY_TIMEOUT_NS
        return modbus.encode_request(request)

    def receive(self, data: bytes, now_ns: int) -> modbus.Reply | None:
        """Handle bytes received at ``now_ns``; return the reply that they complete, which ends the transaction."""
        request = self.outstanding
        if request is None:
            self._count_noise(len(data))
            return None
        received = self.received + data
        self.received = received[-modbus.MAX_FRAME :]
        reply = modbus.find_reply(received, request)
        if reply is None:
            self._count_noise(len(received) - len(self.received))
            return None
        self._count_noise(len(received) - reply.length)
        self._end()
        self._unanswered = 0
        self._health.note = ""
        self._free_at_ns = now_ns + COMMAND_PAUSE_NS
        if request.function == modbus.WRITE:
            self._commands_in_a_row += 1
        elif reply.error:
            self._polls.reverse()  # older firmware reads its status as holding registers, newer as input
        else:
            self._commands_in_a_row = 0
        return reply

    def handle_timeout(self) -> None:
        """End the present transaction without a reply."""
        nothing_came = not self.received
        self._count_noise(len(self.received))
        self._end()
        self._health.lost += 1
        self._unanswered += 1
        if self._unanswered % ATTEMPTS == 0:
            self._polls.reverse()
        self._health.note = NO_REPLY.format(unit=self._unit) if self.silent and nothing_came else ""

    def _end(self) -> None:
        self.outstanding, self.received = None, b""

    def _count_noise(self, noise: int) -> None:
        self._health.bad_bytes += noise
        self._health.bad += noise > 0
