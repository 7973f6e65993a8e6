"""The table ``[gripper]`` of the grippers of most tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

ROBOTIQ = """
[gripper]
device = "robotiq_2f"
port = "{port}"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 30.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
max_force_n = 25.0
"""
EXTERNAL = """
[gripper]
device = "external_gripper"
port = "unix://{folder}/gripper"
rate_hz = 50.0
min_force_n = 2.0
max_force_n = 40.0
"""


def gripper_table(port: str, **keys: Any) -> str:
    """Return the table of a Robotiq gripper that exerts 3 to 30 N on a pad, with more keys."""
    return ROBOTIQ.format(port=port) + _lines(keys)


def external_gripper_table(folder: Path, **keys: Any) -> str:
    """Return the table of a gripper whose driver listens in a folder, with more keys."""
    return EXTERNAL.format(folder=folder) + _lines(keys)


def _lines(keys: dict[str, Any]) -> str:
    return "".join(f"{key} = {value}\n" for key, value in keys.items())
