"""Weiss and Schunk WSG grippers over TCP, in their binary command protocol.

The gripper sends width, force and state by itself, and answers one command at a time. Nothing moves but on request.
A grip is a pre-position to a width narrower than the part, which clamps what blocks the way: unlike the gripper's own
"grasp" it may be given again while something is held, it never gives up by itself, and it opens only where a wider
goal than the present width is asked for. The force is changed by setting the limit and giving the goal of the grip
again; where that is not known, as behind a stop, by setting the limit alone.
"""

from __future__ import annotations

import math

from slipd.devices import Device, GripRange, weiss
from slipd.devices import wsg_messages as wire
from slipd.devices.commands import Command, Commands
from slipd.devices.conversation import Conversation, Step
from slipd.devices.health import DecoderHealth
from slipd.devices.wsg_messages import FINGERS, Limits, Reply
from slipd.samples import GripperSample

PERIOD_MS = 20
"""Public drivers use it, and older grippers can do no more than 7 ms."""
SHORTEST_MS, LONGEST_MS = 5, 200
"""Of a period: the first is twice what the gripper was seen to do, the last a fifth of what passes for silence."""
ANSWER_NS = 250_000_000
"""For the answer to a command: older grippers take 70 ms."""
HOMING_NS = 30_000_000_000
"""A slow gripper needs some seconds for its whole stroke, there and back."""
ECHO_TOLERANCE_N = 0.01
"""Of the force limit: it is told and read back in the same format."""

_NO_FORCE = (0.0, math.inf)
_IDS = {
    "system": wire.SYSTEM,
    "limits": wire.LIMITS,
    "width": wire.WIDTH,
    "force": wire.FORCE,
    "grasping state": wire.GRASPING,
    "system state": wire.STATE,
}


class Decoder:
    """Makes a gripper sample of each system state and of the width, force and grasping state that came since the last.

    The gripper sends the four one by one, each at the same period. Where one is missing there is no sample.
    ``active`` means referenced; ``echo_ok`` is None: the updates do not say what was requested. `Session` knows.
    ``force_n`` is half of what the gripper says, which is the sum of both fingers.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.words: frozenset[str] = frozenset()
        self._scanner = wire.Replies(self.health)
        self._round: dict[int, bytes] = {}

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        samples = (self.take(reply, t_ns) for reply in self.replies(data))
        return [sample for sample in samples if sample is not None]

    def forget(self) -> None:
        """Drop what has begun: the line was closed."""
        self._scanner.forget()
        self._round.clear()

    def replies(self, data: bytes) -> list[Reply]:
        """Take bytes and return every reply they complete; `take` makes samples of them."""
        return self._scanner.replies(data)

    def take(self, reply: Reply, t_ns: int) -> GripperSample | None:
        """Take a reply, received at ``t_ns``; return the sample whose last part it is."""
        if reply.id not in wire.UPDATES or reply.status != wire.OK:
            return None
        if reply.id != wire.STATE:
            if reply.id in self._round:  # the state between was damaged: what came before it is not mixed with this
                self._round.clear()
            self._round[reply.id] = reply.data
            return None
        told, self._round = self._round, {}
        if len(told) < len(wire.UPDATES) - 1:
            return None
        self.health.good += 1
        self.words = wire.parse_state(reply.data)
        return GripperSample(
            t_ns=t_ns,
            device_time_ns=None,
            active="referenced" in self.words,
            width_m=wire.parse_number(told[wire.WIDTH]) / 1000,
            moving="moving" in self.words,
            object=_object(self.words, wire.GRASPING_STATES[told[wire.GRASPING][0]]),
            fault=next((fault for fault in wire.FAULTS if fault in self.words), ""),
            echo_ok=None,
            force_n=wire.parse_number(told[wire.FORCE]) / FINGERS,
        )


def _object(words: frozenset[str], grasping: str) -> str:
    if "blocked_minus" in words or grasping == "holding":
        return "contact_closing"
    if "blocked_plus" in words:
        return "contact_opening"
    return "moving" if "moving" in words else "none"


_SETS = (wire.SET_FORCE, wire.PREPOSITION)
_HOME = Command("homing", wire.HOME, wire.home(), renews=True)
_STOP = Command("stop", wire.STOP, wire.encode(wire.STOP))
_ACKNOWLEDGE = Command("acknowledgement", wire.ACKNOWLEDGE, wire.acknowledge())
_READ_BACK = Command("force limit", wire.GET_FORCE, wire.encode(wire.GET_FORCE))
_WELL = {
    wire.PREPOSITION: (wire.OK, wire.PENDING, wire.ABORTED, wire.AXIS_BLOCKED),
    wire.HOME: (wire.OK, wire.PENDING),
}
"""Of motions: a newer one aborts the older, and what blocks the way is what was to be clamped."""


class Session:
    """Asks for the updates, and sends what is asked for, one command at a time.

    `state` is "closed", "waiting", "configuring", "inactive", "activating", "active", a fault, "no reply", "command
    lost" with the reason, or what the gripper refuses; behind "active" stand the gripper's warnings. `identity` is its
    serial number.

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
            raise ValueError(f"period_ms {period_ms!r} is none: an integer from {SHORTEST_MS} to {LONGEST_MS} is")
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._talk = Conversation(
            [
                Step("system", wire.encode(wire.SYSTEM), "optional"),
                Step("limits", wire.encode(wire.LIMITS)),
                *(Step(name, wire.update_request(_IDS[name], period_ms)) for name in list(_IDS)[2:]),
            ]
        )
        self._commands = Commands(ANSWER_NS, self.health)
        self._reset()

    def _reset(self) -> None:
        self.decoder.forget()
        self._commands.reset()
        self.identity = ""
        self._limits: Limits | None = None
        self._sample: GripperSample | None = None
        self._ran = False
        self._homing_until_ns: int | None = None
        self._goal: tuple[float, float] | None = None  # mm, mm/s
        self._told = 0.0  # force limit, N of both fingers
        self._echo_ok: bool | None = None

    @property
    def command_lost(self) -> bool:
        """The last command was refused, never acknowledged, or met a gripper that could not obey any more."""
        return bool(self._commands.trouble)

    @property
    def state(self) -> str:
        """A short word for people."""
        if self._talk.state != "running":
            return "no reply" if self._ran and self._talk.state != "closed" else self._talk.state
        if self.command_lost:
            return f"command lost: {self._commands.trouble}"
        if self._homing_until_ns is not None:
            return "activating"
        if self._sample is None or not self._sample.active:
            return "inactive"
        if self._sample.fault:
            return self._sample.fault
        notices = [word for word in wire.NOTICES if word in self.decoder.words]
        return "active" + (f" ({', '.join(notices)})" if notices else "")

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Least and largest width; (0, inf) while the gripper has not told."""
        return (0.0, math.inf) if self._limits is None else (0.0, self._limits.stroke_mm / 1000)

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Least and largest speed; None while the gripper has not told."""
        if self._limits is None:
            return None
        return self._limits.min_speed / 1000, self._limits.max_speed / 1000

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Least and nominal force, N on one pad; (0, inf) while the gripper has not told."""
        if self._limits is None:
            return _NO_FORCE
        return self._limits.min_force / FINGERS, self._limits.nominal_force / FINGERS

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link. Nothing moves."""
        self._reset()
        self._talk.start(now_ns)
        return self.on_time(now_ns)

    def stop(self) -> bytes:
        """End, and say so: a connection that merely breaks is a fault to the gripper. It keeps what it holds."""
        self._reset()
        self._talk.stop()
        return wire.encode(wire.DISCONNECT)

    @property
    def force_told_n(self) -> float | None:
        """The force limit that was set last or waits, N on one pad; None where there was none while active."""
        limit = self._commands.force
        return None if limit is None else limit / FINGERS

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: what is asked for is told as it is."""
        return force_n

    def activate(self, now_ns: int) -> None:
        """Ask for the acknowledgement of a fault where there is one, and for homing, which moves the fingers fully."""
        faulty = self._sample is not None and self._sample.fault
        self._commands.replace([_ACKNOWLEDGE, _HOME] if faulty else [_HOME])
        self._goal = None
        self._homing_until_ns = now_ns + HOMING_NS

    def move(self, width_m: float, speed_mps: float | None, force_n: float) -> float | None:
        """Ask for a width, with a speed (None: half of the largest) and a force, N on one pad.

        Returns:
            The force that the gripper is told, never above ``force_n`` but for its least; None, and nothing will be
            sent, where it is not referenced or reports a fault.

        Raises:
            ValueError: The gripper has no such width or speed, or the force is no number.
        """
        _check_finite("force", force_n)
        limits = self._limits
        if limits is None or not self._able:
            return None
        speed_mmps = limits.max_speed / 2 if speed_mps is None else _within(speed_mps, self.speed_range_mps, "speed")
        self._goal = _within(width_m, self.width_range_m, "width"), speed_mmps
        return self._grip(limits, force_n, self._goal)

    def set_force(self, force_n: float) -> float | None:
        """Ask for another force; what a move has gripped is clamped anew with it, and nothing opens. See `move`."""
        _check_finite("force", force_n)
        limits = self._limits
        if limits is None or not self._able:
            return None
        if self.command_lost:
            self._goal = None  # what may never have begun does not begin now
        return self._grip(limits, force_n, self._goal_again())

    def halt(self) -> bool:
        """Ask the fingers to stop where they are, before all else; False where the gripper is not referenced."""
        homing, sample = self._homing_until_ns is not None, self._sample
        if not homing and (sample is None or not sample.active):
            return False
        self._goal = None
        self._homing_until_ns = None
        self._commands.interrupt(_STOP)
        return True

    def drop(self) -> bool:
        """Forget what was not sent yet but for a stop; what is unanswered is not repeated."""
        if _HOME in self._commands.waiting:
            self._homing_until_ns = None
        dropped = self._commands.drop((wire.STOP,))
        if dropped:
            self._goal = None
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge a fault where the gripper reports one."""
        self._commands.trouble = ""
        if self._sample is not None and self._sample.fault:
            self._commands.replace([_ACKNOWLEDGE], keep=(_STOP, _HOME))

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        samples = []
        for reply in self.decoder.replies(data):
            self._take_reply(reply, now_ns)
            sample = self.decoder.take(reply, now_ns)
            if sample is not None:
                self._note(sample, now_ns)
                samples.append(sample)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        due = [self._talk.due_ns]
        if self._talk.state == "running":
            due += [self._commands.due_ns, self._homing_until_ns]
        return min((time_ns for time_ns in due if time_ns is not None), default=None)

    def on_time(self, now_ns: int) -> bytes:
        """Return the question or command that is due at ``now_ns``; empty when none is."""
        asked = self._talk.on_time(now_ns)
        if self._talk.state != "running":
            self._lose_all()
            return asked
        if self._homing_until_ns is not None and now_ns >= self._homing_until_ns:
            self._give_up(f"no end of {_HOME.name}")
        return asked + self._commands.on_time(now_ns)

    @property
    def _able(self) -> bool:
        """Whether the gripper takes motions now."""
        sample = self._sample
        homing = self._homing_until_ns is not None
        return (
            sample is not None and sample.active and not sample.fault and not homing and self._talk.state == "running"
        )

    def _goal_again(self) -> tuple[float, float] | None:
        """Return the goal that a change of force gives again: of a move that still waits, or one that closes."""
        if self._goal is None or self._sample is None or self._sample.width_m is None:
            return None
        waits = any(command.kind == wire.PREPOSITION for command in self._commands.waiting)
        return self._goal if waits or self._goal[0] <= self._sample.width_m * 1000 else None

    def _grip(self, limits: Limits, force_n: float, goal: tuple[float, float] | None) -> float:
        force = wire.at_most(min(max(force_n * FINGERS, limits.min_force), limits.nominal_force))
        commands = [Command("force limit", wire.SET_FORCE, wire.set_force(force), force)]
        if goal is not None:
            commands.append(Command("pre-position", wire.PREPOSITION, wire.preposition(*goal)))
        self._commands.replace([*commands, _READ_BACK], keep=(_STOP,))
        return force / FINGERS

    def _take_reply(self, reply: Reply, now_ns: int) -> None:
        asked = self._talk.asked
        if asked and reply.id == _IDS[asked]:
            well = reply.status == wire.OK
            self._talk.answered(now_ns, "" if well else f"refused {asked}: {weiss.status_word(reply.status)}")
            if reply.status == wire.OK:
                self._learn(reply)
            return
        command = self._commands.outstanding
        if command is not None and reply.id == command.kind and not _is_of_another(reply):
            self._take_answer(command, reply, now_ns)
        elif reply.id in _WELL:
            self._end_motion(reply)

    def _learn(self, reply: Reply) -> None:
        if reply.id == wire.LIMITS:
            self._limits = wire.parse_limits(reply.data)
        elif reply.id == wire.SYSTEM:
            self.identity = f"S/N {wire.parse_serial(reply.data)}"

    def _take_answer(self, command: Command, reply: Reply, now_ns: int) -> None:
        well = reply.status in _WELL.get(reply.id, (wire.OK,))
        self._commands.answered(now_ns, "" if well else f"{command.name}: {weiss.status_word(reply.status)}")
        if reply.id == wire.HOME:
            self._end_motion(reply)
        elif well and reply.id == wire.SET_FORCE:
            self._told = command.force or 0.0
        elif well and reply.id == wire.GET_FORCE:
            self._echo_ok = abs(wire.parse_number(reply.data) - self._told) <= ECHO_TOLERANCE_N

    def _end_motion(self, reply: Reply) -> None:
        """Take the last word about a motion, which comes when it ended."""
        if reply.id == wire.HOME and reply.status != wire.PENDING:
            self._homing_until_ns = None
        if reply.status not in _WELL[reply.id]:
            name = "homing" if reply.id == wire.HOME else "pre-position"
            self._commands.trouble = f"{name}: {weiss.status_word(reply.status)}"

    def _note(self, sample: GripperSample, now_ns: int) -> None:
        self._talk.has_reading(now_ns)
        self._ran = True
        sample.active = sample.active and self._homing_until_ns is None
        sample.echo_ok = self._echo_ok
        self._sample = sample
        if not sample.active:
            self._commands.void()
        elif not sample.fault:
            return
        self._goal = None  # what was under way is not taken up again behind the back of whoever mends it
        if self._commands.holds(_SETS):
            self._commands.give_up(sample.fault or "not referenced")

    def _give_up(self, trouble: str) -> None:
        self._commands.give_up(trouble)
        self._homing_until_ns = None

    def _lose_all(self) -> None:
        """Drop what was asked for: the gripper does not answer, or is asked anew what it is."""
        if self._commands.due_ns is not None or self._homing_until_ns is not None:
            self._give_up("no reply")
        self._sample = None


def _is_of_another(reply: Reply) -> bool:
    """Say whether a reply ends an older motion that a newer one of its kind has aborted."""
    return reply.id == wire.PREPOSITION and reply.status == wire.ABORTED


def _check_finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise ValueError(f"a {name} of {value} cannot be asked for: a finite one can")


def _within(value: float, bounds: tuple[float, float] | None, name: str) -> float:
    """Return thousandths of a value that lies within its bounds."""
    low, high = bounds or (0.0, 0.0)
    if not low <= value <= high:  # also where it is no number
        raise ValueError(f"a {name} of {value} cannot be asked for: {low:g} to {high:g} can")
    return value * 1000


GRIP = GripRange(force_n=60.0, stroke_m=0.210, speed_mps=0.420)
"""Half of the 120 N that a WSG 50 grips with in overdrive, which is what one pad feels; stroke of a WSG 50-210."""

DEVICE = Device(
    "wsg",
    "gripper",
    ("tcp",),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_MS, 1000.0 / SHORTEST_MS),
    grip=GRIP,
)
