"""A rig whose fingers have a tilted force sensor behind a pad with charge amplifiers."""

from __future__ import annotations

from typing import Any

from slipd import config

TILTED = [0.9659258, 0.2588190, 0.0, 0.0]
AT = [0.004, -0.002, -0.025]
FINGER = """
[finger.{name}]
mu = 0.5

[finger.{name}.wrench]
device = "bota"
port = "/dev/{wrench}"
rate_hz = 100.0
sign = {sign}
pad_from_sensor = {{ xyz_m = {xyz}, quat_xyzw = {quat} }}  # from the drawing

[finger.{name}.pad]
device = "pvdf"
port = "/dev/{pad}"
rate_hz = 25.0
rows = 12
cols = 12
pitch_m = 0.0035
electrode_m = 0.0015
axis_scale = [0.0005]
threshold = 0.005
charge_tau_s = 2.0
swap_xy = {swap}
flip_x = {flip_x}
flip_y = {flip_y}
"""
RIGHT: dict[str, Any] = {"sign": 1, "xyz": AT, "quat": TILTED, "swap": "false", "flip_x": "false", "flip_y": "false"}


def charge_rig(**fingers: dict[str, Any]) -> config.Config:
    """Return the config; ``wrench`` and ``pad`` of a finger name its ports, by default its own."""
    tables = [
        FINGER.format(**({"name": name, "wrench": f"{name}-wrench", "pad": f"{name}-pad"} | RIGHT | changed))
        for name, changed in fingers.items()
    ]
    return config.parse("# A rig.\n[rates]\nslip_hz = 20.0\n" + "".join(tables), "rig.toml")
