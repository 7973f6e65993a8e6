"""Robotiq 2F-85, 2F-140 and Hand-E grippers, spoken to as a Modbus RTU master.

Three registers are written (what to do), three are read (what is). Nothing moves but on request: the session polls,
and sends a command only when `activate`, `move`, `set_force` or `halt` asked for it. Positions, speeds and forces are
the gripper's own bytes; what they are in metres and newtons the tables of the config say.
Source: Robotiq 2F instruction manual, control over Modbus RTU.
"""

from __future__ import annotations

import struct

from slipd.devices import Device, GripRange, crc, modbus
from slipd.devices.framing import FixedFrames
from slipd.devices.health import DecoderHealth
from slipd.devices.robotiq_registers import (
    ACTIVATE,
    FORCE_ADDRESS,
    GO,
    INPUT_ADDRESS,
    OUTPUT_ADDRESS,
    REGISTERS,
    UNIT,
    parse_stage,
    parse_status,
)
from slipd.devices.robotiq_units import FORCE_TABLE, SPEED_TABLE, WIDTH_TABLE, Table, Units
from slipd.samples import GripperSample

LAST_UNIT = 247
"""The highest address that Modbus gives to a device."""
COMMAND_PAUSE_NS = 5_000_000
"""The manual asks for 5 ms between commands: the registers are refreshed at 200 Hz."""
REPLY_TIMEOUT_NS = 100_000_000
"""A reply takes 5 to 10 ms; a USB adapter under load may hold it for several times its 16 ms."""
ATTEMPTS = 3
"""So many unanswered transactions in a row are "no reply"; a command repeated later would come as a surprise."""
COMMANDS_IN_A_ROW = 2
"""A command goes before a poll that is due, but no flood of them hides what becomes of them."""

_STATUS = struct.Struct(f">{REGISTERS}H")
_STATUS_AT = 3
_STATUS_LENGTH = _STATUS_AT + _STATUS.size + 2


class Decoder:
    """Makes gripper samples of the status replies in a stream; everything else in it is passed over.

    ``echo_ok`` and ``width_m`` are None: the replies alone do not say what was requested, nor how wide the pads are
    apart. `Session` knows.

    Args:
        unit: Modbus address of the gripper.
    """

    def __init__(self, unit: int = UNIT) -> None:
        self.health = DecoderHealth()
        self._frames = FixedFrames(bytes((unit,)), _STATUS_LENGTH, _is_status, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Take bytes received at ``t_ns`` and return the status readings they complete."""
        buffer, found = self._frames.receive(data)
        self.health.good += len(found)
        return [parse_status(_STATUS.unpack_from(buffer, at + _STATUS_AT), t_ns, None) for at, _ in found]

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._frames.forget()


def _is_status(buffer: bytes, at: int) -> bool:
    if buffer[at + 1] not in (modbus.READ_HOLDING, modbus.READ_INPUT) or buffer[at + 2] != _STATUS.size:
        return False
    frame = buffer[at : at + _STATUS_LENGTH]
    return crc.modbus(frame[:-2]) == int.from_bytes(frame[-2:], "little")


class Session:
    """Polls the gripper and sends what is asked for, one transaction at a time.

    `state` is "closed", "waiting" (for the first status), "inactive", "activating", "active", "command lost" or
    "no reply". `health.lost` counts unanswered transactions.

    Attributes:
        command_lost: The last command was refused, never acknowledged, or met a gripper that was no longer active.

    ``echo_ok`` of a sample compares the position last sent with the gripper's echo of it, in every status while they
    differ. Force and speed are not echoed; that they arrived is known by the acknowledgement of the write alone.

    Args:
        unit: Modbus address of the gripper.
        poll_period_s: Time from one status poll to the next, s, at least 0.005.
        force_table: (force byte, N on one pad), both rising.
        width_table: (position byte / 255, m between the pads), the first rising and the second falling.
        speed_table: (speed byte, m/s), both rising; None: no speed can be asked for.

    Raises:
        ValueError: A poll period shorter than the gripper's own pause, or an address that none has.
    """

    identity = ""

    def __init__(
        self,
        unit: int = UNIT,
        poll_period_s: float = 0.02,
        force_table: Table = FORCE_TABLE,
        width_table: Table = WIDTH_TABLE,
        speed_table: Table | None = SPEED_TABLE,
    ) -> None:
        if not poll_period_s * 1e9 >= COMMAND_PAUSE_NS:
            raise ValueError(f"a poll period of {poll_period_s} s is too short: 0.005 s is the least")
        if not (isinstance(unit, int) and 1 <= unit <= LAST_UNIT):
            raise ValueError(f"unit {unit!r} is no Modbus address: an integer from 1 to {LAST_UNIT} is")
        self.health = DecoderHealth()
        self.state = "closed"
        self._unit = unit
        self._units = Units(force_table, width_table, speed_table)
        self._period_ns = round(poll_period_s * 1e9)
        self._clear = self._write((0, 0, 0))
        self._activation = self._write((ACTIVATE << 8, 0, 0))
        self._halt = self._write((ACTIVATE << 8,))
        self._polls = [
            modbus.Request(unit, function, INPUT_ADDRESS, REGISTERS)
            for function in (modbus.READ_INPUT, modbus.READ_HOLDING)
        ]
        self._reset(0)

    def _reset(self, now_ns: int) -> None:
        self.command_lost = False
        self._stage = "waiting"
        self._active = False  # the last status said so, and the gripper still answers
        self._goal = self._sent = (0, 0, 0)  # position, speed and force bytes; those of the last move that began
        self._requested: int | None = None  # the position last sent
        self._force: int | None = None  # the force last sent while active
        self._pending: list[modbus.Request] = []
        self._outstanding: modbus.Request | None = None
        self._repeats = True  # what is outstanding, where it stays unanswered
        self._unanswered = 0
        self._commands_in_a_row = 0
        self._heard = b""
        self._poll_at_ns = self._free_at_ns = self._reply_by_ns = now_ns

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: forget what was pending, and poll. Nothing moves."""
        self._reset(now_ns)
        self.state = "waiting"
        return self.on_time(now_ns)

    def stop(self) -> bytes:
        """End. Nothing is sent: the gripper keeps what it holds."""
        self._reset(0)
        self.state = "closed"
        return b""

    @property
    def force_told_n(self) -> float | None:
        """The force of the byte that was sent last or is to be, N on one pad; None where none was while active."""
        if self._activation in self._pending:
            return None
        unsent = [_force_byte(request) for request in self._pending if request is not self._halt]
        force = unsent[-1] if unsent else self._force
        return None if force is None else self._units.newtons(force)

    def applied_n(self, force_n: float) -> float:
        """Return the force of the byte that would be sent, N on one pad."""
        return self._units.newtons(self._units.force(force_n))

    def activate(self, now_ns: int) -> None:
        """Ask for the activation, which clears the gripper's state and moves its fingers fully."""
        self._pending = [self._clear, self._activation]
        self._stage = "activating"
        self._poll_at_ns = now_ns

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Least and largest width between the pads."""
        return self._units.width_range_m

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Least and largest speed; None where no speed can be asked for."""
        return self._units.speed_range_mps

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Least and largest force, N on one pad."""
        return self._units.force_range_n

    def move(self, width_m: float, speed_mps: float | None, force_n: float) -> float | None:
        """Ask for a width, with a speed (None: a middle one) and a force, N on one pad.

        A move that was asked for but not yet sent is replaced.

        Returns:
            The force of the byte that is sent, never above ``force_n`` but for that of byte 0; None, and nothing will
            be sent, unless the gripper reports that it is active: the same bytes would activate one that is not.

        Raises:
            ValueError: The gripper has no such width or speed, or the force is no number.
        """
        units = self._units
        goal = units.position(width_m), units.speed(speed_mps), units.force(force_n)
        if not self._able:
            return None
        self._goal = goal
        self._pending = [self._go()]
        return units.newtons(goal[2])

    def set_force(self, force_n: float) -> float | None:
        """Ask for another force at the position last requested; see `move`."""
        force = self._units.force(force_n)
        if not self._able:
            return None
        position, speed, _ = self._goal
        self._goal = (position, speed, force)
        outstanding = self._outstanding if self._repeats else None
        latest = self._pending[-1] if self._pending else outstanding
        write = self._go() if _goes(latest) else self._write((speed << 8 | force,), FORCE_ADDRESS)
        self._pending = [*(request for request in self._pending if request is self._halt), write]
        return self._units.newtons(force)

    def halt(self) -> bool:
        """Ask the fingers to stop where they are, by clearing "go to position"; a force not yet sent still is."""
        unsent = self._activation in self._pending
        if unsent:
            self.drop()
        if self._active:
            unsent = any(request is not self._halt for request in self._pending)
            if unsent and self._goal[0] != self._sent[0]:
                self._goal, unsent = self._sent, False  # a move that never began, with its force
            _, speed, force = self._goal
            kept = [self._write((speed << 8 | force,), FORCE_ADDRESS)] if unsent else []
            self._pending = [self._halt, *kept]
        return self._active or unsent

    def drop(self) -> bool:
        """Forget what was not sent yet but for a halt; what is unanswered is not repeated."""
        kept = [request for request in self._pending if request is self._halt]
        dropped = len(kept) < len(self._pending)
        self._pending, self._goal = kept, self._sent
        self._repeats = self._outstanding is self._halt
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost; its own lesser faults end by themselves, others with the next activation."""
        self.command_lost = False
        self._show_state()

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Take bytes received at ``now_ns`` and return the status reading they complete, if any."""
        request = self._outstanding
        if request is None:
            self._count_noise(len(data))
            return []
        heard = self._heard + data
        self._heard = heard[-modbus.MAX_FRAME :]
        reply = modbus.find_reply(heard, request)
        if reply is None:
            self._count_noise(len(heard) - len(self._heard))
            return []
        self._count_noise(len(heard) - reply.length)
        self._outstanding, self._heard = None, b""
        self._free_at_ns = now_ns + COMMAND_PAUSE_NS
        self._unanswered = 0
        return self._take_reply(request, reply, now_ns)

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        if self.state == "closed":
            return None
        if self._outstanding is not None:
            return self._reply_by_ns
        return self._free_at_ns if self._pending else max(self._poll_at_ns, self._free_at_ns)

    def on_time(self, now_ns: int) -> bytes:
        """Return the command or poll that is due at ``now_ns``; empty when none is."""
        due = self.next_deadline()
        if due is None or now_ns < due:
            return b""
        if self._outstanding is not None:
            self._time_out(self._outstanding)
        overdue = now_ns >= self._poll_at_ns and self._commands_in_a_row >= COMMANDS_IN_A_ROW
        if self._pending and not overdue:
            request = self._pending.pop(0)
            self._note_sent(request)
        else:
            request = self._polls[0]
            self._poll_at_ns = now_ns + self._period_ns
        self._outstanding, self._repeats = request, True
        self._reply_by_ns = now_ns + REPLY_TIMEOUT_NS
        return modbus.encode_request(request)

    @property
    def _able(self) -> bool:
        """Whether the gripper takes motions now: an activation that waits comes before them."""
        return self._active and self._activation not in self._pending

    def _note_sent(self, request: modbus.Request) -> None:
        if request is self._clear:
            self._active, self._requested, self._force = False, None, None
        elif request not in (self._activation, self._halt):
            self._force = _force_byte(request)
            if _goes(request):
                self._requested, self._sent = self._goal[0], self._goal

    def _write(self, registers: tuple[int, ...], address: int = OUTPUT_ADDRESS) -> modbus.Request:
        return modbus.Request(self._unit, modbus.WRITE, write_address=address, registers=registers)

    def _go(self) -> modbus.Request:
        position, speed, force = self._goal
        return self._write(((ACTIVATE | GO) << 8, position, speed << 8 | force))

    def _count_noise(self, noise: int) -> None:
        self.health.bad_bytes += noise
        self.health.bad += noise > 0

    def _time_out(self, request: modbus.Request) -> None:
        self._count_noise(len(self._heard))
        self._outstanding, self._heard = None, b""
        self.health.lost += 1
        self._unanswered += 1
        writes = request.function == modbus.WRITE
        if self._unanswered >= ATTEMPTS:
            self._active = False  # it may have lost its power: ask before it is told to go anywhere
            if writes or self._pending:
                self._give_up()
            if self._unanswered % ATTEMPTS == 0:
                self._polls.reverse()
        elif writes and self._repeats:
            self._repeat(request)
        elif writes:
            self.command_lost = True
        self._show_state()

    def _repeat(self, request: modbus.Request) -> None:
        """Queue an unanswered command again, unless a newer one takes its place."""
        if request is self._clear:
            self._pending = [self._clear, self._activation]
        elif not any(newer.write_address == request.write_address or _goes(newer) for newer in self._pending):
            self._pending.append(request)

    def _give_up(self) -> None:
        self._pending, self._goal = [], self._sent
        self.command_lost = True

    def _take_reply(self, request: modbus.Request, reply: modbus.Reply, now_ns: int) -> list[GripperSample]:
        samples: list[GripperSample] = []
        if request.function == modbus.WRITE:
            self._commands_in_a_row += 1
            self.command_lost = False
            if reply.error:
                self._give_up()
        elif reply.error:
            self._polls.reverse()  # older firmware reads its status as holding registers, newer as input
        else:
            samples.append(self._take_status(reply.registers, now_ns))
        self._show_state()
        return samples

    def _take_status(self, registers: tuple[int, ...], now_ns: int) -> GripperSample:
        sample = parse_status(registers, now_ns, self._requested, self._units.width_m)
        self.health.good += 1
        self._commands_in_a_row = 0
        if self._activation not in self._pending:
            self._stage = parse_stage(registers)
            self._active = sample.active
            if not sample.active:
                self._force = None
            if self._pending and not sample.active:
                self._give_up()
        return sample

    def _show_state(self) -> None:
        if self._unanswered >= ATTEMPTS:
            self.state = "no reply"
        else:
            self.state = "command lost" if self.command_lost else self._stage


def _force_byte(request: modbus.Request) -> int:
    """Return the force of a write that sets one, which ends with it."""
    return request.registers[-1] & 0xFF


def _goes(request: modbus.Request | None) -> bool:
    """Say whether a request sends the gripper to a position."""
    return request is not None and len(request.registers) == REGISTERS and bool(request.registers[0] >> 8 & GO)


GRIP = GripRange(force_n=235.0, stroke_m=0.140, speed_mps=0.250)
"""Force of a 2F-85, stroke and speed of a 2F-140."""

DEVICE = Device(
    "robotiq_2f",
    "gripper",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1.0, 1e9 / COMMAND_PAUSE_NS),
    baud=115_200,
    tabled=True,
    grip=GRIP,
)
