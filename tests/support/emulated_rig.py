"""One emulated finger that a hand presses, a daemon that reads it, and the live view with both."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from rig_parts import emulating, endpoints_of, first_line, part

from slipd.tools.sim.hand_commands import touch_command

RIG = """
[finger.left]
mu = 0.5
min_normal_n = 1.5  # more than the bias of the emulated sensor

[finger.left.wrench]
device = "external"
port = "ipc:///nowhere/wrench"
sensor = "wrench"
rate_hz = 50.0
stale_s = 0.5
sign = 1
pad_from_sensor = { xyz_m = [0.0, 0.0, -0.02], quat_xyzw = [0.0, 0.0, 0.0, 1.0] }

[finger.left.pad]
device = "external"
port = "ipc:///nowhere/pad"
sensor = "pad"
rate_hz = 50.0
stale_s = 0.5
rows = 4
cols = 8
flip_x = true
pitch_m = 0.004
electrode_m = 0.003
axis_scale = [1.0]
threshold = 0.06  # six times the noise of an emulated taxel
gain_error = 0.10
"""
WRONG = {"sign = 1": "sign = -1", "flip_x = true": "flip_x = false"}
"""A sign and an orientation that are wrong."""


class EmulatedRig(contextlib.ExitStack):
    """Emulation, daemon and live view as processes; ``with`` starts and ends them.

    Args:
        folder: For their files and sockets.
        wrong: What the config of the daemon states in place of lines of ``RIG``, by which the devices are mounted.

    Attributes:
        hand: Local socket of the emulation.
        config: Of the daemon.
        emulator: The process of the emulation; ``daemon``: that of the daemon.
        url: Address of the page.
    """

    def __init__(self, folder: Path, wrong: Mapping[str, str] = {}) -> None:
        super().__init__()
        self._folder, self._wrong = folder, wrong
        self.hand = folder / "emulated" / "hand"
        self.config = folder / "rig.toml"

    def __enter__(self) -> EmulatedRig:
        listen = ("--listen", "127.0.0.1:0", "--emulation", str(self.hand.parent), "--config", str(self.config))
        self.emulate()
        self.write_config(self._wrong)
        viewing = self.enter_context(part(self._folder, "slipd_client.slipctl", "view", *listen))
        self.daemon = self.enter_context(part(self._folder, "slipd", "run", "--config", str(self.config)))
        endpoints_of(self.daemon)
        self.url = first_line(viewing).partition(": ")[2]
        return self

    def write_config(self, wrong: Mapping[str, str] = {}) -> None:
        """Write the config of the daemon, which states something ``wrong`` or is right."""
        text = self._true
        for right, other in wrong.items():
            text = text.replace(right, other)
        self.config.write_text(text, encoding="utf-8")

    def emulate(self) -> None:
        """Start the emulation."""
        self.emulator, self._true = self.enter_context(emulating(self._folder, RIG))

    def touch(self, command: str) -> None:
        """Let the hand carry out a command."""
        assert touch_command(self.hand.parent, command.split())
