"""The Modbus line to a Robotiq gripper: one transaction at a time, pauses between them, and polls of the status."""

from __future__ import annotations

from slipd.devices import modbus
from slipd.devices.health import DecoderHealth
from slipd.devices.robotiq_2f.robotiq_registers import INPUT_ADDRESS, REGISTERS

COMMAND_PAUSE_NS = 5_000_000
"""The manual asks for 5 ms between commands: the registers are refreshed at 200 Hz."""
REPLY_TIMEOUT_NS = 100_000_000
"""A reply takes 5 to 10 ms; a USB adapter under load may hold it for several times its 16 ms."""
ATTEMPTS = 3
"""Unanswered transactions in a row that count as silence; a command repeated later would come as a surprise."""
COMMANDS_IN_A_ROW = 2
"""Commands go before a poll that is due, but at most this many in a row."""


class RobotiqLine:
    """The transaction under way, and when the next may begin.

    Args:
        unit: Modbus address of the gripper.
        period_ns: Time from one poll to the next.
        health: Receives ``lost``, ``bad`` and ``bad_bytes``.

    Attributes:
        outstanding: The request whose reply is awaited; None where none is.
        heard: Bytes received since it was sent, no more than a frame's worth.
    """

    def __init__(self, unit: int, period_ns: int, health: DecoderHealth) -> None:
        self._period_ns = period_ns
        self._health = health
        self._polls = [
            modbus.Request(unit, function, INPUT_ADDRESS, REGISTERS)
            for function in (modbus.READ_INPUT, modbus.READ_HOLDING)
        ]
        self.open(0)

    def open(self, now_ns: int) -> None:
        """Begin on a freshly opened link: nothing is awaited, and a poll is due."""
        self.outstanding: modbus.Request | None = None
        self.heard = b""
        self._unanswered = 0
        self._commands_in_a_row = 0
        self._poll_at_ns = self._free_at_ns = self._reply_by_ns = now_ns

    @property
    def silent(self) -> bool:
        """Whether so many transactions in a row are unanswered that nothing is known of the gripper."""
        return self._unanswered >= ATTEMPTS

    def due_ns(self, *, commands_wait: bool) -> int:
        """Return when the next transaction is due, or the reply to the present one overdue."""
        if self.outstanding is not None:
            return self._reply_by_ns
        return self._free_at_ns if commands_wait else max(self._poll_at_ns, self._free_at_ns)

    def poll_soon(self, now_ns: int) -> None:
        """Let a poll be due at ``now_ns``."""
        self._poll_at_ns = now_ns

    def poll_goes_first(self, now_ns: int) -> bool:
        """Return whether a poll is overdue that commands have held up long enough."""
        return now_ns >= self._poll_at_ns and self._commands_in_a_row >= COMMANDS_IN_A_ROW

    def poll(self, now_ns: int) -> bytes:
        """Ask for the status; return the bytes to write."""
        self._poll_at_ns = now_ns + self._period_ns
        return self.send(self._polls[0], now_ns)

    def send(self, request: modbus.Request, now_ns: int) -> bytes:
        """Begin a transaction; return the bytes to write."""
        self.outstanding = request
        self._reply_by_ns = now_ns + REPLY_TIMEOUT_NS
        return modbus.encode_request(request)

    def receive(self, data: bytes, now_ns: int) -> modbus.Reply | None:
        """Take bytes received at ``now_ns``; return the reply that they complete, which ends the transaction."""
        request = self.outstanding
        if request is None:
            self._count_noise(len(data))
            return None
        heard = self.heard + data
        self.heard = heard[-modbus.MAX_FRAME :]
        reply = modbus.find_reply(heard, request)
        if reply is None:
            self._count_noise(len(heard) - len(self.heard))
            return None
        self._count_noise(len(heard) - reply.length)
        self._end()
        self._unanswered = 0
        self._free_at_ns = now_ns + COMMAND_PAUSE_NS
        if request.function == modbus.WRITE:
            self._commands_in_a_row += 1
        elif reply.error:
            self._polls.reverse()  # older firmware reads its status as holding registers, newer as input
        else:
            self._commands_in_a_row = 0
        return reply

    def time_out(self) -> None:
        """End the present transaction, whose reply did not come."""
        self._count_noise(len(self.heard))
        self._end()
        self._health.lost += 1
        self._unanswered += 1
        if self._unanswered % ATTEMPTS == 0:
            self._polls.reverse()

    def _end(self) -> None:
        self.outstanding, self.heard = None, b""

    def _count_noise(self, noise: int) -> None:
        self._health.bad_bytes += noise
        self._health.bad += noise > 0
