"""Gripper control over a session that keeps its commands, and the calls that its tests repeat."""

from __future__ import annotations

import math
from typing import Any

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.intent import IntentKind
from slipd.types.permit import Permit
from slipd.types.refusal import Refusal
from slipd.types.samples import GripperSample

MS = 1_000_000
T0 = 100_000_000_000


def reading(width_m: float | None = 0.085, t_ns: int = T0, **changes: Any) -> GripperSample:
    usual = {"active": True, "moving": False, "object": "none", "fault": "", "echo_ok": True}
    return GripperSample(t_ns, None, width_m=width_m, **(usual | changes))


class Recorded:
    """A gripper session that keeps every command; it rounds to half newtons and whole millimetres.

    With ``takes`` false it refuses every command.
    """

    identity, state = "", "running"

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.takes = True
        self.command_lost = self.activating = False
        self.commands: list[tuple[Any, ...]] = []
        self.width_range_m = (0.0, 0.085)
        self.speed_range_mps: tuple[float, float] | None = (0.02, 0.15)
        self.force_range_n = (3.0, 28.5)
        self.force_sent_n: float | None = None
        self.has: float | None = None  # the part of it that was sent
        self.force_acknowledged_n: float | None = None

    def start(self, now_ns: int) -> bytes:
        return b""

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        return []

    def next_deadline(self) -> int | None:
        return None

    def on_time(self, now_ns: int) -> bytes:
        return b""

    def stop(self) -> bytes:
        return b""

    def applied_n(self, force_n: float) -> float:
        return math.floor(2.0 * force_n) / 2.0

    def execute(self, permit: Permit, now_ns: int) -> bool:
        if permit.kind == "activate":
            self.commands.append(("activate",))
            return True
        if permit.kind == "halt":
            self.commands.append(("halt",))
            self.drop()
            return self.takes
        assert permit.force_n is not None
        if permit.width_m is None:
            self.commands.append(("force", permit.force_n))
        else:
            self.commands.append(("move", round(permit.width_m, 3), permit.speed_mps, permit.force_n))
        if self.takes:
            self.force_sent_n = self.applied_n(permit.force_n)
        return self.takes

    def send(self) -> None:
        """What waits is sent."""
        self.has = self.force_sent_n

    def drop(self) -> bool:
        dropped, self.force_sent_n = self.force_sent_n != self.has, self.has
        return dropped

    def acknowledge(self) -> None:
        self.commands.append(("acknowledge",))


def ask(control: GripperControl, kind: IntentKind, t_ns: int, **wanted: Any) -> Refusal | None:
    """A request of who holds the lease, or of somebody who has it just for this."""
    holder = control.policy.lease.holder(t_ns)
    control.policy.lease.acquire(holder or b"ann", 200, t_ns)
    found = control.carry_out(kind, t_ns, holder or b"ann", **wanted)
    if holder is None:
        control.policy.lease.release(b"ann", t_ns)
    return found


def refused(found: object) -> tuple[str, str]:
    assert isinstance(found, Refusal)
    return found.code, found.field


class Pad:
    """A finger whose contact the test sets."""

    def __init__(self, pressed: bool | None = False, force_n: float | None = None, *, feels: bool = True) -> None:
        self._pressed, self._force_n, self._feels = pressed, force_n, feels
        self.presence = self.trust = self

    def press(self, pressed: bool | None, force_n: float | None = None) -> None:
        self._pressed, self._force_n = pressed, force_n

    def is_pressed(self) -> bool | None:
        return self._pressed

    def contact_force_n(self, _: int) -> float | None:
        return self._force_n if self._pressed else None

    def for_raise(self, _: int) -> bool:
        return self._feels

    at_rest = for_raise
