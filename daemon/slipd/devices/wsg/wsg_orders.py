"""Queue of commands to a WSG gripper, and its answers to them.

A grip is a force limit, a pre-position and a read-back of the limit. A change of force repeats the goal if it is known,
so that the object is clamped anew; if not, only the limit changes and nothing moves.
"""

from __future__ import annotations

from slipd.devices import weiss
from slipd.devices.commands import Command, Commands
from slipd.devices.health import DecoderHealth
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import FINGERS, Limits, Reply

ANSWER_NS = 250_000_000
"""For the answer to a command: older grippers take 70 ms."""
ECHO_TOLERANCE_N = 0.01
"""Of the force limit: it is written and read back in the same format."""

HOME = Command("homing", wire.HOME, wire.home(), renews=True)

_SETS = (wire.SET_FORCE, wire.PREPOSITION)
_STOP = Command("stop", wire.STOP, wire.encode(wire.STOP))
_ACKNOWLEDGE = Command("acknowledgement", wire.ACKNOWLEDGE, wire.acknowledge())
_READ_BACK = Command("force limit", wire.GET_FORCE, wire.encode(wire.GET_FORCE))
_WELL = {
    wire.PREPOSITION: (wire.OK, wire.PENDING, wire.ABORTED, wire.AXIS_BLOCKED),
    wire.HOME: (wire.OK, wire.PENDING),
}
"""Of motions: a newer one aborts the older, and what blocks the way is what was to be clamped."""

Goal = tuple[float, float]
"""Width, mm, and speed, mm/s."""


class WsgOrders(Commands):
    """The commands that wait, and the goal and the force limit that they are about.

    Args:
        health: Its ``lost`` counts unanswered commands.

    Attributes:
        echo_ok: Whether the force limit was last read back as it was set; None where it was not read yet.
    """

    def __init__(self, health: DecoderHealth) -> None:
        super().__init__(ANSWER_NS, health)

    def reset(self) -> None:
        """Begin anew: nothing waits, nothing is known."""
        super().reset()
        self.echo_ok: bool | None = None
        self._goal: Goal | None = None
        self._limit = 0.0  # of the force as it was set, N of both fingers

    @property
    def home_waits(self) -> bool:
        """Whether homing is to be sent yet."""
        return HOME in self.waiting

    @property
    def home_is_sent(self) -> bool:
        """Whether homing was sent last, and is not answered."""
        return self.outstanding is HOME

    def home(self, *, faulty: bool) -> None:
        """Queue homing, behind the acknowledgement of a fault."""
        self._goal = None
        self.replace([_ACKNOWLEDGE, HOME] if faulty else [HOME])

    def move(self, limits: Limits, goal: Goal, force_n: float) -> None:
        """Queue a move with a force, N on one pad."""
        self._goal = goal
        self._grip(limits, force_n, goal)

    def set_force(self, limits: Limits, force_n: float, width_m: float) -> None:
        """Queue a force, N on one pad: with the goal of a move that waits, or that closes from the present width."""
        if self.trouble:
            self._goal = None  # what may never have begun does not begin now
        goal = self._goal
        waits = any(command.kind == wire.PREPOSITION for command in self.waiting)
        closes = goal is not None and goal[0] <= width_m * 1000
        self._grip(limits, force_n, goal if waits or closes else None)

    def stop(self) -> None:
        """Send a stop at once, instead of all else."""
        self._goal = None
        self.interrupt(_STOP)

    def forget(self) -> bool:
        """Drop what is not sent yet, except a stop; return whether there was anything."""
        dropped = self.drop((wire.STOP,))
        if dropped:
            self._goal = None
        return dropped

    def acknowledge(self) -> None:
        """Queue the acknowledgement of a fault, instead of grips."""
        self.replace([_ACKNOWLEDGE], keep=(_STOP, HOME))

    def lose_grip(self, trouble: str) -> None:
        """Drop the goal and the grips that wait, so that nothing moves by itself once the fault is cleared."""
        self._goal = None
        if self.holds(_SETS):
            self.give_up(trouble)

    def take_answer(self, reply: Reply, now_ns: int) -> bool:
        """Handle the answer to the outstanding command; return False if it is not one.

        The end of an older motion that a newer one of its kind has aborted is none.
        """
        command = self.outstanding
        aborted = reply.id == wire.PREPOSITION and reply.status == wire.ABORTED
        if command is None or reply.id != command.kind or aborted:
            return False
        well = reply.status in _WELL.get(reply.id, (wire.OK,))
        self.answered(now_ns, "" if well else f"{command.name}: {weiss.status_word(reply.status)}")
        if well and command.force is not None:
            self._limit = command.force
        elif well and reply.id == wire.GET_FORCE:
            self.echo_ok = abs(wire.parse_number(reply.data) - self._limit) <= ECHO_TOLERANCE_N
        return True

    def take_end(self, reply: Reply) -> None:
        """Handle a later report of how a motion ended."""
        if reply.status not in _WELL.get(reply.id, (reply.status,)):
            name = "homing" if reply.id == wire.HOME else "pre-position"
            self.trouble = f"{name}: {weiss.status_word(reply.status)}"

    def _grip(self, limits: Limits, force_n: float, goal: Goal | None) -> None:
        force = wire.at_most(min(max(force_n * FINGERS, limits.min_force), limits.nominal_force))
        commands = [Command("force limit", wire.SET_FORCE, wire.set_force(force), force)]
        if goal is not None:
            commands.append(Command("pre-position", wire.PREPOSITION, wire.preposition(*goal), force))
        self.replace([*commands, _READ_BACK], keep=(_STOP,))
