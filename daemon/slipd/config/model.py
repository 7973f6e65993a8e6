"""What may stand in a config file, key by key, with units and defaults."""

from __future__ import annotations

import hashlib
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr, Strict

from slipd.config.bounds import (
    MOST_FRICTION,
    DriftForce,
    DriftTime,
    DriftTorque,
    Electrode,
    ForceNoise,
    Friction,
    Grip,
    Leak,
    Mass,
    Pitch,
    Place,
    Quaternion,
    Range,
    Slew,
    SlipHold,
    SlipWindow,
    StrictModel,
    TorqueNoise,
    TorqueRange,
)
from slipd.config.grasp_model import Grasp, PadPlace, Reflex

__all__ = [
    "Bus",
    "Config",
    "Finger",
    "Grasp",
    "Gripper",
    "Levels",
    "Pad",
    "PadPlace",
    "Pose",
    "Rates",
    "Reflex",
    "Requests",
    "Slip",
    "Stream",
    "Table",
    "Wrench",
]

#: `friction.set` accepts up to this many times the configured μ, unless ``mu_max`` says otherwise.
MU_RAISE = 2.0

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
#: Nothing here comes once in an hour or a million times a second, and periods stay countable in nanoseconds.
Hertz = Annotated[float, Field(ge=1e-3, le=1e6)]
Point = Annotated[tuple[float, float], Strict(False)]  # TOML has no tuples
File = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]+$")]
Option = bool | int | float | str | list[float] | list[list[float]]
Table = Annotated[list[Point], Field(min_length=2)]


class Stream(StrictModel):
    """What every device stream has.

    Attributes:
        device: Its name in the list of devices.
        port: Path of a serial port, ``tcp://HOST:PORT``, ``udp://HOST:PORT``, ``ws://HOST:PORT``, or the endpoint to
            which other processes push.
        sensor: Which sensor, on a port that carries several; "" where it carries one.
        hardware_id: What the device says it is (`status` shows it); another device is refused. "": whichever answers
            first in a run.
        baud: Line speed of a serial port, bit/s; None: the device's own default.
        rate_hz: Readings a second that are expected.
        stale_s: Time without a reading after which the stream is stale, s; a reading that is older on arrival is stale
            too. Time in which the daemon itself stood still does not count. None: three periods, at least 20 ms.
            Raises of the grip have their own limit. For a gripper it affects only the health.
        delay_s: Known time from the acquisition of a reading to its earliest receipt, s, such as a filter's delay.
        poll_s: How often the host asks the line what came, s, where a reading may wait for that and nothing shows it:
            0.001 for most USB adapters at 1 kHz. Half of it is taken off, all of it is doubt.
        options: Of the device's decoder or session.
    """

    device: str
    port: str = Field(min_length=1, pattern=r"^[^\x00-\x1f]+$")
    sensor: str = ""
    hardware_id: str = ""
    baud: int | None = Field(default=None, gt=0)
    rate_hz: Hertz
    stale_s: float | None = None
    delay_s: float = Field(default=0.0, ge=0.0, le=1.0)
    poll_s: float = Field(default=0.0, ge=0.0, le=1.0)
    options: dict[str, Option] = Field(default={})


class Pose(StrictModel):
    """``pad_from_sensor``: takes coordinates of the sensor frame to the pad frame."""

    xyz_m: Place = Field(default=[0.0, 0.0, 0.0])
    quat_xyzw: Quaternion = Field(default=[0.0, 0.0, 0.0, 1.0])


class Wrench(Stream):
    """``[finger.X.wrench]``: a force/torque sensor.

    Attributes:
        sign: +1 where the sensor reports the load on the finger, −1 where it reports the load by it.
        pad_from_sensor: Where the sensor sits.
        mass_kg: Mass of the part of the finger beyond the sensor, kg; 0: nothing to compensate.
        com_m: Its centre of mass in the pad frame, m.
        force_std_n: Noise of each force component, standard deviation, N.
        torque_std_nm: Likewise of each torque component, N·m.
        range_n: Largest force that the sensor can report, as the length of the vector, N: readings beyond it, and jumps
            to and fro of a quarter of it, are garbage. None: not known, so only what no such sensor states, above 1e6
            N, is garbage.
        range_nm: Likewise the largest torque, N·m.
        stuck_after: This many repeats of a reading (over 20 ms or more) mean a stuck sensor. Up to 50, so do repeats
            over 70 ms that are unusual for this sensor. Above 50, for a sensor whose readings rest for long, only the
            number counts. 0: a reading may repeat for ever without being stuck. Whatever this says, no grip is raised
            on a reading that repeats for longer than usual, or for over 50 ms.
        drift_tau_s: Time constant with which a drifting zero is followed while nothing touches; None: it is not.
        drift_limit_n: Largest compensation of each force component since the tare, N; also part of the tolerance for a
            negative normal force.
        drift_limit_nm: Likewise each torque component, N·m.
    """

    sign: Literal[1, -1] = 1
    pad_from_sensor: Pose = Pose()
    mass_kg: Mass = 0.0
    com_m: Place = Field(default=[0.0, 0.0, 0.0])
    force_std_n: ForceNoise = 0.02
    torque_std_nm: TorqueNoise = 0.0005
    range_n: Range | None = None
    range_nm: TorqueRange | None = None
    stuck_after: int = Field(default=50, ge=0)
    drift_tau_s: DriftTime | None = None
    drift_limit_n: DriftForce = 1.0
    drift_limit_nm: DriftTorque = 0.02


class Pad(Stream):
    """``[finger.X.pad]``: a tactile pad.

    Attributes:
        swap_xy: The scan's rows run along X; the shear axes of three-axis taxels are swapped with them.
        flip_x: The scan runs against X; shear is turned by the sign of ``axis_scale``.
        flip_y: Likewise against Y.
        axis_scale: Newtons (or the unit chosen) a count, one a component that a taxel measures; signs turn the axes.
        threshold: A taxel is active above this normal force, in the unit that ``axis_scale`` gives.
        tare: Counts of the unloaded pad, one a component of each taxel in scan order; empty: zero.
        full_scale: Largest count of a taxel; None: not known, so a saturated taxel is told as stuck or hot.
        gain_error: Relative error of ``axis_scale`` where it gives newtons, such as 0.05: the sum of the image is then
            compared with the force sensor. None: its unit is not newtons.
        stuck_after: As for a wrench, if the taxels measure the force by themselves (three axes, no ``wrench``). 0,
            because pads without noise may rest as long as their load does; nothing is raised while they do.
        charge_tau_s: Leak time constant of charge amplifiers, s; None for pads that read force itself.
    """

    rows: int = Field(gt=0, le=64)
    cols: int = Field(gt=0, le=64)
    pitch_m: Pitch
    electrode_m: Electrode
    swap_xy: bool = False
    flip_x: bool = False
    flip_y: bool = False
    axis_scale: list[float] = Field(default=[1.0], min_length=1, max_length=3)
    threshold: NotNegative = 0.0
    tare: list[float] = Field(default=[])
    full_scale: Positive | None = None
    gain_error: float | None = Field(default=None, gt=0.0, lt=1.0)
    stuck_after: int = Field(default=0, ge=0)
    charge_tau_s: Leak | None = None


class Slip(StrictModel):
    """``[finger.X.slip]``: when a drop of R is a slip (see `slipd.fusion.slip.SlipSettings`)."""

    drop: float = Field(default=0.12, gt=0.0, lt=1.0)
    window_s: SlipWindow = 0.04
    armed_at: Positive = 0.7
    hold_s: SlipHold = 0.25


class Finger(StrictModel):
    """``[finger.X]``.

    Attributes:
        mu: Safe estimate of the coefficient of static friction; None: every level is "unknown".
        mu_max: Largest value that `friction.set` accepts; None: twice ``mu``, and never more than 2.
        min_normal_n: Below this normal force there is no contact, N.
        load_rule: How the normal force is shared among the taxels.
        contact_growth: Exponent of the contact's size over the normal force: 0 rigid, 1/3 Hertz.
        grip_safety: Factor on the load for which ``grip_needed_n`` is told.
    """

    mu: Friction | None = None
    mu_max: Friction | None = None
    min_normal_n: Positive = 0.3
    load_rule: Literal["matched", "grey", "binary"] = "matched"
    contact_growth: float = Field(default=0.0, ge=0.0, le=1.0)
    grip_safety: float = Field(default=1.3, ge=1.0, le=10.0)
    wrench: Wrench | None = None
    pad: Pad | None = None
    slip: Slip = Slip()

    @property
    def most_mu(self) -> float:
        """Largest μ that `friction.set` accepts: an object is rarely twice as rough as the safe estimate for all."""
        if self.mu_max is not None:
            return self.mu_max
        return MOST_FRICTION if self.mu is None else min(MU_RAISE * self.mu, MOST_FRICTION)


class Gripper(Stream):
    """``[gripper]``. Every force is the normal force on one pad.

    Attributes:
        force_table: (device units, N on one pad), both rising; between the points it is linear. Only for grippers that
            are not told newtons.
        width_table: (closure 0…1, m between the pads), closure rising and width falling; likewise.
        speed_table: (device units, m/s of the jaws), both rising; None: ``speed_mps`` may not be requested.
        max_force_n: Largest force that may be requested, N; None: nothing may be requested.
        min_force_n: Least force that may be requested, N.
        step_n: Largest change of the force of a held object by one request, N.
        raise_n_per_s: How fast requests may raise it, N/s.
        lower_n_per_s: How fast requests may lower it, N/s.
        budget_n: Most that all raises of one grasp may add up to, N; None: as much as ``max_force_n``.
        max_lease_ms: Longest life of a lease without renewal.
        lease_end: What the end of a lease that was not given back does to fingers that move: "hold" nothing, "stop"
            stops them where they are. Neither opens them.
    """

    force_table: Table | None = None
    width_table: Table | None = None
    speed_table: Table | None = None
    max_force_n: Grip | None = None
    min_force_n: NotNegative | None = None
    step_n: Grip = 2.0
    raise_n_per_s: Slew = 10.0
    lower_n_per_s: Slew = 2.0
    budget_n: Grip | None = None
    max_lease_ms: int = Field(default=200, gt=0, le=200)
    lease_end: Literal["hold", "stop"] = "hold"


class Levels(StrictModel):
    """``[levels]``: utilisation (upper bound) at which a level is reached; it is left ``hysteresis`` below."""

    caution: float = Field(default=0.70, gt=0.0, lt=1.0)
    warning: float = Field(default=0.85, gt=0.0, le=1.0)
    hysteresis: float = Field(default=0.05, ge=0.0, lt=0.5)


class Rates(StrictModel):
    """``[rates]``: how often at most a topic is published, Hz of data time; every change of level is, besides."""

    slip_hz: Hertz = 250.0
    wrench_hz: Hertz = 250.0
    tactile_hz: Hertz = 50.0
    grasp_hz: Hertz = 50.0
    status_hz: Hertz = 1.0


class Bus(StrictModel):
    """``[bus]``: where clients come, and who may.

    Attributes:
        publish: ZeroMQ endpoint of the messages; None: in the private runtime directory. One over TCP needs
            ``secret_key`` and ``readers``.
        requests: Likewise of the requests; one over TCP needs ``secret_key`` and ``requesters``.
        secret_key: File with the daemon's secret key (``slipctl keys new`` makes one).
        readers: Directory of the public keys that may subscribe, ``*.key``; None: no keys are asked for.
        requesters: Likewise of those that may request. Who may do both stands in both.
        allow_local_tcp: TCP ports of this machine are served without keys: every user of it may then move the gripper.
        requests_hz: How many requests a second one client may send.
    """

    publish: str | None = None
    requests: str | None = None
    secret_key: File | None = None
    readers: File | None = None
    requesters: File | None = None
    allow_local_tcp: bool = False
    requests_hz: float = Field(default=50.0, ge=1.0, le=10_000.0)


class Requests(StrictModel):
    """``[requests]``: what clients may ask for.

    Attributes:
        friction_without_lease: Any client may raise a finger's μ, which makes its verdicts more lenient; false: only
            the client that holds the lease.
    """

    friction_without_lease: bool = False


class Recording(StrictModel):
    """``[recording]``: limits of the recordings that clients start; ``slipd run --record`` has none.

    Attributes:
        max_bytes: Size of one file, bytes: a recording that reaches it ends in good order, at most 0.1 s later.
        max_files: Number of files; at this number ``record.start`` is refused. None is deleted.
        min_free_bytes: Free disk space, bytes; below it no recording begins, and the running one ends.
    """

    max_bytes: int = Field(default=1_000_000_000, ge=1_000_000)
    max_files: int = Field(default=20, ge=1)
    min_free_bytes: int = Field(default=1_000_000_000, ge=0)


class Config(StrictModel):
    """A whole file."""

    bus: Bus = Bus()
    requests: Requests = Requests()
    levels: Levels = Levels()
    rates: Rates = Rates()
    finger: dict[str, Finger] = Field(min_length=1)
    gripper: Gripper | None = None
    grasp: Grasp | None = None
    reflex: Reflex = Reflex()
    recording: Recording = Recording()
    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """The file as it was read."""
        return self._text

    def with_text(self, text: str) -> Config:
        """Keeps the text that this was made of."""
        self._text = text
        return self

    @property
    def config_id(self) -> str:
        """Tells configs apart in messages: the beginning of the text's SHA-256."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    def streams(self) -> dict[str, Stream]:
        """All streams by name: ``left.wrench``, ``left.pad``, ``gripper``."""
        found: dict[str, Stream] = {}
        for name, finger in self.finger.items():
            for kind, stream in (("wrench", finger.wrench), ("pad", finger.pad)):
                if stream is not None:
                    found[f"{name}.{kind}"] = stream
        if self.gripper is not None:
            found["gripper"] = self.gripper
        return found
