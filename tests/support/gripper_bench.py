"""A gripper control over a recorded session, beside fingers whose contact a test sets, and steps of its courses."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import EllipsisType
from typing import Any

from engine_rig import GRIPPER, LEFT
from nanoseconds import MS, T0

from slipd import config
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.intent import IntentKind
from slipd.types.permit import Permit, Refusal
from slipd.types.samples import GripperSample


def reading(width_m: float | None = 0.085, t_ns: int = T0, **changes: Any) -> GripperSample:
    usual = {"active": True, "moving": False, "object": "none", "fault": "", "echo_ok": True}
    return GripperSample(t_ns, None, width_m=width_m, **(usual | changes))


class Recorded:
    """A gripper session that keeps every command; it rounds to half newtons and whole millimetres.

    With ``takes`` false it refuses every command.
    """

    def __init__(self) -> None:
        self.takes = True
        self.command_lost = self.activating = False
        self.commands: list[tuple[Any, ...]] = []
        self.width_range_m = (0.0, 0.085)
        self.speed_range_mps: tuple[float, float] | None = (0.02, 0.15)
        self.force_range_n = (3.0, 28.5)
        self.force_sent_n: float | None = None
        self.has: float | None = None  # the part of it that was sent
        self.force_acknowledged_n: float | None = None

    def applied_n(self, force_n: float) -> float:
        return math.floor(2.0 * force_n) / 2.0

    def execute(self, permit: Permit, now_ns: int) -> bool:
        if permit.kind in ("activate", "halt"):
            self.commands.append((permit.kind,))
            if permit.kind == "halt":
                self.drop()
            return self.takes or permit.kind == "activate"
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


class Pad:
    """A finger whose contact the test sets."""

    def __init__(self, pressed: bool | None = False, force_n: float | None = None) -> None:
        self._pressed, self._force_n = pressed, force_n
        self.presence = self.trust = self

    def press(self, pressed: bool | None, force_n: float | None = None) -> None:
        self._pressed, self._force_n = pressed, force_n

    def is_pressed(self) -> bool | None:
        return self._pressed

    def contact_force_n(self, _: int) -> float | None:
        return self._force_n if self._pressed else None

    def for_raise(self, _: int) -> bool:
        return True

    for_opening = for_raise

    def note_grip(self, force_n: float) -> None:
        """Only a comparison with an image needs it."""


class Bench:
    """A gripper control over a recorded session, beside fingers whose contact the test sets."""

    def __init__(self, more: str = "", *pads: Pad, heard: bool = True, **changed: str) -> None:
        text = GRIPPER + more
        for key, value in changed.items():
            text = text.replace(f"\n{key} = ", f"\n{value}\n# {key} = ")
        gripper = config.parse(LEFT + text, "rig.toml").gripper
        self.session, self.pads = Recorded(), pads or (Pad(),)
        self.control = GripperControl(gripper, self.session, dict(enumerate(self.pads)))  # type: ignore[arg-type]
        if heard:
            self.control.update(reading())

    def found(self) -> dict[str, Any]:
        """What can be seen of it."""
        control, policy, session = self.control, self.control.policy, self.session
        return {
            "force_n": policy.force_n,
            "requested_n": policy.requested_n,
            "unknown": policy.unknown,
            "grips": policy.grips,
            "fault": policy.fault,
            "holder": policy.lease.holder(T0),
            "command": control.command,
            "command_n": control.grip.command_n,
            "sample": control.sample,
            "holds": control.holds,
            "sent_n": session.force_sent_n,
            "commands": session.commands,
            "kept": control.grip.kept(),
            "conditions": [severity for severity, _ in control.conditions()],
        }


Step = Callable[[Bench], object]
Refused = tuple[str, str] | None | EllipsisType
"""Code and field; ``...``: it may be refused or not."""


def why(found: object) -> tuple[str, str] | None:
    """Return code and field of a refusal."""
    return (found.code, found.field) if isinstance(found, Refusal) else None


def be(**expected: Any) -> Step:
    """Check what can be seen, see `Bench.found`."""

    def step(bench: Bench) -> None:
        found = bench.found()
        assert {name: found[name] for name in expected} == expected

    return step


def want(kind: IntentKind, ms: float = 0, refusal: Refused = None, **wanted: Any) -> Step:
    """Ask for a motion ``ms`` after the begin, as the holder of the lease."""

    def step(bench: Bench) -> None:
        lease, t_ns = bench.control.policy.lease, T0 + round(ms * MS)
        holder = lease.holder(t_ns)
        lease.acquire(b"ann", 200, t_ns)
        found = bench.control.carry_out(kind, t_ns, b"ann", **wanted)
        if holder is None:
            lease.release(b"ann", t_ns)
        assert refusal is ... or why(found) == refusal

    return step


def close(force_n: float, ms: float = 0, refusal: Refused = None, **wanted: Any) -> Step:
    return want("close", ms, refusal, force_n=force_n, **wanted)


def seen(ms: float, width_m: float | None = 0.04, what: str = "none", **changes: Any) -> Step:
    """The gripper reports."""
    return lambda bench: bench.control.update(reading(width_m, T0 + round(ms * MS), object=what, **changes))


def held(ms: float, width_m: float | None = 0.04, **changes: Any) -> Step:
    """The gripper reports that it holds something."""
    return seen(ms, width_m, "contact_closing", **changes)


def acknowledge(refusal: Refused = None) -> Step:
    def step(bench: Bench) -> None:
        assert why(bench.control.acknowledge()) == refusal

    return step


def press(pressed: bool | None, force_n: float | None = None) -> Step:
    return lambda bench: bench.pads[0].press(pressed, force_n)


def paused(ms: int) -> Step:
    return lambda bench: bench.control.drop_after_pause(ms * MS)


def on_time(ms: float, told: bool | None = None) -> Step:
    def step(bench: Bench) -> None:
        found = bench.control.on_time(T0 + round(ms * MS))
        assert told is None or found is told

    return step


def has(**session: Any) -> Step:
    """Change the session."""
    return lambda bench: [setattr(bench.session, name, value) for name, value in session.items()]


def leased(bench: Bench) -> None:
    bench.control.policy.lease.acquire(b"ann", 200, T0)


def send(bench: Bench) -> None:
    bench.session.send()


def lose(bench: Bench) -> None:
    bench.control.lose()


def wake(bench: Bench) -> None:
    bench.control.wake()
