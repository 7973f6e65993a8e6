"""Permission for one motion, or the refusal of a request.

A gripper session carries out a permit and nothing else. Only the grip gate (`slipd.gripper.grip_gate`) issues
permits, after it has judged an intent against every rule in docs/grip_rules.md. This module is a leaf, so that sessions
depend on the permit and not on the gate, and every room can refuse.
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


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request is refused.

    Attributes:
        code: Error code of the message API.
        message: The rule, and what was found.
        field: Field of the request at fault; "" if none is.
    """

    code: str
    message: str
    field: str = ""


class RefusalError(Exception):
    """Ends the handling of a request that is refused; arguments and ``refusal`` as in `Refusal`."""

    def __init__(self, code: str, message: str, field: str = "") -> None:
        super().__init__(message)
        self.refusal = Refusal(code, message, field)


def require(refusal: Refusal | None) -> None:
    """Go on unless there is a refusal.

    Raises:
        RefusalError: There is one.
    """
    if refusal is not None:
        raise RefusalError(refusal.code, refusal.message, refusal.field)
