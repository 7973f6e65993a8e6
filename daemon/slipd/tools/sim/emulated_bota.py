"""A Bota force/torque sensor behind a pad, as seen from its line: banner, commands and acknowledgements, frames.

The maker's driver (bota-driver 1.1.16) configures it and reads it. Not emulated: the text data format, the calibration
matrix, and saved settings.
"""

from __future__ import annotations

import re
from typing import Literal

import numpy as np

from slipd.devices import bota
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream
from slipd.types.arrays import Array

BOOT_NS = 200_000_000
"""Time from power-on to the first frame, ns; the banner comes in the middle."""

TEMPERATURE_C = 31.5
NAME, SERIAL = "MiniONE", 1

RATE_HZ = 800.0
"""Rate of frames until a command sets another filter length, Hz."""

NOISE_NM = 0.0002
"""Standard deviation of each torque component, N·m."""

_INTERNAL_RATE_HZ = 51_200
_IN_RUN_MODE = "CRI#"
_DONE, _REFUSED = 0, 1
_BINARY = "0"


_COMMAND = re.compile(rb"[CRI#slw]|p(?=\?)|c,\d,\d,\d,\d|f,\d{1,4},\d,\d,\d")

_LONGEST_COMMAND = 64
"""Size of the sensor's own buffer, bytes; anything longer is not a command."""


def parse_commands(received: bytes) -> tuple[list[str], bytes]:
    """Return the commands that a sensor received, and the bytes to keep for the next call.

    A command is a letter: "C" configure, "R" run, "I" soft reset, "#" hard reset, "c" communication (temperature
    compensation, calibration, format, baud code), "f" filter (sinc length, chop, fast, FIR off), "s" save, "l" load,
    "w" print, "p" (``p?``) name and serial number; with its arguments after commas.
    """
    found = list(_COMMAND.finditer(received))
    rest = received[found[-1].end() :] if found else received
    return [match[0].decode() for match in found], rest[-_LONGEST_COMMAND:]


def encode_ack(letter: str, code: int = 0) -> bytes:
    """Return the answer to the command ``letter``; code 0 is success."""
    return f"r,0,{letter},{code}\r\n".encode()


def encode_banner(name: str = "SensONE", serial_number: int = 1, firmware: str = "1.0.0") -> bytes:
    """Return the text that a sensor sends after a reset, including its communication setup."""
    lines = (bota.BANNER.decode(), f"name: {name}", f"S/N: {serial_number}", f"FW version: {firmware}", "c,0,1,0,4")
    return "".join(f"{line}\r" for line in lines).encode()


class BotaSensor(EmulatedWrench):
    """The sensor on its line; its caller passes the time.

    Args:
        seed: Seed or source of its noise.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    def __init__(self, seed: int | np.random.Generator, clock_ppm: float = 40.0) -> None:
        super().__init__(WrenchStream(seed, RATE_HZ, noise_nm=NOISE_NM), RATE_HZ)
        self._ppm = clock_ppm
        self.opened(0)

    def opened(self, t_ns: int) -> None:
        """Boot, as at power-on and whenever the port is opened."""
        self.mode: Literal["boot", "config", "run"] = "boot"
        self._booted_ns = t_ns
        self._stream.start(t_ns + BOOT_NS - round(1e9 / self._stream.rate_hz))
        self._received, self._text = b"", encode_banner(NAME, SERIAL)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the acknowledgements."""
        commands, self._received = parse_commands(self._received + data)
        return [answer for command in commands if (answer := self._obey(command, t_ns))]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the banner and the frames due by then."""
        output: list[bytes] = []
        if self.mode == "boot":
            if self._text and t_ns - self._booted_ns >= BOOT_NS // 2:
                output, self._text = [self._text], b""
            if t_ns - self._booted_ns >= BOOT_NS:
                self.mode = "run"
        if self.mode == "run":
            output += [self._frame(taken_ns - self._booted_ns, values) for taken_ns, values in self._stream.due(t_ns)]
        return output

    def _frame(self, elapsed_ns: int, values: Array) -> bytes:
        device_us = round(elapsed_ns * (1e-3 + self._ppm * 1e-9))
        return bota.encode_frame(values[:3], values[3:], device_us, temperature_c=TEMPERATURE_C)

    def _obey(self, command: str, t_ns: int) -> bytes:
        letter, *arguments = command.split(",")
        if self.mode == "boot" or (self.mode == "run" and letter not in _IN_RUN_MODE):
            return b""
        code = _DONE
        if letter in "#I":
            self.opened(t_ns)
            return b""
        if letter == "p":
            return f"p,0,{SERIAL},0,0,{NAME}\r\n".encode() + encode_ack("p")  # the driver ignores the zeros
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


make = BotaSensor
