"""Permission for one motion: a gripper session carries out a permit and nothing else.

Only the motion gate (`slipd.gripper.motion_gate`) issues permits, after it has judged an intent against every rule in
docs/grip_rules.md. This module is a leaf, so that sessions depend on the permit and not on the gate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

MotionKind = Literal["activate", "move", "set_force", "halt"]


@dataclass(frozen=True, slots=True)
class Permit:
    """One permitted motion.

    Attributes:
        kind: "activate" (the gripper may open and close fully), "move" (to ``width_m`` with ``force_n``), "set_force"
            (to ``force_n`` at the width last sent) or "halt" (the fingers stop where they are).
        width_m: Width between the pads to move to, m; None unless ``kind`` is "move".
        speed_mps: Speed of the move, m/s; None: the default speed of the session.
        force_n: Force on one pad, N; None for "activate" and "halt".
    """

    kind: MotionKind
    width_m: float | None = None
    speed_mps: float | None = None
    force_n: float | None = None
