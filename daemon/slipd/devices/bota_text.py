"""The text that Bota sensors speak beside their frames, read and written from either side of the line.

Commands carry no terminator and are answered by ``r,0,<letter>,<code>``; a reset is followed by a banner.
Source: Bota serial example and driver. Line ends, and what codes other than 0 mean, are unconfirmed.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

BANNER = b"App Init"

BAUD_460800 = 4

_ACK = re.compile(rb"r,\d,([A-Za-z]),(\d)")
_COMMAND = re.compile(rb"[CRI#slw]|c,\d,\d,\d,\d|f,\d{1,4},\d,\d,\d")
_IDENTITY = re.compile(rb"name: ([!-~][ -~]{0,39})[\r\n](?:[ -~]{0,80}[\r\n]+){0,4}?S/N: (\d{1,20})[\r\n]")
_LONGEST_COMMAND = 64
"""The sensor's own buffer; what is longer and still unfinished is no command."""


@dataclass(frozen=True, slots=True)
class Command:
    """A command as the sensor reads it.

    Attributes:
        letter: "C" configure, "R" run, "I" soft reset, "#" hard reset, "c" communication, "f" filter, "s" save,
            "l" load, "w" print.
        arguments: The numbers of "c" (temperature compensation, calibration, format, baud code) and of "f" (sinc
            length, chop, fast, FIR off).
    """

    letter: str
    arguments: tuple[int, ...] = ()

    def encode(self) -> bytes:
        """Return the command as it is sent."""
        return ",".join((self.letter, *map(str, self.arguments))).encode()


CONFIGURE = Command("C")
RUN = Command("R")


def communication(*, temperature_compensation: bool) -> Command:
    """Return the command for calibrated values in binary frames at 460800 bit/s."""
    return Command("c", (int(temperature_compensation), 1, 0, BAUD_460800))


def filtering(sinc_length: int) -> Command:
    """Return the command for a frame every ``sinc_length`` / 51200 s, with neither chop, fast mode nor FIR."""
    return Command("f", (sinc_length, 0, 0, 1))


def find_ack(heard: bytes, letter: str) -> int | None:
    """Return the code with which the command ``letter`` was answered in ``heard``; None while it was not."""
    for match in _ACK.finditer(heard):
        if match[1] == letter.encode():
            return int(match[2])
    return None


def find_identity(heard: bytes) -> str:
    """Return name and serial number of the sensor whose banner was heard, such as "MiniONE S/N 1234"; "" if unknown."""
    match = _IDENTITY.search(heard)
    return f"{match[1].decode().strip()} S/N {match[2].decode()}" if match else ""


def parse_commands(heard: bytes) -> tuple[list[Command], bytes]:
    """Return the commands in what a sensor heard, and what must be kept for the next call."""
    commands: list[Command] = []
    done = 0
    for match in _COMMAND.finditer(heard):
        letter, *arguments = match[0].decode().split(",")
        commands.append(Command(letter, tuple(map(int, arguments))))
        done = match.end()
    return commands, heard[done:][-_LONGEST_COMMAND:]


def encode_ack(letter: str, code: int = 0) -> bytes:
    """Return the answer to the command ``letter``; code 0 is success."""
    return f"r,0,{letter},{code}\r\n".encode()


def encode_banner(name: str = "SensONE", serial_number: int = 1, firmware: str = "1.0.0") -> bytes:
    """Return what a sensor prints after a reset, its communication setup included."""
    lines = (BANNER.decode(), f"name: {name}", f"S/N: {serial_number}", f"FW version: {firmware}", "c,0,1,0,4")
    return "".join(f"{line}\r" for line in lines).encode()
