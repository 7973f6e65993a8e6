"""Force/torque sensors as seen from their serial lines: a Bota, strain gauges with their amplifier, a Robotous RFT.

Not emulated: the Bota's text format, calibration matrix and saved settings; the bias, baud rate and overload counters
of the RFT, which the daemon never requests.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from slipd.devices import bota, gauges, robotous
from slipd.devices.robotous import CARRIED_HZ, COUNTS_PER_N, FILTERS_HZ, RATES_HZ
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameScanner
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream, device_us, whole
from slipd.types.arrays import Array

BOOT_NS = 200_000_000
"""Time from power-on of a Bota to its first frame, ns; the banner comes in the middle."""

BOTA_NAME, BOTA_SERIAL, TEMPERATURE_C = "MiniONE", 1, 31.5
BOTA_HZ = 800.0
"""Rate of frames until a command sets another filter length, Hz."""
BOTA_NOISE_NM = 0.0002
"""Standard deviation of each torque component, N·m."""

_INTERNAL_RATE_HZ = 51_200
_IN_RUN_MODE = "CRI#"
_DONE, _REFUSED = 0, 1
_BINARY = "0"
_COMMAND = re.compile(rb"[CRI#slw]|p(?=\?)|c,\d,\d,\d,\d|f,\d{1,4},\d,\d,\d")
_LONGEST_COMMAND = 64
"""Size of the sensor's own buffer, bytes; anything longer is not a command."""


def parse_commands(received: bytes) -> tuple[list[str], bytes]:
    """Return the commands that a Bota received, and the bytes to keep for the next call.

    A command is a letter: "C" configure, "R" run, "I" soft reset, "#" hard reset, "c" communication (temperature
    compensation, calibration, format, baud code), "f" filter (sinc length, chop, fast, FIR off), "s" save, "l" load,
    "w" print, "p" (``p?``) name and serial number; with its arguments after commas.
    """
    found = list(_COMMAND.finditer(received))
    rest = received[found[-1].end() :] if found else received
    return [match[0].decode() for match in found], rest[-_LONGEST_COMMAND:]


def encode_ack(letter: str, code: int = 0) -> bytes:
    """Return the answer of a Bota to the command ``letter``; code 0 is success."""
    return f"r,0,{letter},{code}\r\n".encode()


def encode_banner(name: str = "SensONE", serial_number: int = 1) -> bytes:
    """Return the text that a Bota sends after a reset, including its communication setup."""
    lines = (bota.BANNER.decode(), f"name: {name}", f"S/N: {serial_number}", "FW version: 1.0.0", "c,0,1,0,4")
    return "".join(f"{line}\r" for line in lines).encode()


class BotaSensor(EmulatedWrench):
    """A Bota behind a pad: banner, commands and acknowledgements, frames.

    The maker's driver (bota-driver 1.1.16) configures it and reads it.

    Args:
        seed: Seed or source of its noise.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    def __init__(self, seed: int | np.random.Generator, clock_ppm: float = 40.0) -> None:
        super().__init__(WrenchStream(seed, BOTA_HZ, noise_nm=BOTA_NOISE_NM), BOTA_HZ)
        self._ppm = clock_ppm
        self.opened(0)

    def opened(self, t_ns: int) -> None:
        """Boot, as at power-on and whenever the port is opened."""
        self.mode: Literal["boot", "config", "run"] = "boot"
        self._booted_ns = t_ns
        self._stream.start(t_ns + BOOT_NS - round(1e9 / self._stream.rate_hz))
        self._received, self._text = b"", encode_banner(BOTA_NAME, BOTA_SERIAL)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the acknowledgements."""
        commands, self._received = parse_commands(self._received + data)
        return [answer for command in commands if (answer := self._carry_out(command, t_ns))]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the banner and the frames due by then."""
        output: list[bytes] = []
        if self.mode == "boot":
            if self._text and t_ns - self._booted_ns >= BOOT_NS // 2:
                output, self._text = [self._text], b""
            if t_ns - self._booted_ns >= BOOT_NS:
                self.mode = "run"
        return output + super().advance(t_ns) if self.mode == "run" else output

    def _frame(self, taken_ns: int) -> bytes:
        values = self._stream.reading()
        booted_us = device_us(taken_ns - self._booted_ns, self._ppm)
        return bota.encode_frame(values[:3], values[3:], booted_us, temperature_c=TEMPERATURE_C)

    def _carry_out(self, command: str, t_ns: int) -> bytes:
        letter, *arguments = command.split(",")
        if self.mode == "boot" or (self.mode == "run" and letter not in _IN_RUN_MODE):
            return b""
        code = _DONE
        if letter in "#I":
            self.opened(t_ns)
            return b""
        if letter == "p":  # the driver ignores the zeros
            return f"p,0,{BOTA_SERIAL},0,0,{BOTA_NAME}\r\n".encode() + encode_ack("p")
        if letter == "C":
            self.mode = "config"
        elif letter == "R":
            self.mode = "run"
            self._stream.start(t_ns)
        elif letter == "f" and int(arguments[0]):
            self._stream.rate_hz = _INTERNAL_RATE_HZ / int(arguments[0])
        elif letter == "f" or (letter == "c" and arguments[2] != _BINARY):
            code = _REFUSED
        return encode_ack(letter, code)


FULL_SCALE = (1 << 23) - 1
"""Largest count of the 24-bit converters of the gauges."""

COUNTS_PER_UNIT = np.array(
    (
        (9000.0, 300.0, -200.0, 1500.0, 200_000.0, -9000.0),
        (-8500.0, 250.0, 150.0, -1200.0, 210_000.0, 7000.0),
        (200.0, 9200.0, 180.0, -205_000.0, 1100.0, 8000.0),
        (-300.0, -8800.0, 220.0, -195_000.0, -900.0, -6000.0),
        (150.0, -120.0, 4000.0, 2500.0, -1800.0, 160_000.0),
        (-180.0, 140.0, 4200.0, -2200.0, 1900.0, -150_000.0),
    )
)
"""Counts per N and N·m of each channel for each component, of an invented beam that bends more than it stretches."""
OFFSET = (1200.0, -800.0, 450.0, -2300.0, 90.0, 3100.0)


class GaugeAmplifier(EmulatedWrench):
    """Six strain gauges on a beam, and their amplifier; it sends unasked and never reads.

    Args:
        seed: Seed of its noise.
        rate_hz: Frames per second.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
        noise_n: Standard deviation of each force component, N.
        noise_nm: Standard deviation of each torque component, N·m.
        matrix: N and N·m per count, (6, 6), as in the config of its daemon; None: the inverse of ``COUNTS_PER_UNIT``.
        offset: Counts of each channel without load.
    """

    def __init__(
        self,
        seed: int,
        rate_hz: float = 1000.0,
        clock_ppm: float = 30.0,
        *,
        noise_n: float = 0.02,
        noise_nm: float = 0.0005,
        matrix: Sequence[Sequence[float]] | None = None,
        offset: Sequence[float] = OFFSET,
    ) -> None:
        self._counts_per_unit = COUNTS_PER_UNIT if matrix is None else np.linalg.inv(np.array(matrix))
        self._offset = np.array(offset)
        matrix = np.linalg.inv(COUNTS_PER_UNIT).tolist() if matrix is None else matrix
        stream = WrenchStream(seed, rate_hz, noise_n, noise_nm)
        super().__init__(stream, rate_hz, matrix=matrix, offset=list(offset))
        self._stream.start(0)
        self._ppm = clock_ppm
        self._sequence = 0

    def _frame(self, taken_ns: int) -> bytes:
        return self.encode(taken_ns, self._counts_per_unit @ self._stream.reading() + self._offset)

    def encode(self, taken_ns: int, counts: Array) -> bytes:
        """Return the next frame, with the counts of its channels."""
        channels = whole(counts, 24)
        saturated = sum([1 << channel for channel, count in enumerate(channels) if abs(count) >= FULL_SCALE])
        self._sequence += 1
        return gauges.encode_frame(channels, self._sequence - 1, device_us(taken_ns, self._ppm), saturated)


SLOW_BAUD = 115_200
PRODUCT, SERIAL = b"RFT40-SA01-D", b"RFT-2211-0042"

_OUT_OF_RANGE = b"\x00\x02"
_OBEYED = b"\x01\x00"


def encode_response(number: int, content: bytes = b"") -> bytes:
    """Return a response of an RFT with up to fifteen bytes of content."""
    return robotous.encode_packet(bytes((number,)) + content, robotous.RESPONSE_LENGTH)


def encode_reading(counts: Sequence[int], overload: int = 0, number: int = robotous.START) -> bytes:
    """Return a reading as an RFT sends it.

    Args:
        counts: Force x y z, torque x y z; each within an int16.
        overload: One bit per axis, from 0x20 (force x) to 0x01 (torque z).
        number: The command that it answers: `READ_ONCE` or `START`.
    """
    return encode_response(number, robotous.READING_FIELDS.pack(*counts, overload))


def _measure_command(buffer: bytes, at: int) -> int:
    valid = sum(buffer[at + 1 : at + 9]) & 0xFF == buffer[at + 9] and buffer[at + 10] == robotous.END
    return robotous.COMMAND_LENGTH if valid else NO_FRAME


class RobotousSensor(EmulatedWrench):
    """A Robotous RFT.

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
        length = robotous.COMMAND_LENGTH
        self._requests = FrameScanner(robotous.SYNC, _measure_command, length, DecoderHealth(), least=length)
        self._counts_per_unit = np.repeat((COUNTS_PER_N, torque_divider), 3)
        self._most_hz = CARRIED_HZ if baud <= SLOW_BAUD else max(RATES_HZ)
        self.writes = 0
        self.overload = 0
        self._known = {
            robotous.PRODUCT_NAME: PRODUCT,
            robotous.SERIAL_NUMBER: SERIAL,
            robotous.GET_RATE: b"\x00",
            robotous.GET_FILTER: b"\x00\x00",
        }

    def _frame(self, taken_ns: int) -> bytes:
        return encode_reading(whole(self._stream.reading() * self._counts_per_unit, 16), self.overload)

    def _obey(self, buffer: bytes, at: int, t_ns: int) -> list[bytes]:
        number, arguments = buffer[at + 1], buffer[at + 2 : at + 9]
        if number == robotous.START:
            self._stream.start(t_ns)
        elif number == robotous.STOP:
            self._stream.stop()
        elif number in self._known:
            return [encode_response(number, self._known[number])]
        elif number in (robotous.SET_RATE, robotous.SET_FILTER):
            return [encode_response(number, self._set(number, arguments))]
        return []

    def _set(self, number: int, arguments: bytes) -> bytes:
        if number == robotous.SET_RATE and arguments[0] < len(RATES_HZ) and RATES_HZ[arguments[0]] <= self._most_hz:
            self._known[robotous.GET_RATE] = arguments[:1]
            self._stream.rate_hz = RATES_HZ[arguments[0]]
        elif number == robotous.SET_FILTER and arguments[1] < len(FILTERS_HZ):
            self._known[robotous.GET_FILTER] = arguments[:2]
        else:
            return _OUT_OF_RANGE
        self.writes += 1
        return _OBEYED
