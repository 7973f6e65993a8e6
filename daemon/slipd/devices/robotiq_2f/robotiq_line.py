"""Modbus line to a Robotiq gripper: one transaction at a time, with pauses, and polls of the status."""

from __future__ import annotations

from slipd.devices.robotiq_2f.robotiq_registers import INPUT_ADDRESS, REGISTERS
from slipd.devices.shared import modbus
from slipd.devices.shared.device_interface import DecoderHealth

COMMAND_PAUSE_NS = 5_000_000
"""Pause between commands from the manual: the registers are refreshed at 200 Hz."""
REPLY_TIMEOUT_NS = 100_000_000
"""Time allowed for a reply: it takes 5 to 10 ms, but a USB adapter under load may delay it by several times 16 ms."""
ATTEMPTS = 3
"""Unanswered transactions in a row that count as silence; a command repeated later would come as a surprise."""
NO_REPLY = (
    "no reply at Modbus address {unit}: is the gripper powered? is `unit` its address? is the line 115200 8N1, in the"
    " robot's tool I/O settings too? is the robot's own Robotiq software removed?"
)
"""What to check where no byte comes back.

Owners report this of grippers at the tool of a UR: UniversalRobots/Universal_Robots_ROS_Driver#691,
ros-industrial-attic/robotiq#216, PickNikRobotics/ros2_robotiq_gripper#88.
"""
COMMANDS_IN_A_ROW = 2
"""Commands are sent before a poll that is due, but at most this many in a row."""


class RobotiqLine:
    """The present transaction, and when the next one may begin.

    Args:
        unit: Modbus address of the gripper.
        period_ns: Time from one poll to the next.
        health: Receives ``lost``, ``bad`` and ``bad_bytes``, and a ``note`` while nothing at all is received.

    Attributes:
        outstanding: The request whose reply is awaited; None if there is none.
        received: Bytes received since it was sent, at most the length of a frame.
    """

    def __init__(self, unit: int, period_ns: int, health: DecoderHealth) -> None:
        self._unit = unit
        self._period_ns = period_ns
        self._health = health
        self._polls = [
            modbus.Request(unit, function, INPUT_ADDRESS, REGISTERS)
            for function in (modbus.READ_INPUT, modbus.READ_HOLDING)
        ]
        self.open(0)

    def open(self, now_ns: int) -> None:
        """Begin on a freshly opened link: no reply is awaited, and a poll is due."""
        self.outstanding: modbus.Request | None = None
        self.received = b""
        self._unanswered = 0
        self._health.note = ""
        self._commands_in_a_row = 0
        self._poll_at_ns = self._free_at_ns = self._reply_by_ns = now_ns

    @property
    def silent(self) -> bool:
        """Whether so many transactions in a row are unanswered that the gripper's state is unknown."""
        return self._unanswered >= ATTEMPTS

    def due_ns(self, *, commands_wait: bool) -> int:
        """Return when the next transaction is due, or the reply to the present one overdue."""
        if self.outstanding is not None:
            return self._reply_by_ns
        return self._free_at_ns if commands_wait else max(self._poll_at_ns, self._free_at_ns)

    def poll_soon(self, now_ns: int) -> None:
        """Make a poll due at ``now_ns``."""
        self._poll_at_ns = now_ns

    def poll_goes_first(self, now_ns: int) -> bool:
        """Return whether an overdue poll must go before further commands."""
        return now_ns >= self._poll_at_ns and self._commands_in_a_row >= COMMANDS_IN_A_ROW

    def poll(self, now_ns: int) -> bytes:
        """Request the status; return the bytes to send."""
        self._poll_at_ns = now_ns + self._period_ns
        return self.send(self._polls[0], now_ns)

    def send(self, request: modbus.Request, now_ns: int) -> bytes:
        """Begin a transaction; return the bytes to send."""
        self.outstanding = request
        self._reply_by_ns = now_ns + REPLY_TIMEOUT_NS
        return modbus.encode_request(request)

    def receive(self, data: bytes, now_ns: int) -> modbus.Reply | None:
        """Handle bytes received at ``now_ns``; return the reply that they complete, which ends the transaction."""
        request = self.outstanding
        if request is None:
            self._count_noise(len(data))
            return None
        received = self.received + data
        self.received = received[-modbus.MAX_FRAME :]
        reply = modbus.find_reply(received, request)
        if reply is None:
            self._count_noise(len(received) - len(self.received))
            return None
        self._count_noise(len(received) - reply.length)
        self._end()
        self._unanswered = 0
        self._health.note = ""
        self._free_at_ns = now_ns + COMMAND_PAUSE_NS
        if request.function == modbus.WRITE:
            self._commands_in_a_row += 1
        elif reply.error:
            self._polls.reverse()  # older firmware reads its status as holding registers, newer as input
        else:
            self._commands_in_a_row = 0
        return reply

    def handle_timeout(self) -> None:
        """End the present transaction without a reply."""
        nothing_came = not self.received
        self._count_noise(len(self.received))
        self._end()
        self._health.lost += 1
        self._unanswered += 1
        if self._unanswered % ATTEMPTS == 0:
            self._polls.reverse()
        self._health.note = NO_REPLY.format(unit=self._unit) if self.silent and nothing_came else ""

    def _end(self) -> None:
        self.outstanding, self.received = None, b""

    def _count_noise(self, noise: int) -> None:
        self._health.bad_bytes += noise
        self._health.bad += noise > 0
