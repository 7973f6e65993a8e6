"""What the robot program of the demo did and received."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

ALARMING = ("warning", "slipping")
"""Levels that call for more grip force."""


@dataclass
class Change:
    """A change of level that the program received.

    Attributes:
        t_ns: Time of the reading that changed the level, CLOCK_MONOTONIC.
        received_ns: When the program received the message, CLOCK_MONOTONIC.
        finger: Name of the finger.
        level: The new level.
        rising: Whether the new level is more alarming than the one before.
        reasons: Reasons of the new level.
        utilisation: Utilisation of that reading; None if unknown.
    """

    t_ns: int
    received_ns: int
    finger: str
    level: str
    rising: bool
    reasons: list[str]
    utilisation: float | None


@dataclass
class Raise:
    """A request for more grip force, one step of a raise.

    Attributes:
        requested_ns: When the request was sent, CLOCK_MONOTONIC.
        requested_n: The requested force, N on one pad.
        result: Result in the reply; None if the daemon refused.
        refusal: Why the daemon refused; "" if it did not.
        before_n: Measured grip force before the request, N; None if unknown.
        after_n: Measured grip force shortly after it, N; None if unknown.
    """

    requested_ns: int
    requested_n: float
    result: dict[str, Any] | None
    refusal: str
    before_n: float | None
    after_n: float | None = None


@dataclass
class Report:
    """What the program did and received; times are CLOCK_MONOTONIC, None if it did not happen.

    Attributes:
        tares: Result of each tare, by finger.
        activated_ns: When the program activated the gripper: about the start of the scene.
        closed_ns: When the program closed the gripper.
        opened_ns: When the program opened the gripper.
        changes: Every change of level since the gripper closed.
        raises: Every step that raised the grip force.
        refusals: Every other refusal, as text.
        error: What ended the program early; "" if nothing did.
    """

    tares: dict[str, dict[str, Any]] = field(default_factory=dict)
    activated_ns: int | None = None
    closed_ns: int | None = None
    opened_ns: int | None = None
    changes: list[Change] = field(default_factory=list)
    raises: list[Raise] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)
    error: str = ""

    @property
    def rotation_warning(self) -> Change | None:
        """The first warning of rotation."""
        return next((c for c in self.changes if c.rising and c.level in ALARMING and "rotation" in c.reasons), None)

    @property
    def slip_report(self) -> Change | None:
        """The first report of a slip."""
        return next((change for change in self.changes if "slip_detected" in change.reasons), None)
