"""Session with a WSG gripper: permits become commands, one at a time, and updates become samples."""

from __future__ import annotations

import math

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.gripper_session import Event, GripperSessionBase, State, StateMachine, check_range
from slipd.devices.shared.sensor_session import StartupSequence, Step
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_commands import (
    ACTIVATION,
    HOME,
    IN_PROGRESS,
    QUEUED,
    TRANSITIONS,
    WsgCommandQueue,
    report_of,
)
from slipd.devices.wsg.wsg_decoder import Decoder, Reply
from slipd.devices.wsg.wsg_messages import FINGERS, Limits
from slipd.types.samples import GripperSample

PERIOD_MS = 20
"""Period of the public drivers; the shortest one observed, on an older gripper, is 7 ms."""
SHORTEST_MS, LONGEST_MS = 5, 200
"""Shortest and longest period that can be configured; the longest is a fifth of the time that counts as silence."""
HOMING_NS = 30_000_000_000
"""Time allowed for homing; a slow gripper needs some seconds for its whole stroke and back."""

_IDS = {
    "system": wire.SYSTEM,
    "limits": wire.LIMITS,
    "overdrive": wire.OVERDRIVE,
    "width": wire.WIDTH,
    "force": wire.FORCE,
    "grasping state": wire.GRASPING,
    "system state": wire.STATE,
}


class Session(GripperSessionBase[WsgCommandQueue]):
    """Request updates, and carry out permits, one command at a time.

    `state` is "closed", "waiting", "configuring", "inactive", "activating", "active", a fault, "no reply", "command
    lost" with the reason, or the request that the gripper refuses; "active" is followed by the gripper's warnings.
    `identity` is its serial number. `wsg_commands` lists what the gripper accepts in each state.

    ``echo_ok`` of a sample is whether the force limit was read back as it was set. Widths are between the gripper's
    own fingers, without pads. The largest force is the nominal one, or with ``overdrive`` the overdrive force.

    Attributes:
        health: Its ``lost`` counts unanswered commands.

    Args:
        period_ms: Time from one update to the next, 5 to 200 ms.
        overdrive: Whether to allow forces above the gripper's nominal one, which wears it more.

    Raises:
        ValueError: The period is out of range or not an integer.
    """

    _activation = ACTIVATION

    def __init__(self, period_ms: int = PERIOD_MS, overdrive: bool = False) -> None:
        check_integer("period_ms", period_ms, SHORTEST_MS, LONGEST_MS)
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._overdrive = overdrive
        self._startup = StartupSequence(
            [
                Step("system", wire.encode(wire.SYSTEM), "optional"),
                Step("limits", wire.encode(wire.LIMITS)),
                *([Step("overdrive", wire.overdrive())] if overdrive else []),
                *(Step(name, wire.update_request(_IDS[name], period_ms)) for name in list(_IDS)[3:]),
            ]
        )
        self._queue = WsgCommandQueue(self.health)
        self._reset(State.CLOSED)

    def _reset(self, state: State) -> None:
        self.decoder.forget()
        self._queue.reset()
        self._machine = StateMachine(TRANSITIONS, state)
        self.identity = ""
        self._limits: Limits | None = None
        self._fault = ""  # in the last reading
        self._width_m = 0.0
        self._reported: Event | None = None  # by the last reading, except during homing
        self._homing_until_ns = 0

    @property
    def command_lost(self) -> bool:
        """Whether the last command was refused, was never acknowledged, or reached a gripper that could not obey."""
        return bool(self._queue.failure)

    @property
    def state(self) -> str:
        """State of the gripper, as a short text for people."""
        state = self._machine.state
        if state in (State.CLOSED, State.WAITING):
            return self._startup.state
        if state is State.SILENT:
            return "no reply"
        if self.command_lost:
            return f"command lost: {self._queue.failure}"
        if self.activating:
            return "activating"
        if state is not State.ACTIVE:
            return self._fault if state is State.FAULTY else "inactive"
        notices = [word for word in wire.NOTICES if word in self.decoder.words]
        return "active" + (f" ({', '.join(notices)})" if notices else "")

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Smallest and largest width, m; (0, inf) until the gripper reports them."""
        return (0.0, math.inf) if self._limits is None else (0.0, self._limits.stroke_mm / 1000)

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Smallest and largest speed, m/s; None until the gripper reports them."""
        if self._limits is None:
            return None
        return self._limits.min_speed / 1000, self._limits.max_speed / 1000

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Smallest and largest force, N on one pad; (0, inf) until the gripper reports them."""
        if self._limits is None:
            return 0.0, math.inf
        return self._limits.min_force / FINGERS, self._limits.most_force(overdrive=self._overdrive) / FINGERS

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: the force limit has no steps."""
        return force_n

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link. Nothing moves."""
        self._reset(State.WAITING)
        self._startup.start(now_ns)
        return self.on_time(now_ns)

    def stop(self) -> bytes:
        """End with a disconnect, because a broken connection is a fault to the gripper. It keeps what it holds."""
        self._reset(State.CLOSED)
        self._startup.stop()
        return wire.encode(wire.DISCONNECT)

    def drop(self) -> bool:
        """Drop commands that are not sent yet, except a stop; do not repeat unanswered ones."""
        dropped = self._queue.drop_unsent()
        self._follow_homing()
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge a fault if the gripper reports one."""
        self._queue.failure = ""
        if self._fault:
            self._queue.acknowledge()

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        samples = []
        for reply in self.decoder.replies(data):
            self._handle_reply(reply, now_ns)
            sample = self.decoder.decode_reply(reply, now_ns)
            if sample is not None:
                self._handle_sample(sample, now_ns)
                samples.append(sample)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        due = [self._startup.due_ns]
        if self._startup.state == "running":
            due += [self._queue.due_ns, self._homing_until_ns if self.activating else None]
        return min((time_ns for time_ns in due if time_ns is not None), default=None)

    def on_time(self, now_ns: int) -> bytes:
        """Return the request or command that is due at ``now_ns``; empty if none is."""
        request = self._startup.on_time(now_ns)
        if self._startup.state != "running":
            self._fall_silent()
            return request
        if self.activating and now_ns >= self._homing_until_ns:
            self._queue.give_up(f"no end of {HOME.name}")
            self._machine.handle(Event.ACTIVATION_ENDED)
        command = self._queue.on_time(now_ns)
        self._follow_homing()
        return request + command

    def _on_one_pad(self, force: float | None) -> float | None:
        return None if force is None else force / FINGERS

    def _activate(self, now_ns: int) -> bool:
        """Queue homing, after the acknowledgement of a fault if there is one."""
        if not self._machine.handle(Event.ACTIVATE):
            return False
        self._queue.home(faulty=bool(self._fault))
        self._homing_until_ns = now_ns + HOMING_NS
        return True

    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        """Queue a move, at half of the largest speed if none is given."""
        limits = self._limits
        if limits is None or not self._machine.accepts(Event.MOVE):
            return False
        if speed_mps is not None:
            check_range("speed", speed_mps, self.speed_range_mps or (0.0, 0.0), "m/s")
        check_range("width", width_m, self.width_range_m, "m")
        speed_mmps = limits.max_speed / 2 if speed_mps is None else speed_mps * 1000
        self._machine.handle(Event.MOVE)
        self._queue.move((width_m * 1000, speed_mmps), self._force(force_n))
        return True

    def _set_force(self, force_n: float) -> bool:
        """Queue another force; an object gripped by a move is clamped again with it, and nothing opens."""
        if self._limits is None or not self._machine.handle(Event.SET_FORCE):
            return False
        self._queue.set_force(self._force(force_n), self._width_m)
        return True

    def _force(self, force_n: float) -> float:
        """Return the force limit, N of both fingers, for a force on one pad."""
        least_n, most_n = self.force_range_n
        return wire.at_most(min(max(force_n, least_n), most_n) * FINGERS)

    def _halt(self) -> bool:
        if not self._machine.handle(Event.HALT):
            return False
        self._queue.stop()
        self._repeat_report()
        return True

    def _repeat_report(self) -> None:
        """Handle the last report again, because homing was dropped before it was sent."""
        if self._reported is not None:
            self._machine.handle(self._reported)

    def _follow_homing(self) -> None:
        """Update the state with the outcome of queued homing."""
        if self._machine.state not in QUEUED or self._queue.homing_waits:
            return
        if self._queue.homing_is_sent:
            self._reported = None
            self._machine.handle(Event.ACTIVATION_SENT)
        else:
            self._machine.handle(Event.ACTIVATION_DROPPED)
            self._repeat_report()

    def _handle_reply(self, reply: Reply, now_ns: int) -> None:
        awaited = self._startup.awaited
        if awaited and reply.id == _IDS[awaited]:
            succeeded = reply.status == wire.OK
            error = "" if succeeded else f"refused {awaited}: {weiss.status_word(reply.status)}"
            self._startup.handle_answer(now_ns, error)
            if succeeded:
                self._handle_info(reply)
            return
        if self._queue.match_answer(reply, now_ns):
            self._follow_homing()
        else:
            self._queue.handle_motion_end(reply)
        if reply.id == wire.HOME and reply.status != wire.PENDING:
            self._machine.handle(Event.ACTIVATION_ENDED)

    def _handle_info(self, reply: Reply) -> None:
        if reply.id == wire.LIMITS:
            self._limits = wire.parse_limits(reply.data)
        elif reply.id == wire.SYSTEM:
            self.identity = f"S/N {wire.parse_serial(reply.data)}"

    def _handle_sample(self, sample: GripperSample, now_ns: int) -> None:
        self._startup.reading_received(now_ns)
        referenced, fault = sample.active, sample.fault
        if self._startup.state == "running":
            self._fault, self._width_m = fault, sample.width_m or 0.0
            if self._machine.state not in IN_PROGRESS:
                self._reported = report_of(referenced=referenced, fault=fault)
                self._machine.handle(self._reported)
        sample.active = referenced and not self.activating
        sample.echo_ok = self._queue.echo_ok
        if not referenced:
            self._queue.forget_force()
        if fault or not referenced:
            self._queue.drop_grip(fault or "not referenced")
            self._follow_homing()

    def _fall_silent(self) -> None:
        """Drop all commands, because the gripper does not answer or is being configured again."""
        if self._queue.due_ns is not None or self.activating:
            self._queue.give_up("no reply")
        self._fault, self._reported = "", None
        self._machine.handle(Event.FELL_SILENT)
