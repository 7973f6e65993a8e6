"""A WSG gripper as seen from its line: two jaws that move, and hold a part with the force limit.

Not emulated: grasp, release, soft limits, scripts, and other commands that the daemon never sends; they are unknown to
it. A part is rigid. A clamped part ends a motion with "axis blocked", as drivers expect (roboticslibrary/rl at 91df9f2,
``src/rl/hal/WeissWsg50.cpp``, ``recv``).
"""

from __future__ import annotations

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, Packet, PacketScanner
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import Limits
from slipd.tools.sim.emulators import EmulatedDevice, Timer, moved_jaws

NOT_INITIALISED = 3
NO_PARAMETER_EXPECTED = 12
NOT_ENOUGH_PARAMETERS = 13
UNKNOWN_COMMAND = 14
RANGE_ERROR = 28
"""Why a command is refused."""

SERIAL = 4711
LIMITS = Limits(110.0, 5.0, 420.0, 100.0, 5000.0, 5.0, 80.0, 120.0)
HOMING_MMPS = 100.0
UPDATE_HZ = 50.0
STARTS_AT_MM = 60.0

LONGEST_PAYLOAD = 64

_TYPICAL_BYTES = 12


REQUEST_SIZES = dict.fromkeys((wire.DISCONNECT, wire.STOP, wire.GET_FORCE, wire.SYSTEM, wire.LIMITS), 0) | {
    wire.HOME: 1,
    wire.OVERDRIVE: 1,
    wire.PREPOSITION: wire.GOAL_FIELDS.size,
    wire.ACKNOWLEDGE: 3,
    wire.SET_FORCE: wire.F32.size,
    **dict.fromkeys(wire.UPDATES, wire.UPDATE_FIELDS.size),
}
"""Bytes of a request, for emulators."""


def parse_goal(payload: bytes) -> tuple[int, float, float]:
    """Return flags, width in mm and speed in mm/s of a pre-position."""
    flags, width_mm, speed_mmps = wire.GOAL_FIELDS.unpack(payload)
    return flags, width_mm, speed_mmps


def encode_reply(reply_id: int, status: int = wire.OK, data: bytes = b"") -> bytes:
    """Return a reply as the gripper sends it."""
    return wire.encode(reply_id, status.to_bytes(wire.STATUS_LENGTH, "little") + data)


def encode_number(reply_id: int, number: float) -> bytes:
    """Return a reply that consists of one number: width, force or force limit."""
    return encode_reply(reply_id, data=wire.F32.pack(number))


def encode_state(words: set[str]) -> bytes:
    """Return the system state with the bits of these words set."""
    flags = sum(1 << bit for bit, word in wire.STATE_BITS.items() if word in words)
    return encode_reply(wire.STATE, data=wire.FLAGS.pack(flags))


def encode_grasping(state: str) -> bytes:
    """Return the grasping state."""
    return encode_reply(wire.GRASPING, data=bytes((wire.GRASPING_STATES.index(state),)))


def encode_limits(limits: wire.Limits) -> bytes:
    """Return the answer about the limits."""
    return encode_reply(wire.LIMITS, data=wire.LIMITS_FIELDS.pack(*limits))


class Gripper(EmulatedDevice):
    """The gripper on its line; its caller passes the time.

    Attributes:
        part_m: Width of the part between the jaws, m; 0: no part.
        words: Conditions of the system state that do not come from motion: "referenced" and faults, which tests set
            too.
        width_mm: Width between the jaws, mm.
        limit: Force limit, N of both fingers.
        overdrive: Whether forces above the nominal one are allowed.
    """

    def __init__(self) -> None:
        super().__init__(UPDATE_HZ)
        self.part_m = 0.0
        self.words = {"referenced"}
        self.width_mm = STARTS_AT_MM
        self.limit = LIMITS.nominal_force
        self.overdrive = False
        self._requests: PacketScanner = PacketScanner(
            SEED_WITH_PREAMBLE, lambda _, size, __: size <= LONGEST_PAYLOAD, _TYPICAL_BYTES, DecoderHealth()
        )
        self._connected = False  # a host is connected, or left without a disconnect command
        self._now_ns = 0
        self._goal: tuple[int, float, float] | None = None  # command, mm, mm/s
        self._blocked = ""
        self._updates: dict[int, Timer] = {}

    @property
    def grip_n(self) -> float:
        """Grip force on one pad, N."""
        return self.limit / 2 if self._blocked else 0.0

    def opened(self, t_ns: int) -> None:
        """Handle a connection; if the previous host left without a disconnect command, make a fast stop."""
        if self._connected:
            self.words.add("fast_stop")
            self._goal = None
        self._connected = True
        self._updates.clear()
        self._requests.forget()

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the answers."""
        output = self._move(t_ns)
        for request in self._requests.packets(data):
            output += self._answer(request)
        return output

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the ends of motions and the updates due by then."""
        output = self._move(t_ns)
        for update in sorted(self._updates):
            output += [self._update(update) for _ in self._updates[update].times(t_ns)]
        return output

    def _answer(self, request: Packet) -> list[bytes]:
        expected = REQUEST_SIZES.get(request.id)
        if expected is None:
            return [encode_reply(request.id, UNKNOWN_COMMAND)]
        if len(request.payload) != expected:
            short = len(request.payload) < expected
            return [encode_reply(request.id, NOT_ENOUGH_PARAMETERS if short else NO_PARAMETER_EXPECTED)]
        match request.id:
            case wire.DISCONNECT:
                self._connected = False
                self._updates.clear()
            case wire.ACKNOWLEDGE:
                self.words -= set(wire.FAULTS)
            case wire.STOP:
                return [*self._abort(), encode_reply(request.id)]
            case wire.SET_FORCE:
                return [encode_reply(request.id, self._set_force(wire.parse_number(request.payload)))]
            case wire.OVERDRIVE:
                self.overdrive = bool(request.payload[0] & 1)
            case wire.HOME:
                return self._begin(wire.HOME, LIMITS.stroke_mm, HOMING_MMPS)
            case wire.PREPOSITION:
                _, width_mm, speed_mmps = parse_goal(request.payload)
                return self._begin(wire.PREPOSITION, width_mm, speed_mmps)
            case wire.SYSTEM:
                return [encode_reply(wire.SYSTEM, data=wire.SYSTEM_FIELDS.pack(1, 0, 0, SERIAL))]
            case wire.LIMITS:
                return [encode_limits(LIMITS)]
            case wire.GET_FORCE:
                return [encode_number(wire.GET_FORCE, self.limit)]
            case _:
                automatic, period_ms = wire.UPDATE_FIELDS.unpack(request.payload)
                if automatic and period_ms:
                    self._updates[request.id] = Timer(1000.0 / period_ms)
                    self._updates[request.id].start(self._now_ns)
                return [self._update(request.id)]
        return [encode_reply(request.id)]

    def _set_force(self, newtons: float) -> int:
        if not LIMITS.min_force <= newtons <= (LIMITS.overdrive_force if self.overdrive else LIMITS.nominal_force):
            return RANGE_ERROR
        self.limit = newtons
        return wire.OK

    def _begin(self, command: int, width_mm: float, speed_mmps: float) -> list[bytes]:
        ready = "referenced" in self.words or command == wire.HOME
        if not ready or self.words & set(wire.FAULTS):
            return [encode_reply(command, NOT_INITIALISED)]
        output = self._abort()
        self._goal = command, width_mm, speed_mmps
        self._blocked = ""
        return [*output, encode_reply(command, wire.PENDING)]

    def _abort(self) -> list[bytes]:
        if self._goal is None:
            return []
        command, self._goal = self._goal[0], None
        return [encode_reply(command, wire.ABORTED)]

    def _move(self, t_ns: int) -> list[bytes]:
        """Move the jaws until ``t_ns``; return the reply at the end of the motion, if it ended."""
        step_s, self._now_ns = max(t_ns - self._now_ns, 0) * 1e-9, max(t_ns, self._now_ns)
        if self._goal is None:
            return []
        command, width_mm, speed_mmps = self._goal
        reach_mm = speed_mmps * step_s
        self.width_mm, moving, holding = moved_jaws(self.width_mm, width_mm, 1e3 * self.part_m, reach_mm)
        if moving:
            return []
        self._blocked = "blocked_minus" if holding else ""
        self._goal = None
        if command == wire.HOME:
            self.words.add("referenced")
        return [encode_reply(command, wire.AXIS_BLOCKED if self._blocked else wire.OK)]

    def _update(self, update: int) -> bytes:
        if update == wire.WIDTH:
            return encode_number(update, self.width_mm)
        if update == wire.FORCE:
            return encode_number(update, self.limit if self._blocked else 0.0)
        if update == wire.GRASPING:
            return encode_grasping("positioning" if self._goal else "idle")
        mode = {"overdrive"} if self.overdrive else set()
        return encode_state(self.words | mode | {"moving" if self._goal else "target_reached", self._blocked})
