"""A Bota force/torque sensor behind a pad, as seen from its line: banner, commands and acknowledgements, frames.

The maker's driver (bota-driver 1.1.16) configures it and reads it. Not emulated: the text data format, the calibration
matrix, and saved settings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.devices import bota
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream
from slipd.types.arrays import Array, cross_matrix

BOOT_NS = 200_000_000
"""Time from power-on to the first frame, ns; the banner comes in the middle."""

TEMPERATURE_C = 31.5
NAME, SERIAL = "MiniONE", 1

RATE_HZ = 800.0
"""Rate of frames until a command sets another filter length, Hz."""

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


@dataclass(frozen=True)
class BotaMount:
    """Pose of the sensor behind its pad, and its imperfections.

    Attributes:
        xyz_m: Origin of the sensor in the pad frame, m (``pad_from_sensor`` of a config).
        quat_xyzw: Rotation from sensor to pad coordinates, likewise.
        bias: Reading without load: force (3) in N and torque (3) in N·m, in the frame of the sensor; includes the
            weight of the finger, which does not move in this scene.
        noise_n: Standard deviation of each force component.
        noise_nm: Standard deviation of each torque component.
        sinc_length: Filter length until a command sets another; a frame comes every sinc_length / 51200 s.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    xyz_m: tuple[float, float, float] = (0.004, -0.002, -0.025)
    quat_xyzw: tuple[float, float, float, float] = (0.9659258, 0.2588190, 0.0, 0.0)
    bias: Sequence[float] = (1.7, -0.9, -2.4, 0.030, -0.020, 0.011)
    noise_n: float = 0.02
    noise_nm: float = 0.0002
    sinc_length: int = 64
    clock_ppm: float = 40.0


class BotaSensor(EmulatedWrench):
    """The sensor on its line; its caller passes the time.

    Args:
        mount: Pose behind its pad, and imperfections.
        seed: Seed or source of its noise.
    """

    def __init__(self, mount: BotaMount, seed: int | np.random.Generator) -> None:
        stream = WrenchStream(seed, _rate_hz(mount.sinc_length), mount.noise_n, mount.noise_nm)
        super().__init__(stream, RATE_HZ)
        turn = Rotation.from_quat(np.array(mount.quat_xyzw)).as_matrix().T
        self._from_pad = np.block([[turn, np.zeros((3, 3))], [-turn @ cross_matrix(np.array(mount.xyz_m)), turn]])
        self._bias = np.array(mount.bias, dtype=np.float64)
        self._ppm = mount.clock_ppm
        self.feel(np.zeros(3), np.zeros(3))
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

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Set the load on the finger from now on.

        Args:
            force_n: Force on the finger in the pad frame, shape (3,), N.
            torque_nm: Torque on it about the pad's centre, shape (3,), N·m.
        """
        felt = self._from_pad @ np.concatenate((force_n, torque_nm)) + self._bias
        super().feel(felt[:3], felt[3:])

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
            self._stream.rate_hz = _rate_hz(int(arguments[0]))
        elif letter == "f" or (letter == "c" and arguments[2] != _BINARY):
            code = _REFUSED
        return encode_ack(letter, code)


def _rate_hz(sinc_length: int) -> float:
    return _INTERNAL_RATE_HZ / sinc_length


def make(seed: int) -> BotaSensor:
    """Return a sensor that measures in its own frame, without a bias."""
    return BotaSensor(BotaMount(xyz_m=(0.0,) * 3, quat_xyzw=(0.0, 0.0, 0.0, 1.0), bias=(0.0,) * 6), seed)
