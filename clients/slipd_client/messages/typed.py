"""The messages as Python sees them: one frozen class a topic, with the fields of ``docs/protocol.md``.

Made for programs that steer: what is not known is None, words of fixed lists are enums, vectors are tuples.
Fields that a newer daemon adds stand in ``raw``; fields that an older one does not send are None.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from slipd_client.messages.names import Health

Pair = tuple[float, float]
Triple = tuple[float, float, float]


class SlipLevel(str, Enum):
    """How near a contact is to slipping; each is also its word (``level == "warning"``)."""

    NO_CONTACT = "no_contact"
    STABLE = "stable"
    CAUTION = "caution"
    WARNING = "warning"
    SLIPPING = "slipping"
    UNKNOWN = "unknown"

    @property
    def alarming(self) -> bool:
        """Something must be done: it is about to slip or slips. Unknown is not alarming, and not safe either."""
        return self in (SlipLevel.WARNING, SlipLevel.SLIPPING)

    def __str__(self) -> str:
        return str(self.value)


class Clock(Protocol):
    """Tells the daemon's times in this machine's; `slipd_client.clock.ServerClock` is one."""

    def local_ns(self, server_ns: int) -> int:
        """What this machine's CLOCK_MONOTONIC shows when the daemon's shows ``server_ns``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One message of the daemon; by itself it stands for topics that this client does not know.

    Attributes:
        topic: E.g. ``slip.left``.
        raw: The map as it came.
        missed: Messages of this topic that were published just before this one and did not arrive.
        restarted: The daemon was started anew since the message before, of whatever topic.
        seq: Number of the message in its topic.
        boot: Id of the daemon's run.
        t_ns: When what it tells was acquired, CLOCK_MONOTONIC of the daemon's machine.
        timestamp: The same instant, s since 1970.
        frame: Frame of the vectors.
        config_id: Changes with the config.
    """

    topic: str
    raw: dict[str, Any] = field(repr=False)
    missed: int = 0
    restarted: bool = False
    seq: int
    boot: str
    t_ns: int
    timestamp: float | None = None
    frame: str | None = None
    config_id: str | None = None

    @property
    def age_s(self) -> float:
        """Seconds since what it tells was acquired, where the daemon runs on this machine; else see `age_by`.

        A program that reads more slowly than the daemon publishes gets old messages, and sees it here.
        """
        return (time.monotonic_ns() - self.t_ns) * 1e-9

    def age_by(self, clock: Clock) -> float:
        """The same for a daemon on another machine, by the clock that a ``GripClient`` keeps of it."""
        return (time.monotonic_ns() - clock.local_ns(self.t_ns)) * 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip(Message):
    """``slip.<finger>``: the verdict on one contact. Forces on the finger by the object, in the pad's frame."""

    finger: str
    level: SlipLevel
    reasons: tuple[str, ...] = ()
    force_unit: str | None = None
    normal_n: float | None = None
    tangential_n: Pair | None = None
    spin_nm: float | None = None
    centroid_m: Pair | None = None
    centroid_std_m: Pair | None = None
    centroid_residual_m: float | None = None
    friction_ratio: float | None = None
    friction_ratio_std: float | None = None
    gravity: str | None = None
    mu: float | None = None
    mu_source: str | None = None
    utilisation: float | None = None
    utilisation_lower: float | None = None
    utilisation_upper: float | None = None
    torque_limit_nm: float | None = None
    pole_m: Pair | None = None
    tipping_margin_m: float | None = None
    tipping_margin_std_m: float | None = None
    grip_needed_n: float | None = None
    model: str | None = None
    tare_id: int | None = None
    reading_age_s: float | None = field(default=None, metadata={"wire": "age_s"})


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipWarning(Message):
    """``warning``: the level of one finger has changed."""

    finger: str
    level: SlipLevel
    previous: SlipLevel
    rising: bool
    reasons: tuple[str, ...] = ()
    utilisation: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench(Message):
    """``wrench.<finger>``: the force on one finger, tared, in the pad's frame."""

    finger: str
    force_unit: str | None = None
    force_n: Triple | None = None
    torque_nm: Triple | None = None
    normal_n: float | None = None
    tangential_n: Pair | None = None
    status: tuple[str, ...] = ()
    tare_id: int | None = None
    reading_age_s: float | None = field(default=None, metadata={"wire": "age_s"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Tactile(Message):
    """``tactile.<finger>``: the image of one pad; ``loads_n`` in scan order, ``rows`` × ``cols``."""

    finger: str
    rows: int
    cols: int
    pitch_m: float | None = None
    tare_id: int | None = None
    image_ok: bool = False
    image_reasons: tuple[str, ...] = ()
    force_unit: str | None = None
    loads_n: tuple[float, ...] | None = None
    active: int | None = None
    area_m2: float | None = None
    centroid_m: Pair | None = None
    axis_rad: float | None = None
    elongation: float | None = None
    holes: int | None = None
    corners_m: tuple[Pair, ...] | None = None
    status: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp(Message):
    """``grasp``: both fingers together; the external wrench is what the world does to the object between them.

    ``load_share`` is the share of the tangential load by finger; ``internal_n`` and ``grip_needed_n`` are forces on
    one pad.
    """

    fingers: tuple[str, ...] = ()
    level: SlipLevel
    reasons: tuple[str, ...] = ()
    internal_n: float | None = None
    grip_needed_n: float | None = None
    utilisation: float | None = None
    external_force_n: Triple | None = None
    external_torque_nm: Triple | None = None
    load_share: Mapping[str, float] | None = None
    asymmetry: float | None = None
    width_m: float | None = None
    reading_age_s: float | None = field(default=None, metadata={"wire": "age_s"})


@dataclass(frozen=True, slots=True)
class LeaseStatus:
    """Who may move the gripper: ``held`` by some client, for ``expires_in_s`` unless it renews."""

    held: bool
    expires_in_s: float | None = None


@dataclass(frozen=True, slots=True)
class ReflexAct:
    """What the reflex has just done: the force on one pad that it commands, the one before, and why."""

    force_n: float | None = None
    from_n: float | None = None
    reason: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Gripper(Message):
    """``gripper``: state of the gripper; forces are those on one pad. ``reflex`` is None but where it acted."""

    width_m: float | None = None
    force_command_n: float | None = None
    force_limit_n: float | None = None
    active: bool | None = None
    object: str | None = None
    moving: bool | None = None
    fault: str | None = None
    latched_fault: str | None = None
    echo_ok: bool | None = None
    current_a: float | None = None
    force_n: float | None = None
    lease: LeaseStatus | None = None
    reflex: ReflexAct | None = None
    reading_age_s: float | None = field(default=None, metadata={"wire": "age_s"})


@dataclass(frozen=True, slots=True)
class FingerStatus:
    """A finger as ``status`` tells it."""

    level: SlipLevel
    reasons: tuple[str, ...] = ()
    tare_id: int | None = None
    tare_busy: bool | None = None
    mu: float | None = None
    mu_source: str | None = None
    mu_by: str | None = None
    mu_t_ns: int | None = None


@dataclass(frozen=True, slots=True)
class StreamStatus:
    """A stream as ``status`` tells it; its further counters stand in the ``raw`` of the message."""

    health: Health
    message: str | None = None
    hardware_id: str | None = None
    expected_hz: float | None = None
    rate_hz: float | None = None
    age_s: float | None = None
    samples: int | None = None
    bad: int | None = None
    lost: int | None = None
    reconnects: int | None = None
    tare_id: int | None = None
    tare_busy: bool | None = None


@dataclass(frozen=True, slots=True)
class RecordingStatus:
    """A recording; ``name`` is None for that of the whole run.

    ``state`` is "none", "running", "stopped" (as asked), "limited" (ended in good order by a limit) or "failed";
    ``failure`` is why it ended by itself, None where it did not; ``lost`` counts entries that are not in its file.
    """

    name: str | None = None
    path: str | None = None
    state: str | None = None
    running: bool | None = None
    failure: str | None = None
    lost: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Status(Message):
    """``status``: the daemon, its fingers and its streams."""

    version: str | None = None
    uptime_s: float | None = None
    late_s: float | None = None
    lease: LeaseStatus | None = None
    recording: RecordingStatus | None = None
    run_recording: RecordingStatus | None = None
    fingers: Mapping[str, FingerStatus] = field(default_factory=dict)
    streams: Mapping[str, StreamStatus] = field(default_factory=dict)
