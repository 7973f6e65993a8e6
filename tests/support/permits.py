"""Permits for tests of gripper sessions, each handed over in one call."""

from __future__ import annotations

from slipd.devices import GripperSession
from slipd.types.permit import Permit


def activate(session: GripperSession, now_ns: int = 0) -> bool:
    return session.execute(Permit("activate"), now_ns)


def move(session: GripperSession, width_m: float, speed_mps: float | None, force_n: float) -> float | None:
    """Return the force that will be in force; None where the move is refused."""
    return session.force_sent_n if session.execute(Permit("move", width_m, speed_mps, force_n), 0) else None


def set_force(session: GripperSession, force_n: float) -> float | None:
    """Return the force that will be in force; None where it is refused."""
    return session.force_sent_n if session.execute(Permit("set_force", force_n=force_n), 0) else None


def halt(session: GripperSession) -> bool:
    return session.execute(Permit("halt"), 0)
