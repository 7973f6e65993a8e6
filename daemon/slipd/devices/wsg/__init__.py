"""Weiss and Schunk WSG grippers over TCP, in their binary command protocol.

The gripper sends width, force and state periodically, and answers one command at a time. Nothing moves without a
permit. A grip is a pre-position to a width narrower than the part, which clamps what blocks the way. Unlike the
gripper's own "grasp", it may be repeated while something is held, it never ends by itself, and it opens only if the
goal is wider than the present width. To change the force, the session sets the limit and repeats the goal of the grip;
if the goal is unknown, as after a stop, it sets only the limit.
"""

from __future__ import annotations

from slipd.devices import Device, GripRange, RateOption
from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.frame_scanner import FrameDecoder
from slipd.devices.shared.gripper_session import QueuedGripperSession
from slipd.devices.shared.gripper_states import Event, State, report_of
from slipd.devices.shared.sensor_session import StartupSequence, Step
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_commands import (
    ACTIVATION,
    ANSWER_NS,
    HOME,
    IN_PROGRESS,
    TRANSITIONS,
    WsgCommandQueue,
)
from slipd.devices.wsg.wsg_messages import FINGERS, Reply
from slipd.types.samples import GripperSample

__all__ = ["DEVICE", "Decoder", "Session"]

PERIOD_MS = 20
"""Period of the public drivers; the shortest one observed, on an older gripper, is 7 ms."""
SHORTEST_MS, LONGEST_MS = 5, 200
"""Shortest and longest period that can be configured; the longest is a fifth of the time that counts as silence."""
HOMING_NS = 30_000_000_000
"""Time allowed for homing; a slow gripper needs some seconds for its whole stroke and back."""

_TYPICAL_BYTES = 14
_UPDATES = {wire.WIDTH: "width", wire.FORCE: "force", wire.GRASPING: "grasping state", wire.STATE: "system state"}
_NEWEST = 2 * len(wire.UPDATES)
"""An update counts for as long as it is one of this many newest: in any order, those of two periods."""


class Decoder(FrameDecoder):
    """Return a gripper sample of each system state, with the newest width, force and grasping state.

    The gripper sends the four one by one, each at the same period, but in no fixed order: the Robotics Library
    (roboticslibrary/rl at 91df9f2, ``src/rl/hal/WeissWsg50.cpp``, ``recv`` and ``step``) keeps the newest of each too.
    If one is missing for longer than a period there is no sample. ``active`` means referenced. ``echo_ok`` is None,
    because the updates do not contain the requests; `Session` sets it. ``force_n`` is half of the force that the
    gripper sends, which is the sum of both fingers.
    """

    _frames: PacketScanner

    def __init__(self) -> None:
        super().__init__()
        self.words: frozenset[str] = frozenset()
        self._frames = PacketScanner(SEED_WITH_PREAMBLE, wire.is_reply, _TYPICAL_BYTES, self.health)
        self._newest: dict[int, tuple[int, bytes]] = {}  # by id: number and data of the update
        self._count = 0  # of updates

    def _readings(self, data: bytes, t_ns: int) -> list[GripperSample]:
        samples = (self.decode_reply(reply, t_ns) for reply in self.messages(data))
        return [sample for sample in samples if sample is not None]

    def forget(self) -> None:
        """Drop a partial reading, because the line was closed."""
        super().forget()
        self._newest.clear()

    def messages(self, data: bytes) -> list[Reply]:
        """Scan bytes; return every reply they complete, for `decode_reply`."""
        return [
            Reply(
                packet.id,
                int.from_bytes(packet.payload[: wire.STATUS_LENGTH], "little"),
                packet.payload[wire.STATUS_LENGTH :],
            )
            for packet in self._frames.packets(data)
        ]

    def decode_reply(self, reply: Reply, t_ns: int) -> GripperSample | None:
        """Decode a reply received at ``t_ns``; return the sample that it completes, if any."""
        if reply.id not in wire.UPDATES or reply.status != wire.OK:
            return None
        self._count += 1
        self._newest[reply.id] = self._count, reply.data
        if reply.id != wire.STATE:
            return None
        parts = {update: data for update, (number, data) in self._newest.items() if self._count - number < _NEWEST}
        if len(parts) < len(wire.UPDATES):
            return None
        self.words = wire.parse_state(reply.data)
        return GripperSample(
            t_ns=t_ns,
            device_time_ns=None,
            active="referenced" in self.words,
            width_m=wire.parse_number(parts[wire.WIDTH]) / 1000,
            moving="moving" in self.words,
            object=_object(self.words, wire.GRASPING_STATES[parts[wire.GRASPING][0]]),
            fault=next((fault for fault in wire.FAULTS if fault in self.words), ""),
            echo_ok=None,
            force_n=wire.parse_number(parts[wire.FORCE]) / FINGERS,
        )


def _object(words: frozenset[str], grasping: str) -> str:
    if "blocked_minus" in words or grasping == "holding":
        return "contact_closing"
    if "blocked_plus" in words:
        return "contact_opening"
    return "moving" if "moving" in words else "none"


class Session(QueuedGripperSession[WsgCommandQueue]):
    """Request updates, and carry out permits, one command at a time.

    `state` is that of the `StartupSequence` until it runs, then "inactive", "activating", "active" with the gripper's
    warnings, a fault, "no reply", or "command lost" with the reason. `identity` is its serial number. `TRANSITIONS`
    lists what the gripper accepts in each state.

    ``echo_ok`` of a sample is whether the force limit was read back as it was set. Widths are between the gripper's
    own fingers, without pads. The largest force is the nominal one, or with ``overdrive`` the overdrive force.
    `health.lost` counts unanswered commands.

    Args:
        period_ms: Time from one update to the next, 5 to 200 ms.
        overdrive: Whether to allow forces above the gripper's nominal one, which wears it more.

    Raises:
        ValueError: The period is out of range or not an integer.
    """

    _activation = ACTIVATION
    _table = TRANSITIONS

    def __init__(self, period_ms: int = PERIOD_MS, overdrive: bool = False) -> None:
        check_integer("period_ms", period_ms, SHORTEST_MS, LONGEST_MS)
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._overdrive = overdrive
        system, limits = wire.encode(wire.SYSTEM), wire.encode(wire.LIMITS)
        self._startup = StartupSequence(
            [
                Step("system", system, "optional", reply=wire.SYSTEM, handle=self._handle_system),
                Step("limits", limits, reply=wire.LIMITS, handle=self._handle_limits),
                *([Step("overdrive", wire.ALLOW_OVERDRIVE, reply=wire.OVERDRIVE)] if overdrive else []),
                *(Step(name, wire.update_request(id_, period_ms), reply=id_) for id_, name in _UPDATES.items()),
            ],
            wire.encode(wire.DISCONNECT),
        )
        self._queue = WsgCommandQueue(ANSWER_NS, self.health)
        self._reset(State.CLOSED)

    def _reset(self, state: State) -> None:
        super()._reset(state)
        self._homing_until_ns = 0

    @property
    def state(self) -> str:
        """State of the gripper, as a short text for people."""
        state = self._state
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

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link. Nothing moves."""
        self._reset(State.WAITING)
        return self._startup.start(now_ns)

    def stop(self) -> bytes:
        """End with a disconnect, because a broken connection is a fault to the gripper. It keeps what it holds."""
        self._reset(State.CLOSED)
        return self._startup.stop()

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        samples = []
        for reply in self.decoder.messages(data):
            self._handle_reply(reply, now_ns)
            sample = self.decoder.decode_reply(reply, now_ns)
            if sample is not None:
                self._handle_sample(sample, now_ns)
                samples.append(sample)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        due = [self._startup.next_deadline()]
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
            self._handle_event(Event.ACTIVATION_ENDED)
        command = self._queue.on_time(now_ns)
        self._follow_activation()
        if self._state in IN_PROGRESS:
            self._reported = None
        return request + command

    def _activate(self, now_ns: int) -> None:
        """Queue homing, after the acknowledgement of a fault if there is one."""
        self._queue.home(faulty=bool(self._fault))
        self._homing_until_ns = now_ns + HOMING_NS

    def _halt(self) -> bool:
        if not self._handle_event(Event.HALT):
            return False
        self._queue.stop()
        self._repeat_report()
        return True

    def _handle_reply(self, reply: Reply, now_ns: int) -> None:
        awaited = self._startup.awaited
        if awaited is not None and reply.id == awaited.reply:
            refusal = f"refused {awaited.name}: {weiss.status_word(reply.status)}"
            self._startup.handle_answer(now_ns, refusal if reply.status != wire.OK else awaited.handle(reply.data))
            return
        if self._queue.match_answer(reply, now_ns):
            self._follow_activation()
        else:
            self._queue.handle_motion_end(reply)
        if reply.id == wire.HOME and reply.status != wire.PENDING:
            self._handle_event(Event.ACTIVATION_ENDED)

    def _handle_limits(self, data: bytes) -> None:
        limits = wire.parse_limits(data)
        self._set_ranges(
            (0.0, limits.stroke_mm / 1000),
            (limits.min_force / FINGERS, limits.most_force(overdrive=self._overdrive) / FINGERS),
            (limits.min_speed / 1000, limits.max_speed / 1000),
        )
        self._queue.usual_speed_mps = limits.max_speed / 1000 / 2

    def _handle_system(self, data: bytes) -> None:
        self.identity = f"S/N {wire.SYSTEM_FIELDS.unpack(data)[3]}"

    def _handle_sample(self, sample: GripperSample, now_ns: int) -> None:
        self.health.good += 1
        self._startup.reading_received(now_ns)
        referenced, fault = sample.active, sample.fault
        if self._startup.state == "running":
            self._fault, self._queue.width_m = fault, sample.width_m or 0.0
            if self._state not in IN_PROGRESS:
                self._reported = report_of(active=referenced, fault=fault)
                self._handle_event(self._reported)
        sample.active = referenced and not self.activating
        sample.echo_ok = self._queue.echo_ok
        if not referenced:
            self._queue.forget_force()
        if fault or not referenced:
            self._queue.drop_grip(fault or "not referenced")
            self._follow_activation()

    def _fall_silent(self) -> None:
        """Drop all commands, because the gripper does not answer or is being configured again."""
        if self._queue.due_ns is not None or self.activating:
            self._queue.give_up("no reply")
        self._fault, self._reported = "", None
        self._handle_event(Event.FELL_SILENT)


DEVICE = Device(
    "wsg",
    "gripper",
    ("tcp",),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_MS, 1000.0 / SHORTEST_MS),
    grip=GripRange(force_n=60.0, stroke_m=0.210, speed_mps=0.420),  # half of a WSG 50 in overdrive; of a WSG 50-210
    rate_option=RateOption("period_ms", 1000.0),
    frame="a WSG packet",
    evidence="driver",
)
