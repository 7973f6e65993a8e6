"""A valid config to break, and the faults of a broken one."""

from __future__ import annotations

import re

import pytest

from slipd import config
from slipd.errors import ConfigError

GOOD = """\
[levels]
caution = 0.6

[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/left-wrench"
rate_hz = 800

[finger.left.pad]
device = "pvdf"
port = "/dev/left-pad"
rate_hz = 200.0
rows = 8
cols = 16
pitch_m = 0.0032
electrode_m = 0.0015

[finger.right]

[finger.right.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "2"
rate_hz = 60.0
rows = 4
cols = 4
pitch_m = 0.0047
electrode_m = 0.0047
axis_scale = [0.001, 0.001, -0.001]

[gripper]
device = "robotiq_2f"
port = "/dev/gripper"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 30.0]]
width_table = [
  [0.0, 0.085],
  [1.0, 0.0]
]
speed_table = [[0, 0.02], [255, 0.15]]
max_force_n = 25.0
"""
"""A config with every kind of table."""


def line(text: str, number: int = 1) -> int:
    """Return the line of GOOD that has the n-th occurrence of ``text``."""
    return [k for k, content in enumerate(GOOD.splitlines(), start=1) if text in content][number - 1]


def faults(text: str) -> list[tuple[str, int | None, str]]:
    with pytest.raises(ConfigError) as caught:
        config.parse(text, "rig.toml")
    return [(fault.path, fault.line, fault.message) for fault in caught.value.faults]


def broken(old: str, new: str) -> str:
    """GOOD with the beginning of the first line that has it changed."""
    found = re.search(rf"^{re.escape(old)}", GOOD, re.MULTILINE)
    assert found is not None, old
    return GOOD[: found.start()] + new + GOOD[found.end() :]
