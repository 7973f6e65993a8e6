"""Input of the grip gate: the wanted motion and the situation in which it is judged; plain and immutable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from slipd.gripper.grip_policy import GripLimits, GripState

IntentKind = Literal["activate", "open", "close", "set", "adjust", "reflex", "hold", "stop", "lease_end"]
Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Intent:
    """A wanted motion or change of force.

    Attributes:
        kind: What is wanted. "reflex" is a raise or lowering by the reflex, "lease_end" the end of a lease that its
            holder did not give back.
        who: The client; None: the daemon itself.
        width_now_m: Width between the pads, m; None: not known.
        width_wanted_m: Width to move to, m; None: as far as possible, or no change of width.
        force_in_force_n: Force on one pad that is in force, N; None: nothing is gripped, or it is not known.
        force_wanted_n: Requested force on one pad, N; None: no force is requested.
        force_applied_n: Force of the gripper setting that would be sent, N; at most ``force_wanted_n``.
        speed_mps: Speed, m/s; None: the gripper's default.
        drop: The client accepts that something may fall.
    """

    kind: IntentKind
    who: bytes | None = None
    width_now_m: float | None = None
    width_wanted_m: float | None = None
    force_in_force_n: float | None = None
    force_wanted_n: float | None = None
    force_applied_n: float | None = None
    speed_mps: float | None = None
    drop: bool = False


@dataclass(frozen=True, slots=True)
class GripperState:
    """What the gripper reports, what it can do, and where it was sent; ranges are (least, largest).

    Attributes:
        answers: It sends readings.
        active: It accepts commands.
        activating: An activation is under way.
        fault: The fault that it reports, or "".
        moving: The fingers move, or a move was sent and no reading has come since.
        goals_m: Narrowest and widest goal of the moves that may be under way, m; a newer command may or may not have
            replaced an older one before it was sent. None: the fingers rest, or their goal is not known.
        closed_to_m: Commanded width of the grip in force, m; None: not known.
        width_range_m: Widths between the pads, m; (0, inf) while it has not reported them.
        speed_range_mps: Speeds, m/s; None: the gripper accepts no speed.
        force_range_n: Forces on one pad, N; (0, inf) while it has not reported them.
        force_acknowledged_n: Force on one pad that the gripper acknowledged last, N; None: none since the activation.
        stops_at_lease_end: The config wants moving fingers stopped at the end of a lease.
    """

    answers: bool
    active: bool
    activating: bool
    fault: str
    moving: bool
    goals_m: Range | None
    closed_to_m: float | None
    width_range_m: Range
    speed_range_mps: Range | None
    force_range_n: Range
    force_acknowledged_n: float | None = None
    stops_at_lease_end: bool = False


@dataclass(frozen=True, slots=True)
class Situation:
    """Everything that a decision depends on.

    Attributes:
        limits: Limits from the config.
        grip: Lease, force in force, remaining slew and budget, latched fault.
        gripper: State of the gripper.
        blind: Fingers whose sensors are stale or not trusted.
        not_free: Fingers that are pressed, or are not known to be free.
    """

    limits: GripLimits
    grip: GripState
    gripper: GripperState
    blind: tuple[str, ...] = ()
    not_free: tuple[str, ...] = ()

    @property
    def least_n(self) -> float:
        """Least force on one pad that the gripper may be sent, N."""
        return max(self.gripper.force_range_n[0], self.limits.min_n)
