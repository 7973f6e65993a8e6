"""Commands of a WSG gripper: the states of its session, and the queue of commands.

An activation is the homing command, which moves the fingers over their whole stroke. While it is queued the gripper is
unchanged; once it is sent, the gripper is not ready until homing ends.

A grip is a force limit, a pre-position and a read-back of the limit. A change of force repeats the goal if it is known,
so that the object is clamped again; if not, only the limit changes and nothing moves.
"""

from __future__ import annotations

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.command_queue import STOP, CommandQueue, QueuedCommand
from slipd.devices.shared.gripper_states import FAULT_REPORTS, MOTIONS, Event, State, Table
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import FINGERS, Reply

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
        Event.ACTIVATION_GONE: State.SETTLING,
    },
    State.ACTIVATING: {**_AGAIN, Event.ACTIVATION_ENDED: State.SETTLING},
    State.REACTIVATION_QUEUED: {
        **_AGAIN,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.ACTIVATION_GONE: State.ACTIVATING,
        Event.ACTIVATION_ENDED: State.ACTIVATION_QUEUED,
    },
    State.SETTLING: {**_ALWAYS, **FAULT_REPORTS, Event.HALT: State.SETTLING},
}
"""States of the session; after homing is dropped before it was sent, it handles the last report again."""

IN_PROGRESS = frozenset({State.ACTIVATING, State.REACTIVATION_QUEUED})
ACTIVATION = IN_PROGRESS | {State.ACTIVATION_QUEUED}
"""In these states the gripper accepts no motion."""


ANSWER_NS = 250_000_000
"""Time allowed for the answer to a command; older grippers take 70 ms."""
ECHO_TOLERANCE_N = 0.01
"""Largest error of the force limit that was read back; it is written in the same format."""

HOME = QueuedCommand("activate", None, "homing", wire.SEARCH_REFERENCE, wire.HOME)

_STOP = QueuedCommand(STOP, None, "stop", wire.encode(wire.STOP), wire.STOP)
_ACKNOWLEDGE = QueuedCommand("acknowledge", None, "acknowledgement", wire.ACKNOWLEDGEMENT, wire.ACKNOWLEDGE)
_READ_BACK = QueuedCommand("read back", None, "force limit", wire.encode(wire.GET_FORCE), wire.GET_FORCE)
_SUCCESS = {
    wire.PREPOSITION: (wire.OK, wire.PENDING, wire.ABORTED, wire.AXIS_BLOCKED),
    wire.HOME: (wire.OK, wire.PENDING),
}
"""Status of a successful motion: a newer motion aborts the older, and a blocked axis means a clamped object."""

Goal = tuple[float, float]
"""Width, mm, and speed, mm/s."""


class WsgCommandQueue(CommandQueue):
    """Waiting commands, with their goal and force limit; for the arguments see `CommandQueue`.

    Attributes:
        width_m: The gripper's newest width, m.
        usual_speed_mps: Speed of moves without one, m/s.
    """

    def reset(self) -> None:
        """Start again: nothing waits, nothing is known."""
        super().reset()
        self.width_m = self.usual_speed_mps = 0.0
        self._goal: Goal | None = None
        self._limit_n = 0.0  # force limit that was set, N on one pad

    def home(self, *, faulty: bool) -> None:
        """Queue homing, after the acknowledgement of a fault."""
        self._goal = None
        self.replace([_ACKNOWLEDGE, HOME] if faulty else [HOME])

    def move(self, width_m: float, speed_mps: float | None, force_n: float) -> None:
        """Queue a move with a force limit."""
        self._goal = width_m * 1000, (self.usual_speed_mps if speed_mps is None else speed_mps) * 1000
        self._grip(force_n, self._goal)

    def set_force(self, force_n: float) -> None:
        """Queue a force limit, and the goal of a move that waits or closes: it clamps again, and nothing opens."""
        if self.failure:
            self._goal = None  # a motion that may never have begun must not begin now
        goal = self._goal
        waits = any(command.kind == "move" for command in self.waiting)
        closes = goal is not None and goal[0] <= self.width_m * 1000
        self._grip(force_n, goal if waits or closes else None)

    def stop(self) -> None:
        """Send a stop at once in place of all else."""
        self._goal = None
        self.interrupt(_STOP)

    def drop(self) -> bool:
        """Drop commands that are not sent yet, except a stop, and with them their goal."""
        dropped = super().drop()
        if dropped:
            self._goal = None
        return dropped

    def acknowledge(self) -> None:
        """Queue the acknowledgement of a fault in place of grips."""
        self.replace([_ACKNOWLEDGE], keep=(STOP, HOME.kind))

    def drop_grip(self, failure: str) -> None:
        """Drop the goal and the grips that wait, so that nothing moves by itself once the fault is cleared."""
        self._goal = None
        super().drop_grip(failure)

    def match_answer(self, reply: Reply, now_ns: int) -> bool:
        """Handle the answer to the outstanding command; return False if the reply is not its answer.

        The end of an older motion that was aborted by a newer one is not an answer.
        """
        command = self.outstanding
        aborted = reply.id == wire.PREPOSITION and reply.status == wire.ABORTED
        if command is None or reply.id != command.number or aborted:
            return False
        succeeded = reply.status in _SUCCESS.get(reply.id, (wire.OK,))
        self.handle_answer(now_ns, "" if succeeded else f"{command.name}: {weiss.status_word(reply.status)}")
        if succeeded and command.force_n is not None:
            self._limit_n = command.force_n
        elif succeeded and reply.id == wire.GET_FORCE:
            self.echo_ok = abs(wire.parse_number(reply.data) - self._limit_n * FINGERS) <= ECHO_TOLERANCE_N
        return True

    def handle_motion_end(self, reply: Reply) -> None:
        """Handle a later report of how a motion ended."""
        if reply.status not in _SUCCESS.get(reply.id, (reply.status,)):
            name = "homing" if reply.id == wire.HOME else "pre-position"
            self.failure = f"{name}: {weiss.status_word(reply.status)}"

    def _grip(self, force_n: float, goal: Goal | None) -> None:
        limit = wire.at_most(force_n * FINGERS)
        force_n = limit / FINGERS
        commands = [QueuedCommand("force", force_n, "force limit", wire.set_force(limit), wire.SET_FORCE)]
        if goal is not None:
            move = QueuedCommand("move", force_n, "pre-position", wire.preposition(*goal), wire.PREPOSITION)
            commands.append(move)
        self.replace([*commands, _READ_BACK], keep=(STOP,))
