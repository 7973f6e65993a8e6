"""Session with a WSG gripper: permits become commands, one at a time, and updates become samples."""

from __future__ import annotations

import math

from slipd.devices import weiss
from slipd.devices.conversation import Conversation, Step
from slipd.devices.permitted_session import PermittedSession
from slipd.devices.state_machine import StateMachine
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_decoder import Decoder
from slipd.devices.wsg.wsg_messages import FINGERS, Limits, Reply
from slipd.devices.wsg.wsg_orders import HOME, WsgOrders
from slipd.devices.wsg.wsg_states import ACTIVATION, QUEUED, TRANSITIONS, UNDER_WAY, Event, State
from slipd.samples import GripperSample

PERIOD_MS = 20
"""Public drivers use it, and older grippers can do no more than 7 ms."""
SHORTEST_MS, LONGEST_MS = 5, 200
"""Of a period: the first is twice what the gripper was seen to do, the last a fifth of what passes for silence."""
HOMING_NS = 30_000_000_000
"""A slow gripper needs some seconds for its whole stroke, there and back."""
_IDS = {
    "system": wire.SYSTEM,
    "limits": wire.LIMITS,
    "width": wire.WIDTH,
    "force": wire.FORCE,
    "grasping state": wire.GRASPING,
    "system state": wire.STATE,
}


class Session(PermittedSession):
    """Asks for the updates, and carries out permits, one command at a time.

    `state` is "closed", "waiting", "configuring", "inactive", "activating", "active", a fault, "no reply", "command
    lost" with the reason, or what the gripper refuses; the gripper's warnings follow "active". `identity` is its
    serial number. `wsg_states` lists what the gripper accepts in each state.

    Attributes:
        health: Its ``lost`` counts unanswered commands.

    ``echo_ok`` of a sample: the force limit was read back as it was set. Widths are the gripper's own: between its
    fingers, however thick the pads on them are. The largest force is the nominal one: whether more needs a setting of
    the gripper is not known.

    Args:
        period_ms: Time from one update to the next, 5 to 200 ms.

    Raises:
        ValueError: The period is out of range or no integer.
    """

    def __init__(self, period_ms: int = PERIOD_MS) -> None:
        if not (isinstance(period_ms, int) and SHORTEST_MS <= period_ms <= LONGEST_MS):
            raise ValueError(f"period_ms must be an integer from {SHORTEST_MS} to {LONGEST_MS}, got {period_ms!r}")
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._talk = Conversation(
            [
                Step("system", wire.encode(wire.SYSTEM), "optional"),
                Step("limits", wire.encode(wire.LIMITS)),
                *(Step(name, wire.update_request(_IDS[name], period_ms)) for name in list(_IDS)[2:]),
            ]
        )
        self._orders = WsgOrders(self.health)
        self._reset(State.CLOSED)

    def _reset(self, state: State) -> None:
        self.decoder.forget()
        self._orders.reset()
        self._machine = StateMachine(TRANSITIONS, state)
        self.identity = ""
        self._limits: Limits | None = None
        self._fault = ""  # in the last reading
        self._width_m = 0.0
        self._reported: Event | None = None  # by the last reading, unless it came while homing
        self._homing_until_ns = 0

    @property
    def command_lost(self) -> bool:
        """The last command was refused, never acknowledged, or met a gripper that could not obey any more."""
        return bool(self._orders.trouble)

    @property
    def state(self) -> str:
        """The state in a word, for people."""
        state = self._machine.state
        if state in (State.CLOSED, State.WAITING):
            return self._talk.state
        if state is State.SILENT:
            return "no reply"
        if self.command_lost:
            return f"command lost: {self._orders.trouble}"
        if self.activating:
            return "activating"
        if state is not State.ACTIVE:
            return self._fault if state is State.FAULTY else "inactive"
        notices = [word for word in wire.NOTICES if word in self.decoder.words]
        return "active" + (f" ({', '.join(notices)})" if notices else "")

    @property
    def activating(self) -> bool:
        """Whether homing is queued or under way."""
        return self._machine.state in ACTIVATION

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Least and largest width; (0, inf) until the gripper reports them."""
        return (0.0, math.inf) if self._limits is None else (0.0, self._limits.stroke_mm / 1000)

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Least and largest speed; None until the gripper reports them."""
        if self._limits is None:
            return None
        return self._limits.min_speed / 1000, self._limits.max_speed / 1000

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Least and nominal force, N on one pad; (0, inf) until the gripper reports them."""
        if self._limits is None:
            return 0.0, math.inf
        return self._limits.min_force / FINGERS, self._limits.nominal_force / FINGERS

    @property
    def force_sent_n(self) -> float | None:
        """The force limit last sent or queued, N on one pad; None where there is none since the activation."""
        limit = self._orders.force
        return None if limit is None else limit / FINGERS

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: the force limit has no steps."""
        return force_n

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link. Nothing moves."""
        self._reset(State.WAITING)
        self._talk.start(now_ns)
        return self.on_time(now_ns)

    def stop(self) -> bytes:
        """End with a goodbye, because the gripper takes a broken connection for a fault. It keeps what it holds."""
        self._reset(State.CLOSED)
        self._talk.stop()
        return wire.encode(wire.DISCONNECT)

    def drop(self) -> bool:
        """Drop what is not sent yet, except a stop; do not repeat what is unanswered."""
        dropped = self._orders.forget()
        self._follow_homing()
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge a fault where the gripper reports one."""
        self._orders.trouble = ""
        if self._fault:
            self._orders.acknowledge()

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        samples = []
        for reply in self.decoder.replies(data):
            self._take_reply(reply, now_ns)
            sample = self.decoder.take(reply, now_ns)
            if sample is not None:
                self._take_sample(sample, now_ns)
                samples.append(sample)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        due = [self._talk.due_ns]
        if self._talk.state == "running":
            due += [self._orders.due_ns, self._homing_until_ns if self.activating else None]
        return min((time_ns for time_ns in due if time_ns is not None), default=None)

    def on_time(self, now_ns: int) -> bytes:
        """Return the question or command that is due at ``now_ns``; empty when none is."""
        asked = self._talk.on_time(now_ns)
        if self._talk.state != "running":
            self._lose_all()
            return asked
        if self.activating and now_ns >= self._homing_until_ns:
            self._orders.give_up(f"no end of {HOME.name}")
            self._machine.handle(Event.HOMING_ENDED)
        command = self._orders.on_time(now_ns)
        self._follow_homing()
        return asked + command

    def _activate(self, now_ns: int) -> bool:
        """Ask for homing, behind the acknowledgement of a fault where there is one."""
        if not self._machine.handle(Event.ACTIVATE):
            return False
        self._orders.home(faulty=bool(self._fault))
        self._homing_until_ns = now_ns + HOMING_NS
        return True

    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        """Ask for a width, at half of the largest speed where none is given."""
        limits = self._limits
        if limits is None or not self._machine.takes(Event.MOVE):
            return False
        speed_mmps = limits.max_speed / 2 if speed_mps is None else _within(speed_mps, self.speed_range_mps, "speed")
        goal = _within(width_m, self.width_range_m, "width"), speed_mmps
        self._machine.handle(Event.MOVE)
        self._orders.move(limits, goal, force_n)
        return True

    def _set_force(self, force_n: float) -> bool:
        """Ask for another force; what a move has gripped is clamped anew with it, and nothing opens."""
        limits = self._limits
        if limits is None or not self._machine.handle(Event.SET_FORCE):
            return False
        self._orders.set_force(limits, force_n, self._width_m)
        return True

    def _halt(self) -> bool:
        if not self._machine.handle(Event.HALT):
            return False
        self._orders.stop()
        self._recall()
        return True

    def _recall(self) -> None:
        """Let the last reading count again: homing was taken back before it was sent."""
        if self._reported is not None:
            self._machine.handle(self._reported)

    def _follow_homing(self) -> None:
        """Update the state with the outcome of queued homing."""
        if self._machine.state not in QUEUED or self._orders.home_waits:
            return
        if self._orders.home_is_sent:
            self._reported = None
            self._machine.handle(Event.HOMING_SENT)
        else:
            self._machine.handle(Event.HOMING_DROPPED)
            self._recall()

    def _take_reply(self, reply: Reply, now_ns: int) -> None:
        asked = self._talk.asked
        if asked and reply.id == _IDS[asked]:
            well = reply.status == wire.OK
            self._talk.answered(now_ns, "" if well else f"refused {asked}: {weiss.status_word(reply.status)}")
            if reply.status == wire.OK:
                self._learn(reply)
            return
        if self._orders.take_answer(reply, now_ns):
            self._follow_homing()
        else:
            self._orders.take_end(reply)
        if reply.id == wire.HOME and reply.status != wire.PENDING:
            self._machine.handle(Event.HOMING_ENDED)

    def _learn(self, reply: Reply) -> None:
        if reply.id == wire.LIMITS:
            self._limits = wire.parse_limits(reply.data)
        elif reply.id == wire.SYSTEM:
            self.identity = f"S/N {wire.parse_serial(reply.data)}"

    def _take_sample(self, sample: GripperSample, now_ns: int) -> None:
        self._talk.has_reading(now_ns)
        referenced, fault = sample.active, sample.fault
        if self._talk.state == "running":
            self._fault, self._width_m = fault, sample.width_m or 0.0
            if self._machine.state not in UNDER_WAY:
                self._reported = _report(referenced=referenced, fault=fault)
                self._machine.handle(self._reported)
        sample.active = referenced and not self.activating
        sample.echo_ok = self._orders.echo_ok
        if not referenced:
            self._orders.void()
        if fault or not referenced:
            self._orders.lose_grip(fault or "not referenced")
            self._follow_homing()

    def _lose_all(self) -> None:
        """Drop what was asked for: the gripper does not answer, or is asked anew what it is."""
        if self._orders.due_ns is not None or self.activating:
            self._orders.give_up("no reply")
        self._fault, self._reported = "", None
        self._machine.handle(Event.FELL_SILENT)


def _report(*, referenced: bool, fault: str) -> Event:
    if not referenced:
        return Event.REPORTED_INACTIVE
    return Event.REPORTED_FAULT if fault else Event.REPORTED_ACTIVE


def _within(value: float, bounds: tuple[float, float] | None, name: str) -> float:
    """Return thousandths of a value that lies within its bounds."""
    low, high = bounds or (0.0, 0.0)
    if not low <= value <= high:  # also where it is no number
        raise ValueError(f"the {name} must be from {low:g} to {high:g}, got {value}")
    return value * 1000
