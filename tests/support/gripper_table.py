"""The table ``[gripper]`` of a Robotiq gripper that exerts 3 to 30 N on a pad."""

from __future__ import annotations

from typing import Any

TABLE = """
[gripper]
device = "robotiq_2f"
port = "{port}"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 30.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
max_force_n = 25.0
"""


def gripper_table(port: str, **keys: Any) -> str:
    """Return the table as TOML, with more keys."""
    return TABLE.format(port=port) + "".join(f"{key} = {value}\n" for key, value in keys.items())
