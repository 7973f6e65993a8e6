"""What a WSG gripper is asked to do: the states of the session, and the queue of its commands.

An activation is the homing command, which moves the fingers over their whole stroke. While it is queued the gripper is
unchanged; once it is sent, the gripper is not ready until homing ends.

A grip is a force limit, a pre-position and a read-back of the limit. A change of force repeats the goal if it is known,
so that the object is clamped again; if not, only the limit changes and nothing moves.
"""

from __future__ import annotations

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.command_queue import Command, CommandQueue
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.gripper_session import FAULT_REPORTS, MOTIONS, Event, State, Table
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_decoder import Reply

_ALWAYS = {Event.ACTIVATE: State.ACTIVATION_QUEUED, Event.FELL_SILENT: State.SILENT}
_AGAIN = {Event.ACTIVATE: State.REACTIVATION_QUEUED, Event.FELL_SILENT: State.SILENT, Event.HALT: State.SETTLING}

TRANSITIONS: Table = {
    State.CLOSED: {},
    State.WAITING: FAULT_REPORTS,
    State.SILENT: FAULT_REPORTS,
    State.INACTIVE: {**_ALWAYS, **FAULT_REPORTS},
    State.ACTIVE: {**_ALWAYS, **FAULT_REPORTS, **MOTIONS},
    State.FAULTY: {**_ALWAYS, **FAULT_REPORTS, Event.HALT: State.FAULTY},
    State.ACTIVATION_QUEUED: {
        **_ALWAYS,
        Event.HALT: State.SETTLING,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.ACTIVATION_DROPPED: State.SETTLING,
    },
    State.ACTIVATING: {**_AGAIN, Event.ACTIVATION_ENDED: State.SETTLING},
    State.REACTIVATION_QUEUED: {
        **_AGAIN,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.ACTIVATION_DROPPED: State.ACTIVATING,
        Event.ACTIVATION_ENDED: State.ACTIVATION_QUEUED,
    },
    State.SETTLING: {**_ALWAYS, **FAULT_REPORTS, Event.HALT: State.SETTLING},
}
"""States of the session; after homing is dropped before it was sent, it handles the last report again."""

QUEUED = frozenset({State.ACTIVATION_QUEUED, State.REACTIVATION_QUEUED})
IN_PROGRESS = frozenset({State.ACTIVATING, State.REACTIVATION_QUEUED})
ACTIVATION = QUEUED | IN_PROGRESS
"""In these states the gripper accepts no motion."""


ANSWER_NS = 250_000_000
"""Time allowed for the answer to a command; older grippers take 70 ms."""
ECHO_TOLERANCE_N = 0.01
"""Largest error of the force limit that was read back; it is written in the same format."""

HOME = Command("homing", wire.HOME, wire.home(), activates=True)

_SETS_FORCE = (wire.SET_FORCE, wire.PREPOSITION)
_STOP = Command("stop", wire.STOP, wire.encode(wire.STOP))
_ACKNOWLEDGE = Command("acknowledgement", wire.ACKNOWLEDGE, wire.acknowledge())
_READ_BACK = Command("force limit", wire.GET_FORCE, wire.encode(wire.GET_FORCE))
_SUCCESS = {
    wire.PREPOSITION: (wire.OK, wire.PENDING, wire.ABORTED, wire.AXIS_BLOCKED),
    wire.HOME: (wire.OK, wire.PENDING),
}
"""Status of a successful motion: a newer motion aborts the older, and a blocked axis means a clamped object."""

Goal = tuple[float, float]
"""Width, mm, and speed, mm/s."""


class WsgCommandQueue(CommandQueue):
    """Waiting commands, with their goal and force limit.

    Args:
        health: Its ``lost`` counts unanswered commands.

    Attributes:
        echo_ok: Whether the force limit was last read back as it was set; None if it was not read yet.
    """

    def __init__(self, health: DecoderHealth) -> None:
        super().__init__(ANSWER_NS, health)

    def reset(self) -> None:
        """Start again: nothing waits, nothing is known."""
        super().reset()
        self.echo_ok: bool | None = None
        self._goal: Goal | None = None
        self._limit = 0.0  # force limit that was set, N of both fingers

    def home(self, *, faulty: bool) -> None:
        """Queue homing, after the acknowledgement of a fault."""
        self._goal = None
        self.replace([_ACKNOWLEDGE, HOME] if faulty else [HOME])

    def move(self, goal: Goal, force: float) -> None:
        """Queue a move with a force limit, N of both fingers."""
        self._goal = goal
        self._grip(force, goal)

    def set_force(self, force: float, width_m: float) -> None:
        """Queue a force limit, N of both fingers, with the goal of a move that waits or closes from this width."""
        if self.failure:
            self._goal = None  # a motion that may never have begun must not begin now
        goal = self._goal
        waits = any(command.kind == wire.PREPOSITION for command in self.waiting)
        closes = goal is not None and goal[0] <= width_m * 1000
        self._grip(force, goal if waits or closes else None)

    def stop(self) -> None:
        """Send a stop at once in place of all else."""
        self._goal = None
        self.interrupt(_STOP)

    def drop_unsent(self) -> bool:
        """Drop commands that are not sent yet, except a stop; return whether there were any."""
        dropped = self.drop((wire.STOP,))
        if dropped:
            self._goal = None
        return dropped

    def acknowledge(self) -> None:
        """Queue the acknowledgement of a fault in place of grips."""
        self.replace([_ACKNOWLEDGE], keep=(_STOP, HOME))

    def drop_grip(self, failure: str) -> None:
        """Drop the goal and the grips that wait, so that nothing moves by itself once the fault is cleared."""
        self._goal = None
        if self.contains(_SETS_FORCE):
            self.give_up(failure)

    def match_answer(self, reply: Reply, now_ns: int) -> bool:
        """Handle the answer to the outstanding command; return False if the reply is not its answer.

        The end of an older motion that was aborted by a newer one is not an answer.
        """
        command = self.outstanding
        aborted = reply.id == wire.PREPOSITION and reply.status == wire.ABORTED
        if command is None or reply.id != command.kind or aborted:
            return False
        succeeded = reply.status in _SUCCESS.get(reply.id, (wire.OK,))
        self.handle_answer(now_ns, "" if succeeded else f"{command.name}: {weiss.status_word(reply.status)}")
        if succeeded and command.force is not None:
            self._limit = command.force
        elif succeeded and reply.id == wire.GET_FORCE:
            self.echo_ok = abs(wire.parse_number(reply.data) - self._limit) <= ECHO_TOLERANCE_N
        return True

    def handle_motion_end(self, reply: Reply) -> None:
        """Handle a later report of how a motion ended."""
        if reply.status not in _SUCCESS.get(reply.id, (reply.status,)):
            name = "homing" if reply.id == wire.HOME else "pre-position"
            self.failure = f"{name}: {weiss.status_word(reply.status)}"

    def _grip(self, force: float, goal: Goal | None) -> None:
        commands = [Command("force limit", wire.SET_FORCE, wire.set_force(force), force)]
        if goal is not None:
            commands.append(Command("pre-position", wire.PREPOSITION, wire.preposition(*goal), force))
        self.replace([*commands, _READ_BACK], keep=(_STOP,))
