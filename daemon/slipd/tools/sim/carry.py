"""The scene ``carry``: a robot arm that carries a full glass along a path, and the program that chooses its speed.

The gripper points down: its Z axis, and X of both pads, point to the table. The path lies in the plane of the pads.
Each move is a minimum-jerk one, from rest to rest; its speed is what slipd says that the grip, which must not rise,
holds. The arm is pure: time is an argument.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from slipd.tools.sim.robot_program import Plan, RobotProgram
from slipd.tools.sim.scene_parts import GRAVITY_MPS2, Load, Script
from slipd_client.grip import GripClient
from slipd_client.motion import point_of

GRIPPER_QUAT_XYZW = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the gripper frame in the base, whose Z axis points up: half a turn about X."""

HANDOVER_S = 0.3
"""How long the weight takes to move between table and gripper, before the first move and after the last."""

GLASS_KG, GLASS_KGM2 = 0.35, 1e-3
"""The full glass, and its moment of inertia about the line through both pads."""

POINTS = 41
"""Points of a move that is checked."""


@dataclass(frozen=True)
class Move:
    """One move of the arm.

    Attributes:
        name: For people.
        aside_m: Along X of the base.
        up_m: Along Z of the base.
        takes_s: At full speed.
    """

    name: str
    aside_m: float
    up_m: float
    takes_s: float

    def acceleration(self, t_s: float, scale: float) -> tuple[float, float]:
        """Return the acceleration along X and Z of the base ``t_s`` after the begin, at a scale of the speed."""
        s = t_s * scale / self.takes_s
        if not 0.0 <= s <= 1.0:
            return 0.0, 0.0
        rate = (60.0 * s - 180.0 * s**2 + 120.0 * s**3) * (scale / self.takes_s) ** 2
        return self.aside_m * rate, self.up_m * rate

    def points(self) -> list[list[float]]:
        """Return the move at full speed as points of ``motion.check``."""
        times = [self.takes_s * i / (POINTS - 1) for i in range(POINTS)]
        along = [self.acceleration(t_s, 1.0) for t_s in times]
        return [point_of(t_s, GRIPPER_QUAT_XYZW, (x, 0.0, z)) for t_s, (x, z) in zip(times, along, strict=True)]


PATH = (
    Move("lift", 0.0, 0.10, 0.5),
    Move("aside", 0.50, 0.0, 0.65),
    Move("up", 0.0, 0.30, 0.42),
    Move("back", -0.50, 0.0, 0.48),
    Move("down", 0.0, -0.40, 0.5),
)
"""At full speed up to 10 m/s². The last move sets the glass down."""


@dataclass
class Arm:
    """The arm on its path; between moves it stands still.

    Attributes:
        path: Moves, the first of which lifts, and the last of which sets down.
        begun: Number of moves that have begun.
    """

    path: tuple[Move, ...] = PATH
    begun: int = field(default=0, init=False)
    _scale: float = field(default=1.0, init=False)
    _leaves_s: float = field(default=math.inf, init=False)
    _arrives_s: float = field(default=-math.inf, init=False)

    def begin(self, t_s: float, scale: float) -> None:
        """Begin the next move at a scale of its speed; while the arm moves, and after the last move, do nothing."""
        if self.begun < len(self.path) and self.arrived(t_s):
            self._leaves_s = t_s if self.begun else t_s + HANDOVER_S
            self._arrives_s = self._leaves_s + self.path[self.begun].takes_s / scale
            self.begun, self._scale = self.begun + 1, scale

    def arrived(self, t_s: float) -> bool:
        """Return whether the arm stands still, and the table has taken the glass where it is set down."""
        return t_s >= self._arrives_s + (HANDOVER_S if self.begun == len(self.path) else 0.0)

    def acceleration(self, t_s: float) -> tuple[float, float]:
        """Return the acceleration along X and Z of the base."""
        return self.path[self.begun - 1].acceleration(t_s - self._leaves_s, self._scale)

    def carried(self, t_s: float) -> float:
        """Return the share of the weight that the gripper carries, not the table, 0 to 1."""
        taken = 1.0 + (t_s - self._leaves_s) / HANDOVER_S if self.begun < 2 else 1.0
        left = (t_s - self._arrives_s) / HANDOVER_S if self.begun == len(self.path) else 0.0
        return min(max(taken, 0.0), 1.0) * (1.0 - min(max(left, 0.0), 1.0))

    def reading(self, t_s: float) -> dict[str, Any]:
        """Return the motion as fields of the stream ``arm``."""
        x, z = self.acceleration(t_s)
        point = point_of(t_s, GRIPPER_QUAT_XYZW, (x, 0.0, z))
        return {
            "gravity_mps2": point[1:4],
            "angular_velocity_radps": point[4:7],
            "angular_acceleration_radps2": point[7:],
        }


@dataclass(frozen=True)
class CarryScript(Script):
    """The load of a carried object: its weight and inertia. What is poured or tugged in the other scene is left out.

    Attributes:
        arm: Carries it.
        com_m: Centre of mass from the middle of the contact, along X and Y of the left pad.
    """

    arm: Arm = field(default_factory=Arm)
    com_m: tuple[float, float] = (0.0, 0.0)

    def weight(self, t_s: float, mass_kg: float) -> Load:
        """Return the load on both pads in the frame of the left one: X is down, Y is X of the base."""
        x_mps2, z_mps2 = self.arm.acceleration(t_s)
        carried_kg = self.arm.carried(t_s) * mass_kg
        down_n, aside_n = carried_kg * (GRAVITY_MPS2 + z_mps2), carried_kg * x_mps2
        return down_n, aside_n, self.com_m[0] * aside_n - self.com_m[1] * down_n

    def phase(self, t_s: float) -> str:
        """Return the name of the move, or that the arm stands still."""
        if not self.arm.begun:
            return "approach"
        return "arrived" if self.arm.arrived(t_s) else self.arm.path[self.arm.begun - 1].name


GRIP_N = 5.0
"""Largest grip force that the glass may feel, N on one pad."""

CARRY_PLAN = Plan(force_n=GRIP_N, limit_n=GRIP_N, open_s=math.inf, end_s=90.0)

FLOOR = 0.45
"""Scale of the speed while slipd does not know what the grip holds."""

STILL_S = 0.8
"""Rest before a move, s: the glass ceases to swing, and the load is weighed."""

OBJECT = "glass"
"""Name under which slipd keeps what it learns of the glass."""

END_S = 1.0
"""Time from letting go to the end, s."""


CARRY_CHANGES = (
    ("max_force_n = 25.0", f"max_force_n = {GRIP_N}"),
    ("ceiling_n = 22.0", f"ceiling_n = {GRIP_N}"),
    ("grip_safety = 2.0", "grip_safety = 1.1"),
    ("mu = 0.55", "mu_spread = 0.03  # it was measured on this glass\nmu = 0.58"),
)
CARRY_TABLES = """
[grasp.arm]
device = "external"
port = "ipc://virtual/arm"
sensor = "arm"
rate_hz = 250.0

[grasp.motion]
wanted_acceleration_mps2 = 10.0
regrip_std_m = 0.002
"""


def carry_config(text: str) -> str:
    """Return the config of the scene ``carry``: that of the demo with an arm, and a grip that may not rise."""
    for old, new in CARRY_CHANGES:
        text = text.replace(old, new)
    return text + CARRY_TABLES


class CarryProgram(RobotProgram):
    """Grips, and carries the glass along the path.

    Args:
        publish: Endpoint of the messages.
        requests: Endpoint of the requests.
        move: Begins the next move at a scale of its speed.
        arrived: Returns how many moves have ended.
        advised: Ask slipd before each move; otherwise every move is at full speed.
        plan: The grip.
        path: The moves.

    Attributes:
        scales: Scale of each move so far.
    """

    def __init__(
        self,
        publish: str,
        requests: str,
        move: Callable[[float], object],
        arrived: Callable[[], int],
        *,
        advised: bool,
        plan: Plan = CARRY_PLAN,
        path: tuple[Move, ...] = PATH,
    ) -> None:
        super().__init__(publish, requests, plan)
        self.scales: list[float] = []
        self._move, self._arrived, self._advised, self._path = move, arrived, advised, path
        self._since_ns: int | None = None

    def _keep_to_plan(self, now_s: float, client: GripClient) -> None:
        if self.report.activated_ns is None:
            client.object_set(OBJECT)
        super()._keep_to_plan(now_s, client)
        now_ns = time.monotonic_ns()
        if self.report.closed_ns is None or self._since_ns is None or self._arrived() < len(self.scales):
            self._since_ns = now_ns
        elif self.report.opened_ns is not None:
            if now_ns - self.report.opened_ns > END_S * 1e9:
                self.end()
        elif now_ns - self._since_ns > STILL_S * 1e9:
            self._go_on(client, now_ns)

    def _go_on(self, client: GripClient, now_ns: int) -> None:
        """Begin the next move, or let go at the end of the path."""
        if len(self.scales) == len(self._path):
            client.gripper_open(drop=True)
            self.report.opened_ns = now_ns
            return
        move = self._path[len(self.scales)]
        scale, why = self._advice(client, move)
        self.report.moves.append((now_ns, f"{move.name} at {scale:.0%} of full speed ({why})"))
        self.scales.append(scale)
        self._move(scale)

    def _advice(self, client: GripClient, move: Move) -> tuple[float, str]:
        """Return the scale of a move, and why."""
        if not self._advised:
            return 1.0, "without advice"
        reply = client.motion_check(move.points())
        if not reply["time_scale"]:
            return FLOOR, reply["unknown"] or "the grip hardly holds it at rest"
        scale: float = reply["time_scale"]
        return scale, "the grip holds it" if scale >= 1.0 else f"{reply['mode']} of {reply['finger']} limits it"

    def _raise_grip(self, client: GripClient) -> None:
        """Keep the force: it is the largest that the glass may feel."""
