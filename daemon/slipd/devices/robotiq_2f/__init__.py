"""Robotiq 2F-85, 2F-140 and Hand-E grippers; slipd is the Modbus RTU master.

Three registers are written (commands), three are read (status). Nothing moves without a permit: the session polls, and
sends a command only when `Session.execute` receives a permit. Positions, speeds and forces are bytes; tables in the
config convert them to metres and newtons. Source: Robotiq 2F instruction manual, control over Modbus RTU.
"""

from __future__ import annotations

from slipd.devices import Device, GripRange, Need, RateOption
from slipd.devices.robotiq_2f.robotiq_commands import (
    ACTIVATION,
    COMMAND_PAUSE_NS,
    TRANSITIONS,
    Goal,
    RegisterWrite,
    RobotiqLine,
    WriteQueue,
)
from slipd.devices.robotiq_2f.robotiq_registers import (
    FORCE_TABLE,
    SPEED_TABLE,
    UNIT,
    WIDTH_TABLE,
    Decoder,
    Table,
    Units,
    is_activating,
    parse_status,
)
from slipd.devices.shared import modbus
from slipd.devices.shared.command_queue import STOP
from slipd.devices.shared.device_interface import DecoderHealth, check_integer
from slipd.devices.shared.gripper_session import GripperSessionBase
from slipd.devices.shared.gripper_states import Event, State
from slipd.types.samples import GripperSample

__all__ = ["DEVICE", "Decoder", "Session"]

LAST_UNIT = 247
"""Highest Modbus address."""

_SENT = {"clear": Event.CLEAR_SENT, "activate": Event.ACTIVATION_SENT}
_REPEATED = {"clear": Event.CLEAR_REPEATED, "activate": Event.ACTIVATION_REPEATED}


class Session(GripperSessionBase[WriteQueue]):
    """Poll the gripper and carry out permits, one transaction at a time.

    `state` is "closed", "waiting" (for a status), "inactive", "activating", "active", "command lost" or "no reply".
    `TRANSITIONS` lists what the gripper accepts in each state.

    ``echo_ok`` of a sample is whether the gripper echoes the position sent last. Force and speed are not echoed;
    only the acknowledgement of the write shows that they arrived.

    Attributes:
        health: Its ``lost`` counts unanswered transactions.
        command_lost: Whether the last command was refused, was never acknowledged, or reached a gripper that was no
            longer active.

    Args:
        unit: Modbus address of the gripper.
        poll_period_s: Time from one status poll to the next, s, at least 0.005.
        force_table: (force byte, N on one pad), both rising.
        width_table: (position byte / 255, m between the pads), the first rising and the second falling.
        speed_table: (speed byte, m/s), both rising; None if the speed cannot be set.

    Raises:
        ValueError: The poll period is shorter than the gripper's own pause, or the address is not a Modbus address.
    """

    identity = ""
    _table = TRANSITIONS
    _activation = ACTIVATION

    def __init__(
        self,
        unit: int = UNIT,
        poll_period_s: float = 0.02,
        force_table: Table = FORCE_TABLE,
        width_table: Table = WIDTH_TABLE,
        speed_table: Table | None = SPEED_TABLE,
    ) -> None:
        if not poll_period_s * 1e9 >= COMMAND_PAUSE_NS:
            raise ValueError(f"poll_period_s must be at least 0.005, got {poll_period_s}")
        check_integer("unit", unit, 1, LAST_UNIT)
        self.health = DecoderHealth()
        self._units = units = Units(force_table, width_table, speed_table)
        self.width_range_m, self.width_step_m = units.width_range_m, units.width_step_m
        self.speed_range_mps, self.force_range_n = units.speed_range_mps, units.force_range_n
        self._line = RobotiqLine(unit, round(poll_period_s * 1e9), self.health)
        self._queue = WriteQueue(unit, units)
        self._reset(State.CLOSED)

    def _reset(self, state: State) -> None:
        super()._reset(state)
        self.command_lost = False
        self._unanswered: RegisterWrite | None = None  # to be repeated if no reply comes

    @property
    def state(self) -> str:
        """State of the gripper, as a short text for people."""
        state = self._state
        if state is State.CLOSED:
            return "closed"
        if self._line.silent:
            return "no reply"
        if self.command_lost:
            return "command lost"
        return "activating" if self.activating else state.value

    def applied_n(self, force_n: float) -> float:
        """Return the force of the byte that would be sent for ``force_n``, N on one pad."""
        return self._units.newtons(self._units.force(force_n))

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: forget queued writes, and poll. Nothing moves."""
        self._reset(State.WAITING)
        self._line.open(now_ns)
        return self.on_time(now_ns)

    def stop(self) -> bytes:
        """End. Nothing is sent, so the gripper keeps what it holds."""
        self._reset(State.CLOSED)
        self._line.open(0)
        return b""

    def drop(self) -> bool:
        """Drop writes that are not sent yet, except a halt; do not repeat unanswered ones."""
        dropped = self._queue.drop()
        if self._unanswered is not None and self._unanswered.kind != STOP:
            self._unanswered = None
        self._revert_activation(Event.DROP)
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost. Minor faults of the gripper end by themselves, others with an activation."""
        self.command_lost = False

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``now_ns``; return the status reading they complete, if any."""
        request = self._line.outstanding
        reply = self._line.receive(data, now_ns)
        if request is None or reply is None:
            return []
        write, self._unanswered = self._unanswered, None
        if request.function == modbus.WRITE:
            self.command_lost = False
            if write is not None and not reply.error:
                self._queue.acknowledged(write)
            if reply.error:
                self._give_up()
        elif not reply.error:
            return [self._handle_status(reply.registers, now_ns)]
        return []

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        if self._state is State.CLOSED:
            return None
        return self._line.due_ns(commands_wait=bool(self._queue.waiting))

    def on_time(self, now_ns: int) -> bytes:
        """Return the command or poll that is due at ``now_ns``; empty if none is."""
        due = self.next_deadline()
        if due is None or now_ns < due:
            return b""
        if self._line.outstanding is not None:
            self._handle_timeout(self._line.outstanding)
        if not self._queue.waiting or self._line.poll_goes_first(now_ns):
            return self._line.poll(now_ns)
        write = self._unanswered = self._queue.send()
        if write.kind in _SENT:
            self._reported = None
            self._handle_event(_SENT[write.kind])
        return self._line.send(write.request, now_ns)

    def _activate(self, now_ns: int) -> None:
        self._queue.activate()
        self._line.poll_soon(now_ns)

    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        units = self._units
        goal, force = Goal(units.position(width_m), units.speed(speed_mps)), units.force(force_n)
        if not self._handle_event(Event.MOVE):
            return False
        self._queue.move(goal, force)
        return True

    def _set_force(self, force_n: float) -> None:
        self._queue.set_force(self._units.force(force_n), self._unanswered)

    def _halt(self) -> bool:
        dropped = self._accepts(Event.DROP) and self.drop()
        if not self._handle_event(Event.HALT):
            return dropped
        self._queue.halt()
        return True

    def _revert_activation(self, event: Event) -> None:
        """Return to the state of the last status if an activation was not sent."""
        if self._handle_event(event):
            self._repeat_report()

    def _handle_timeout(self, request: modbus.Request) -> None:
        self._line.handle_timeout()
        write, self._unanswered = self._unanswered, None
        writes = request.function == modbus.WRITE
        if self._line.silent:  # the gripper may have lost power, so ask for its status before any motion
            self._reported = None
            self._handle_event(Event.FELL_SILENT)
            if writes or self._queue.waiting:
                self._give_up()
        elif write is None:
            self.command_lost = self.command_lost or writes
        elif self._queue.repeat(write) and write.kind in _REPEATED:
            self._handle_event(_REPEATED[write.kind])

    def _give_up(self) -> None:
        self._queue.waiting = []
        self._revert_activation(Event.GIVE_UP)
        self.command_lost = True

    def _handle_status(self, registers: tuple[int, ...], now_ns: int) -> GripperSample:
        sample = parse_status(registers, now_ns, self._queue.requested, self._units.width_m)
        self.health.good += 1
        if sample.active:
            self._reported = Event.REPORTED_ACTIVE
        else:
            self._reported = Event.REPORTED_ACTIVATING if is_activating(registers) else Event.REPORTED_INACTIVE
        accepted = self._handle_event(self._reported)
        if not sample.active:
            self._queue.forget_force()
            if accepted and self._queue.waiting:
                self._give_up()
        return sample


DEVICE = Device(
    "robotiq_2f",
    "gripper",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1.0, 1e9 / COMMAND_PAUSE_NS),
    baud=115_200,
    needs_tables=True,
    grip=GripRange(force_n=235.0, stroke_m=0.140, speed_mps=0.250),  # of a 2F-85; of a 2F-140
    needs=(
        Need(
            "force_table",
            "[[0, 20.0], [255, 185.0]]",
            "force byte, N on one pad, with a load cell between the pads; the maker publishes no table",
        ),
        Need(
            "width_table",
            "[[0.0118, 0.085], [0.902, 0.0]]",
            "position byte / 255 (a 2F-85: 3 to 230), m between the pads, with your fingertips",
        ),
    ),
    rate_option=RateOption("poll_period_s", 1.0),
    frame="a reply of a Robotiq gripper",
    evidence="driver",
)
