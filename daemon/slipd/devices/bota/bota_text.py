"""Text commands, acknowledgements and boot banner of Bota sensors, for both ends of the line.

Commands end with a line feed and are answered by ``r,0,<letter>,<code>``; after a reset the sensor sends a banner.
Sources: the maker's driver, package bota-driver 1.1.16 (``Bota_Binary_gen0``), whose commands and expectations show
when it talks to the emulator; and Bota's serial example, which sends commands without an end. The meaning of codes
other than 0 is unconfirmed.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

BANNER = b"App Init"

BAUD_460800 = 4

_ACK = re.compile(rb"r,\d,([A-Za-z]),(\d)")
_COMMAND = re.compile(rb"[CRI#slw]|p(?=\?)|c,\d,\d,\d,\d|f,\d{1,4},\d,\d,\d")
_IDENTITY = re.compile(rb"name: ([!-~][ -~]{0,39})[\r\n](?:[ -~]{0,80}[\r\n]+){0,4}?S/N: (\d{1,20})[\r\n]")
_LONGEST_COMMAND = 64
"""Size of the sensor's own buffer, bytes; anything longer is not a command."""


@dataclass(frozen=True, slots=True)
class Command:
    """One command to the sensor.

    Attributes:
        letter: "C" configure, "R" run, "I" soft reset, "#" hard reset, "c" communication, "f" filter, "s" save,
            "l" load, "w" print, "p" (``p?``) name and serial number.
        arguments: Arguments of "c" (temperature compensation, calibration, format, baud code) and of "f" (sinc length,
            chop, fast, FIR off).
    """

    letter: str
    arguments: tuple[int, ...] = ()

    def encode(self) -> bytes:
        """Return the command as it is sent."""
        return ",".join((self.letter, *map(str, self.arguments))).encode() + b"\n"


CONFIGURE = Command("C")
RUN = Command("R")


def communication(*, temperature_compensation: bool) -> Command:
    """Return the command for calibrated values in binary frames at 460800 bit/s."""
    return Command("c", (int(temperature_compensation), 1, 0, BAUD_460800))


def filtering(sinc_length: int) -> Command:
    """Return the command for one frame every ``sinc_length`` / 51200 s, without chop, fast mode or FIR."""
    return Command("f", (sinc_length, 0, 0, 1))


def find_ack(received: bytes, letter: str) -> int | None:
    """Return the code that acknowledges the command ``letter``; None if ``received`` has no acknowledgement."""
    for match in _ACK.finditer(received):
        if match[1] == letter.encode():
            return int(match[2])
    return None


def find_identity(received: bytes) -> str:
    """Return name and serial number from a banner, such as "MiniONE S/N 1234"; "" if there is none."""
    match = _IDENTITY.search(received)
    return f"{match[1].decode().strip()} S/N {match[2].decode()}" if match else ""


def parse_commands(received: bytes) -> tuple[list[Command], bytes]:
    """Return the commands that a sensor received, and the bytes to keep for the next call."""
    commands: list[Command] = []
    done = 0
    for match in _COMMAND.finditer(received):
        letter, *arguments = match[0].decode().split(",")
        commands.append(Command(letter, tuple(map(int, arguments))))
        done = match.end()
    return commands, received[done:][-_LONGEST_COMMAND:]


def encode_ack(letter: str, code: int = 0) -> bytes:
    """Return the answer to the command ``letter``; code 0 is success."""
    return f"r,0,{letter},{code}\r\n".encode()


def encode_product(name: str, serial_number: int) -> bytes:
    """Return the answer to ``p?`` as the maker's driver reads it: the second and third field are unknown to it."""
    return f"p,0,{serial_number},0,0,{name}\r\n".encode() + encode_ack("p")


def encode_banner(name: str = "SensONE", serial_number: int = 1, firmware: str = "1.0.0") -> bytes:
    """Return the text that a sensor sends after a reset, including its communication setup."""
    lines = (BANNER.decode(), f"name: {name}", f"S/N: {serial_number}", f"FW version: {firmware}", "c,0,1,0,4")
    return "".join(f"{line}\r" for line in lines).encode()
