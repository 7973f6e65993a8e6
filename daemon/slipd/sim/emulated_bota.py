"""A Bota force/torque sensor behind a pad, seen from its line: banner, commands and acknowledgements, frames.

Left out: the text data format, the calibration matrix, and everything that saved settings would change.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.devices import bota
from slipd.samples import Array

BANNER = b"App Init\rname: MiniONE\rS/N: 20045\rFW version: 2.1.0\rc,0,1,0,4\r"

BOOT_NS = 200_000_000
"""From power on to the first frame; the banner comes in the middle of it."""

LONGEST_COMMAND = 64
"""The sensor's own buffer (Bota serial manual)."""

TEMPERATURE_C = 31.5

_INTERNAL_RATE_HZ = 51_200
_COMMANDS = tuple(
    re.compile(pattern)
    for pattern in (
        rb"[CRI#slw]",
        rb"c,[01],[01],[01],[0-4]",
        rb"f,(\d+),[01],[01],[01]",
        rb"b(?:,-?\d+\.\d{3}){6}",
    )
)
_IN_RUN_MODE = b"CRI#"
_NOISE_BLOCK = 1024


@dataclass(frozen=True)
class BotaMount:
    """How the sensor sits behind its pad, and its faults.

    Attributes:
        xyz_m: The sensor's origin in the pad frame (``pad_from_sensor`` of a config).
        quat_xyzw: Rotation from sensor to pad coordinates (likewise).
        bias: What it reads unloaded: force (3) in N and torque (3) in N·m, in its own frame; includes the weight
            of the finger, which does not move in this scene.
        noise_n: Standard deviation of each force component.
        noise_nm: Standard deviation of each torque component.
        rate_hz: Frames per second until a command sets another rate.
        clock_ppm: How much too fast its clock runs.
    """

    xyz_m: tuple[float, float, float] = (0.004, -0.002, -0.025)
    quat_xyzw: tuple[float, float, float, float] = (0.9659258, 0.2588190, 0.0, 0.0)
    bias: Sequence[float] = (1.7, -0.9, 2.4, 0.030, -0.020, 0.011)
    noise_n: float = 0.02
    noise_nm: float = 0.0002
    rate_hz: float = 1000.0
    clock_ppm: float = 40.0


class BotaSensor:
    """The sensor's end of its line; time is told to it.

    Args:
        mount: How it sits behind its pad, and its faults.
        rng: Source of its noise.
    """

    def __init__(self, mount: BotaMount, rng: np.random.Generator) -> None:
        turn = Rotation.from_quat(np.array(mount.quat_xyzw)).as_matrix().T
        x, y, z = mount.xyz_m
        lever = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))  # r × F as a matrix
        self._from_pad = np.block([[turn, np.zeros((3, 3))], [-turn @ lever, turn]])
        self._bias = np.array(mount.bias, dtype=np.float64)
        self._sigma = np.repeat((mount.noise_n, mount.noise_nm), 3)
        self._rng = rng
        self._noise: list[list[float]] = []
        self._ideal: list[float] = self._bias.tolist()
        self._ppm = mount.clock_ppm
        self._period_ns = round(1e9 / mount.rate_hz)
        self._command = b""
        self._text = b""
        self.restart(0)

    def restart(self, t_ns: int) -> None:
        """Boot, as at power on and whenever its port is opened."""
        self.mode: Literal["boot", "config", "run"] = "boot"
        self._booted_ns = t_ns
        self._next_ns = t_ns + BOOT_NS
        self._command, self._text = b"", BANNER

    def receive(self, data: bytes, t_ns: int) -> bytes:
        """Take what the host had written by ``t_ns``; return the acknowledgements."""
        answer = b""
        self._command += data
        while found := self._take_command():
            answer += self._obey(found, t_ns)
        return answer

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Take what acts on the finger from now on.

        Args:
            force_n: Force on the finger in the pad frame, shape (3,), N.
            torque_nm: Torque on it about the pad's centre, shape (3,), N·m.
        """
        self._ideal = (self._from_pad @ np.concatenate((force_n, torque_nm)) + self._bias).tolist()

    def advance(self, t_ns: int) -> bytes:
        """Go on to ``t_ns`` and return the bytes due until then."""
        said = b""
        if self.mode == "boot":
            if self._text and t_ns - self._booted_ns >= BOOT_NS // 2:
                said, self._text = self._text, b""
            if t_ns >= self._next_ns:
                self.mode = "run"
        while self.mode == "run" and t_ns >= self._next_ns:
            said += self._frame(self._next_ns - self._booted_ns)
            self._next_ns += self._period_ns
        return said

    def _frame(self, elapsed_ns: int) -> bytes:
        if not self._noise:
            self._noise = self._rng.normal(scale=self._sigma, size=(_NOISE_BLOCK, 6)).tolist()
        values = [ideal + noise for ideal, noise in zip(self._ideal, self._noise.pop(), strict=True)]
        device_us = round(elapsed_ns * (1e-3 + self._ppm * 1e-9))
        return bota.encode_frame(values[:3], values[3:], device_us, temperature_c=TEMPERATURE_C)

    def _take_command(self) -> re.Match[bytes] | None:
        """The first whole command in what was written; what can be none is dropped byte by byte."""
        while self._command:
            for pattern in _COMMANDS:
                if found := pattern.match(self._command):
                    self._command = self._command[found.end() :]
                    return found
            if self._command[:1] in b"cfb" and len(self._command) < LONGEST_COMMAND:
                return None
            self._command = self._command[1:]
        return None

    def _obey(self, found: re.Match[bytes], t_ns: int) -> bytes:
        letter = found[0][:1]
        if self.mode == "boot" or (self.mode == "run" and letter not in _IN_RUN_MODE):
            return b""
        done = True
        if letter in b"#I":
            self.restart(t_ns)
            return b""
        if letter == b"C":
            self.mode = "config"
        elif letter == b"R":
            self.mode, self._next_ns = "run", t_ns + self._period_ns
        elif letter == b"f":
            done = int(found[1]) > 0
            if done:
                self._period_ns = round(int(found[1]) * 1e9 / _INTERNAL_RATE_HZ)
        elif letter == b"c":
            done = found[0][6:7] == b"0"  # only the binary format is emulated
        return b"r,0,%b,%d\r" % (letter, 0 if done else 1)
