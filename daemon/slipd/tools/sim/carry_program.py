"""The robot program of the scene ``carry``: a grip that must not rise, and moves at the speed that it holds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from slipd.tools.sim.carry import PATH, Move
from slipd.tools.sim.robot_program import Plan, RobotProgram
from slipd_client.grip import GripClient

GRIP_N = 5.0
"""Largest grip force that the glass may feel, N on one pad."""

CARRY_PLAN = Plan(force_n=GRIP_N, limit_n=GRIP_N, open_s=math.inf, end_s=90.0)

FLOOR = 0.45
"""Scale of the speed while slipd does not know what the grip holds."""

STILL_S = 0.8
"""Rest before a move, s: the glass ceases to swing, and the load is weighed."""

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
    ) -> None:
        super().__init__(publish, requests, plan)
        self.scales: list[float] = []
        self._move, self._arrived, self._advised = move, arrived, advised
        self._since_ns: int | None = None

    def _keep_to_plan(self, now_s: float, client: GripClient) -> None:
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
        if len(self.scales) == len(PATH):
            client.gripper_open(drop=True)
            self.report.opened_ns = now_ns
            return
        move = PATH[len(self.scales)]
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
