"""Every message that the daemon publishes: one frozen class for each topic, with its fields.

What is not known is None, words of fixed lists are enums, and vectors are tuples. Units end the names. Forces and
torques are those on the finger by the object, in the frame that the message names; "grip force" is the normal force on
one pad. Fields that a newer daemon adds are in ``raw``; fields that an older daemon does not send have their default.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from slipd_client.messages.fields import Pair, Sextuple, Triple, wire
from slipd_client.messages.names import PROTOCOL_VERSION, SlipLevel
from slipd_client.messages.parts import (
    MU,
    MU_D,
    MU_HIGH,
    MU_LOW,
    MU_SOURCE,
    TARE_AGE,
    TARE_ORIGIN,
    DaemonState,
    GripperState,
    HeldObject,
)

if TYPE_CHECKING:
    from slipd_client.clock import ServerClock


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One message of the daemon. A topic that this client does not know has this class.

    Attributes:
        topic: E.g. ``slip.left``.
        raw: The map as it arrived.
        missed: Number of messages of this topic that were published just before this one and did not arrive.
        restarted: The daemon was restarted since the previous message of any topic.
    """

    topic: str
    raw: dict[str, Any] = field(repr=False)
    missed: int = 0
    restarted: bool = False
    v: int = wire("version of this API: 1", default=PROTOCOL_VERSION)
    seq: int = wire("number of the message in its topic, counting up by one: a gap means that messages were lost")
    boot: str = wire("id of this run of the daemon; where it changes, `seq` restarts")
    t_ns: int = wire("when the readings that the message is about were acquired")
    timestamp: float | None = wire(
        "the same instant in s since 1970, by the wall clock as it was at the daemon's start", default=None
    )
    frame: str | None = wire("frame of the vectors; empty where there are none", default=None)
    config_id: str | None = wire("changes with the config", default=None)

    @property
    def age_s(self) -> float:
        """Seconds since the readings were acquired, for a daemon on this machine; for others see `age_by`.

        It grows where a program reads more slowly than the daemon publishes.
        """
        return (time.monotonic_ns() - self.t_ns) * 1e-9

    def age_by(self, clock: ServerClock) -> float | None:
        """Return the age for a daemon on another machine; None while the clock of its ``GripClient`` is unknown."""
        local_ns = clock.local_ns(self.t_ns)
        return None if local_ns is None else (time.monotonic_ns() - local_ns) * 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip(Message):
    """``slip.<finger>``: the verdict on one contact."""

    finger: str = wire("name of the finger, `[a-z0-9]`, 1 to 32 characters")
    level: SlipLevel = wire("how close the contact is to slipping; see below")
    level_code: int | None = wire("the level as a number, 0 to 5, in the order below", default=None)
    reasons: tuple[str, ...] = wire("why, the most important first; see below", default=())
    evidence: tuple[str, ...] = wire(
        "what shows that the object moves, see below; empty where nothing does", default=()
    )
    force_unit: str | None = wire(
        '"N", or "uncalibrated": forces are in the unit of an uncalibrated pad, or raw values of the sensor',
        default=None,
    )
    normal_n: float | None = wire("normal force, positive when pressed", nil=True)
    tangential_n: Pair | None = wire("tangential force", nil=True)
    spin_nm: float | None = wire("torque about the pad's normal through the contact centroid", nil=True)
    centroid_m: Pair | None = wire("contact centroid", nil=True)
    centroid_std_m: Pair | None = wire("standard deviation of the contact centroid", nil=True)
    centroid_residual_m: float | None = wire(
        "distance from the contact centroid to the centroid of the loads on the taxels", nil=True
    )
    friction_ratio: float | None = wire("tangential force over normal force", nil=True)
    friction_ratio_std: float | None = wire("standard deviation of the friction ratio", nil=True)
    gravity: str | None = wire(
        'the finger\'s own weight: "none" (the config gives no `mass_kg`), "compensated", or "unknown_orientation" '
        "(its possible pull is part of the uncertainties)",
        nil=True,
    )
    mu: float | None = wire(MU, nil=True)
    mu_source: str | None = wire(MU_SOURCE, default=None)
    mu_low: float | None = wire(MU_LOW, nil=True)
    mu_high: float | None = wire(MU_HIGH, nil=True)
    mu_d: float | None = wire(MU_D, nil=True)
    required_friction: float | None = wire(
        "coefficient of friction at which this load would just slip; known also where `mu` is not", nil=True
    )
    carried_friction: float | None = wire(
        "largest `required_friction` that this grasp has carried without motion; nil before the first", nil=True
    )
    relative_utilisation: float | None = wire(
        "`required_friction` over `carried_friction`: above 1 the load is larger than any that this grasp is known to "
        "hold",
        nil=True,
    )
    utilisation: float | None = wire("load over the load at which the contact slips: it slips at 1", nil=True)
    utilisation_lower: float | None = wire("certified lower bound of the utilisation", nil=True)
    utilisation_upper: float | None = wire("certified upper bound of the utilisation", nil=True)
    torque_limit_nm: float | None = wire(
        "torque in the sense of the spin that friction can carry together with the tangential force", nil=True
    )
    pole_m: Pair | None = wire(
        "point about which the contact would turn when it slips; nil where it would translate", nil=True
    )
    tipping_margin_m: float | None = wire(
        "distance of the contact centroid from the edge of the contact, negative outside", nil=True
    )
    tipping_margin_std_m: float | None = wire("uncertainty of the tipping margin", nil=True)
    grip_needed_n: float | None = wire(
        "least grip force that holds this load with the configured safety; nil also where no grip force would", nil=True
    )
    model: str | None = wire('"none", "translation" (force alone) or "exact" (force and spin)', default=None)
    tare_id: int | None = wire("tare in use; 0 is the config's", default=None)
    tare_origin: str | None = wire(TARE_ORIGIN, nil=True)
    tare_age_s: float | None = wire(TARE_AGE, nil=True)
    reading_age_s: float | None = wire(
        "age of the force reading at publication; nil before the first", key="age_s", nil=True
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipWarning(Message):
    """``warning``: the level of one finger has changed."""

    finger: str = wire("name of the finger")
    level: SlipLevel = wire("the new level, as in `slip`")
    level_code: int | None = wire("the new level as a number", default=None)
    reasons: tuple[str, ...] = wire("as in `slip`", default=())
    evidence: tuple[str, ...] = wire("as in `slip`", default=())
    previous: SlipLevel = wire("the level before")
    rising: bool = wire('the new level is more alarming; "unknown" ranks between "stable" and "caution"')
    utilisation: float | None = wire("as in `slip`", nil=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench(Message):
    """``wrench.<finger>``: the force on one finger, tared, in the pad's frame."""

    finger: str = wire("name of the finger")
    force_unit: str | None = wire("as in `slip`", default=None)
    force_n: Triple | None = wire("force", nil=True)
    torque_nm: Triple | None = wire("torque about the frame's origin", nil=True)
    normal_n: float | None = wire("−Z of `force_n`: positive when pressed", nil=True)
    tangential_n: Pair | None = wire("X and Y of `force_n`", nil=True)
    status: tuple[str, ...] = wire(
        'what the sensor reports, e.g. "overload"; empty when it reports no fault', default=()
    )
    tare_id: int | None = wire("tare in use; 0 is the config's", default=None)
    reading_age_s: float | None = wire("age of the reading at publication; nil before the first", key="age_s", nil=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tactile(Message):
    """``tactile.<finger>``: the image of one pad."""

    finger: str = wire("name of the finger")
    rows: int = wire("rows of taxels")
    cols: int = wire("columns of taxels")
    pitch_m: float | None = wire("distance of neighbouring taxels", default=None)
    rows_along: str | None = wire(
        'direction of the pad\'s frame in which the row index grows: "+x", "-x", "+y" or "-y"', default=None
    )
    cols_along: str | None = wire("direction in which the column index grows, likewise", default=None)
    tare_id: int | None = wire("tare of the pad in use; 0 is the config's", default=None)
    tare_origin: str | None = wire("as in `slip`, of the pad", nil=True)
    tare_age_s: float | None = wire("as in `slip`, of the pad", nil=True)
    image_ok: bool = wire("the image can be used; where it can not, loads and shape are nil", default=False)
    image_reasons: tuple[str, ...] = wire("why the image cannot be used, see below; empty if it can", default=())
    force_unit: str | None = wire("as in `slip`, of the image", default=None)
    loads_n: tuple[float, ...] | None = wire(
        "normal force on each taxel in scan order, `rows` × `cols` numbers, 0 below the threshold", nil=True
    )
    active: int | None = wire("number of loaded taxels", nil=True)
    area_m2: float | None = wire("area of the loaded taxels", nil=True)
    centroid_m: Pair | None = wire("centre of pressure; nil where nothing presses", nil=True)
    axis_rad: float | None = wire("direction of the longer axis, −π/2 to π/2 from X; nil where there is none", nil=True)
    elongation: float | None = wire(
        "ratio of the axes, at least 1; nil where nothing presses, or only a single line of taxels", nil=True
    )
    holes: int | None = wire("number of unloaded regions inside the contact", nil=True)
    corners_m: tuple[Pair, ...] | None = wire("corners of the outline, counter-clockwise", nil=True)
    status: tuple[str, ...] = wire("what the pad reports; empty when it reports no fault", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp(Message):
    """``grasp``: both fingers together."""

    fingers: tuple[str, ...] = wire(
        'names of both fingers in the order of the config: "first" and "second" below', default=()
    )
    state: str | None = wire(
        '"empty" (a pad is free, and nothing was held or slipd was asked to open), "held" (both pads press, on an '
        'object or on each other), "slipping", "lost" (a pad is free that pressed, although slipd was not asked to '
        'open), or "unknown" (not known of both pads). It stays "lost" until both pads press again, or until slipd is '
        'asked to open; a moment in which neither pad is known is "unknown". Where the config has no gripper, slipd '
        'sees no opening, and every grasp ends as "lost"',
        default=None,
    )
    state_t_ns: int | None = wire(
        'when that state began; of "lost" the moment of the loss, also after an "unknown" moment', default=None
    )
    level: SlipLevel = wire(
        'level of the worse finger, as in `slip`; "unknown" is worse than "stable" and less alarming than "caution"'
    )
    level_code: int | None = wire("the level as a number", default=None)
    reasons: tuple[str, ...] = wire("reasons of every finger at that level", default=())
    evidence: Mapping[str, tuple[str, ...]] = wire("finger → its evidence, as in `slip`", default={})
    internal_n: float | None = wire(
        "grip force: the part of the two normal forces that cancels, which is the smaller one; 0 where a pad is "
        "not pressed",
        nil=True,
    )
    grip_needed_n: float | None = wire(
        "least `internal_n` with which both fingers hold their load with their configured safety; nil also where "
        "that of one finger is not known (no contact, no fresh image, no friction coefficient) or no grip force "
        "would hold",
        nil=True,
    )
    utilisation: float | None = wire(
        "the larger utilisation of the two, 1 slips; nil where either is not known, or no grip force holds", nil=True
    )
    external_force_n: Triple | None = wire(
        "force of the world on the object: its weight and every contact except the pads, less mass times acceleration "
        "while the arm moves it",
        nil=True,
    )
    external_torque_nm: Triple | None = wire(
        "torque of the world on the object about the frame's origin; nil also where `width_m` is nil or beyond the "
        "config's positions, and where a sensor measures no torque",
        nil=True,
    )
    load_share: Mapping[str, float] | None = wire(
        "finger → its share of the tangential load, 0 to 1, together 1; nil where both together carry less than "
        "the larger `min_normal_n`",
        nil=True,
    )
    asymmetry: float | None = wire(
        "first minus second normal force over their sum, −1 to 1: 0 is even, 1 means that only the first is "
        "pressed; nil where neither reaches the larger `min_normal_n`",
        nil=True,
    )
    width_m: float | None = wire("width between the pads; nil where the gripper does not report it", nil=True)
    object: HeldObject | None = wire(
        "estimate of the held object: `mass_kg`, `mass_std_kg`, `com_m`, `com_std_m`, `inertia_kgm2`, "
        "`inertia_std_kgm2` and `unknown`, see [the arm's motion](arm.md#the-object)",
        default=None,
    )
    reading_age_s: float | None = wire(
        "age of the older of the two force readings at publication; nil before the first of either",
        key="age_s",
        nil=True,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion(Message):
    """``motion``: how fast the arm may go with the present grip. None: not known, never "free"."""

    finger: str | None = wire("finger that limits the acceleration", nil=True)
    mode: str | None = wire('what would happen first: "translation", "rotation" or "tipping"', nil=True)
    utilisation: float | None = wire(
        "of the worse finger by its load now, with the low bound of friction; nil also where no grip holds it", nil=True
    )
    acceleration_limit_mps2: float | None = wire("largest acceleration that holds in every direction", nil=True)
    worst_direction: Triple | None = wire("direction of the acceleration that is limited to this", nil=True)
    acceleration_limits_mps2: Sextuple | None = wire(
        "largest acceleration along +x, −x, +y, −y, +z and −z, at most 5 g", nil=True
    )
    turn_utilisation: float | None = wire(
        "utilisation at rest in the worst orientation; nil also where no grip holds it", nil=True
    )
    worst_gravity_mps2: Triple | None = wire("gravity in that orientation", nil=True)
    angular_acceleration_limit_radps2: float | None = wire(
        "largest angular acceleration about the line through both pads, in either sense, at most 200", nil=True
    )
    safety: float = wire("safety factor of these limits: the larger `grip_safety` of both fingers")
    grip_needed_n: float | None = wire(
        "grip force with which `wanted_acceleration_mps2` holds in every direction; nil also where no grip force would",
        nil=True,
    )
    wanted_acceleration_mps2: float = wire("as in `[grasp.motion]` of the config")
    speed_scale: float | None = wire(
        "time scale, 0 to 1, at which the larger of that and the arm's acceleration now holds in every direction: "
        "accelerations fall by its square. 0: nothing holds",
        nil=True,
    )
    unknown: str | None = wire("why all of this is not known, for people; nil where it is", nil=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gripper(Message, GripperState):
    """``gripper``: state of the gripper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Status(Message, DaemonState):
    """``status``: the daemon, its fingers and its streams."""


TOPICS: dict[str, type[Message]] = {
    "slip": Slip,
    "warning": SlipWarning,
    "wrench": Wrench,
    "tactile": Tactile,
    "grasp": Grasp,
    "motion": Motion,
    "gripper": Gripper,
    "status": Status,
}
"""Class of each topic, by the topic's first word."""

TOPICS_OF_FINGERS = ("slip", "wrench", "tactile")
"""Topics that each finger has: a dot and the finger's name follow the word."""
