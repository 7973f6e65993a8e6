"""A Robotous RFT force/torque sensor as seen from its line.

Not emulated: bias, change of the baud rate, and overload counters, which the daemon never requests.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slipd.devices import robotous
from slipd.devices.robotous import CARRIED_HZ, COUNTS_PER_N, FILTERS_HZ, RATES_HZ
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream, whole

SLOW_BAUD = 115_200
PRODUCT, SERIAL = b"RFT40-SA01-D", b"RFT-2211-0042"

_OUT_OF_RANGE = b"\x00\x02"
_OBEYED = b"\x01\x00"


def encode_response(number: int, content: bytes = b"") -> bytes:
    """Return a response with up to fifteen bytes of content."""
    return robotous.encode_packet(bytes((number,)) + content, robotous.RESPONSE_LENGTH)


def encode_reading(counts: Sequence[int], overload: int = 0, number: int = robotous.START) -> bytes:
    """Return a reading as the sensor sends it.

    Args:
        counts: Force x y z, torque x y z; each within an int16.
        overload: One bit per axis, from 0x20 (force x) to 0x01 (torque z).
        number: The command that it answers: `READ_ONCE` or `START`.
    """
    return encode_response(number, robotous.READING_FIELDS.pack(*counts, overload))


def parse_commands(received: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Parse the bytes that a sensor received.

    Returns:
        Number and arguments of each command, and the bytes to keep for the next call.
    """
    commands: list[tuple[int, bytes]] = []
    at = received.find(robotous.SYNC)
    while 0 <= at <= len(received) - robotous.COMMAND_LENGTH:
        data = received[at + 1 : at + 9]
        if sum(data) & 0xFF == received[at + 9] and received[at + 10] == robotous.END:
            commands.append((data[0], data[1:]))
            at += robotous.COMMAND_LENGTH
        else:
            at += 1
        at = received.find(robotous.SYNC, at)
    return commands, received[at:] if at >= 0 else b""


class RobotousSensor(EmulatedWrench):
    """The sensor on its line; its caller passes the time.

    Args:
        seed: Seed of its noise.
        torque_divider: Counts per N·m of the model.
        baud: Speed of its line, bit/s; a slow one limits its rate.

    Attributes:
        writes: Number of settings written to its EEPROM.
        overload: Overload bits of the readings from now on.
    """

    def __init__(self, seed: int, torque_divider: float = 2000.0, baud: int = SLOW_BAUD) -> None:
        super().__init__(WrenchStream(seed, RATES_HZ[0]), float(CARRIED_HZ), torque_divider=torque_divider)
        self._counts_per_unit = np.repeat((COUNTS_PER_N, torque_divider), 3)
        self._most_hz = CARRIED_HZ if baud <= SLOW_BAUD else max(RATES_HZ)
        self.writes = 0
        self.overload = 0
        self._settings = {robotous.GET_RATE: b"\x00", robotous.GET_FILTER: b"\x00\x00"}

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; return the answers."""
        commands, self._received = parse_commands(self._received + data)
        return [output for number, arguments in commands for output in self._obey(number, arguments, t_ns)]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the readings due by then."""
        return [
            encode_reading(whole(values * self._counts_per_unit, 16), self.overload)
            for _, values in self._stream.due(t_ns)
        ]

    def _obey(self, number: int, arguments: bytes, t_ns: int) -> list[bytes]:
        names = {robotous.PRODUCT_NAME: PRODUCT, robotous.SERIAL_NUMBER: SERIAL}
        if number == robotous.START:
            self._stream.start(t_ns)
        elif number == robotous.STOP:
            self._stream.stop()
        elif number in names:
            return [encode_response(number, names[number])]
        elif number in self._settings:
            return [encode_response(number, self._settings[number])]
        elif number in (robotous.SET_RATE, robotous.SET_FILTER):
            return [encode_response(number, self._set(number, arguments))]
        return []

    def _set(self, number: int, arguments: bytes) -> bytes:
        if number == robotous.SET_RATE and arguments[0] < len(RATES_HZ) and RATES_HZ[arguments[0]] <= self._most_hz:
            self._settings[robotous.GET_RATE] = arguments[:1]
            self._stream.rate_hz = RATES_HZ[arguments[0]]
        elif number == robotous.SET_FILTER and arguments[1] < len(FILTERS_HZ):
            self._settings[robotous.GET_FILTER] = arguments[:2]
        else:
            return _OUT_OF_RANGE
        self.writes += 1
        return _OBEYED


make = RobotousSensor
