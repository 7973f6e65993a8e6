"""A rig whose left finger has a weight, and whose arm is moved by a program that reports it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from engine_rig import LEFT, RIGHT, Run
from grasp_table import grasp_table
from nanoseconds import MS

from slipd.devices.external import encode_reading
from slipd.events import Bytes

MASS_KG, COM_M = 0.1, (0.004, -0.002, -0.03)
HEAVY = LEFT.replace("stuck_after = 0", f"stuck_after = 0\nmass_kg = {MASS_KG}\ncom_m = {list(COM_M)}")
ARM = """
[grasp.arm]
device = "external"
port = "ipc:///tmp/arm"
sensor = "arm"
rate_hz = 250.0
"""
RIG = HEAVY + RIGHT + grasp_table() + ARM
DOWN = (0.0, 0.0, 9.80665)
"""Gravity in the gripper frame whose Z axis, towards the fingertips, points down."""
STILL = (0.0, 0.0, 0.0)


class ArmRun(Run):
    """An engine on this rig, with all links up.

    Args:
        text: Its config.
    """

    def __init__(self, text: str = RIG) -> None:
        super().__init__(text)
        self.up()

    def carry(self, gravity: Sequence[float] = DOWN, velocity: Sequence[float] = STILL, **more: Any) -> None:
        """Push one reading of the arm, of now unless ``t_ns`` says otherwise; ``flips``: with an alternating sign."""
        t_ns = more.pop("t_ns", self.t_ns)
        sign = -1.0 if more.pop("flips", False) and t_ns // (4 * MS) % 2 else 1.0
        gravity = [sign * each for each in gravity]
        data = encode_reading("arm", t_ns, gravity_mps2=gravity, angular_velocity_radps=velocity, **more)
        self.feed(Bytes("arm", data))

    def carry_for(self, ms: float, *motion: Sequence[float], **more: Any) -> None:
        """Push the same motion for a while, at 250 Hz."""
        for _ in range(round(ms / 4)):
            self.wait(4)
            self.carry(*motion, **more)
            self.tick()

    def stream(self, name: str = "arm") -> dict[str, Any]:
        """Return what ``status`` says of a stream."""
        found: dict[str, Any] = self.ask("status")["result"]["streams"][name]
        return found
