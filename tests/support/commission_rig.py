"""A rig of one finger with a force sensor, three-axis taxels and a gripper, for a whole run of the guide."""

from __future__ import annotations

from typing import Any

from slipd import config

TAXELS = """
[finger.{name}.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "{number}"
rate_hz = 50.0
stale_s = 0.5
rows = 4
cols = 4
pitch_m = 0.0047
electrode_m = 0.0047
axis_scale = [0.001, 0.001, -0.001]
threshold = 0.02
full_scale = 65535.0
flip_y = {flip_y}
"""
FINGER = (
    """
[finger.{name}]
mu = 0.3
min_normal_n = 0.3

[finger.{name}.wrench]
device = "bota"
port = "/dev/{name}-wrench"
rate_hz = 100.0
stale_s = 0.5
pad_from_sensor = {{ xyz_m = [0.0, 0.0, -0.03], quat_xyzw = {quat} }}
force_std_n = 0.03
torque_std_nm = 0.0005
mass_kg = {mass}
com_m = [0.0, 0.0, {com_z}]
"""
    + TAXELS
)
GRIPPER = """
[gripper]
device = "robotiq_2f"
port = "/dev/gripper"
rate_hz = 50.0
force_table = [[0, 20.0], [255, 185.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
"""
FINGERS = ["left"]
LIMIT = "max_force_n = 40.0\n"
TRUE: dict[str, Any] = {"quat": [0.0, 0.0, 0.0, 1.0], "mass": 0.08, "com_z": -0.012, "flip_y": "false"}
WRONG: dict[str, Any] = {"quat": [1.0, 0.0, 0.0, 0.0], "mass": 0.0, "com_z": 0.0, "flip_y": "true"}
"""Numbers in the order w, x, y, z, no weight, and a mirrored image."""

PRESSES = {
    "Press the middle": "press {finger} 6 N at 6 0 mm",
    "Press the corner": "press {finger} 6 N at 6 6 mm",
}
"""Touches of its pad, which is smaller than that of `commission_person.TOUCHES`."""


def commission_rig(*, gripper: str = GRIPPER + LIMIT, **changed: Any) -> config.Config:
    """Return the config, with changed values of ``TRUE``."""
    tables = [FINGER.format(name=name, number=k, **(TRUE | changed)) for k, name in enumerate(FINGERS, 1)]
    return config.parse("# A rig.\n[rates]\nslip_hz = 50.0\n" + "".join(tables) + gripper, "rig.toml")
