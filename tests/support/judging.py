"""The grip gate for tests of the grip policy alone: a ready gripper, and fingers that are trusted and free."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from slipd.gripper.grip_gate import judge
from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.intent import GripperState, Intent, IntentKind, Situation
from slipd.types.permit import Permit, Refusal

LIMITS = GripLimits(min_n=3.0, max_n=25.0, step_n=2.0, raise_n_per_s=10.0, lower_n_per_s=2.0, budget_n=12.0)
READY = GripperState(
    answers=True,
    active=True,
    activating=False,
    fault="",
    moving=False,
    goals_m=None,
    closed_to_m=0.0,
    width_range_m=(0.0, 0.085),
    speed_range_mps=(0.02, 0.15),
    force_range_n=(0.0, math.inf),
)


def situation(policy: GripPolicy, t_ns: int, **gripper: Any) -> Situation:
    """What the gate sees of a policy, beside a gripper that is ready but for what ``gripper`` says."""
    return Situation(policy.limits, policy.state(t_ns), replace(READY, **gripper))


def ask(
    policy: GripPolicy, kind: IntentKind, force_n: float, t_ns: int, *, who: bytes | None = None, **gripper: Any
) -> Refusal | Permit | None:
    """Judge a force that ``who`` wants; without, somebody has the lease just for the question."""
    seen = situation(policy, t_ns, **gripper)
    if who is None:
        who = seen.grip.holder or b"somebody"
        seen = replace(seen, grip=replace(seen.grip, holder=who))
    intent = Intent(kind, who, 0.05, None, policy.force_n, force_n, force_n)
    return judge(intent, seen)


def code(refusal: Refusal | None) -> str | None:
    """Return the code of a refusal; None without one."""
    return None if refusal is None else refusal.code
