"""Tables of the streams of a finger: what every device has, ``[finger.X]``, its force/torque sensor and its pad."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from slipd.config.value_bounds import MOST_FRICTION, Friction, Place, Quaternion, StrictModel, within

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]

Hertz = Annotated[float, Field(ge=1e-3, le=1e6)]
"""A rate, Hz. No stream is slower than one reading in 1000 s or faster than 1 MHz."""

Point = Annotated[tuple[float, float], Strict(False)]
"""One row of a table, written as a list in TOML, which has no tuples."""

Table = Annotated[list[Point], Field(min_length=2)]
Option = bool | int | float | str | list[float] | list[list[float]]


class Stream(StrictModel):
    """Keys of every device stream.

    Attributes:
        device: Name of the device, as listed in docs/devices.md. Wrong: its bytes are not understood: no reading, and
            `slipctl status` shows what arrives instead.
        package: Package that provides the device, if it is not one of slipd's own; `slipd devices` lists the installed
            ones. "": slipd. Wrong: the config is refused; the error names the package to install.
        port: Path of a serial port, ``tcp://HOST:PORT``, ``udp://HOST:PORT``, ``ws://HOST:PORT``, or the local socket
            (``ipc:///PATH``, ``unix:///PATH``) to which another program connects. Wrong: no reading, or those of
            another device; `slipctl status` shows what arrives.
        sensor: Name of the sensor on a port that carries several; "" where the port carries one. Wrong: the readings of
            the other sensor, or none. Press one finger and look which one reacts.
        hardware_id: Serial number or name that the device reports (`slipctl status` shows it). A device that reports
            another one is refused. "": the first device that answers in a run is accepted. Wrong: the device is
            refused, and its finger is unknown.
        baud: Line speed of a serial port, bit/s; None: the default of the device. Wrong: only damaged frames arrive,
            and the finger is unknown.
        rate_hz: Expected readings per second, within 25 % of the rates of the device, and no more than its line
            carries. Wrong: too low, and a silent sensor is noticed late; too high, and the stream is stale between its
            readings.
        stale_s: A stream without a reading for this long is stale, s; so is a reading older than this on arrival. Time
            in which the daemon itself did not run does not count. None: three periods, at least 20 ms. At least 0.01 s
            or 1.5 periods, at most 0.5 s or 10 periods, the longer of each. Grip raises have a limit of their own. For
            a gripper this affects only the reported health. Wrong: too long, and a dead sensor is noticed late; too
            short, and the finger is often unknown.
        delay_s: Known delay from the acquisition of a reading to its earliest receipt, s, such as a filter delay; below
            ``stale_s``. Wrong: all times are off by the difference, and force and image of a finger do not belong
            together.
        poll_s: Polling period of the line, s, where readings wait for the host to poll and carry no time: 0.001 for
            most USB adapters at 1 kHz. Half of it is subtracted from the time of receipt, and all of it is added to the
            uncertainty of that time. Wrong: times are off by half of the difference.
        options: Options of the device's decoder or session. Wrong: an option that the device does not have, or cannot
            have, refuses the config.
    """

    device: str
    package: str = ""
    port: str = Field(min_length=1, pattern=r"^[^\x00-\x1f]+$")
    sensor: str = ""
    hardware_id: str = ""
    baud: int | None = Field(default=None, gt=0)
    rate_hz: Hertz
    stale_s: float | None = None
    delay_s: float = Field(default=0.0, ge=0.0, le=1.0)
    poll_s: float = Field(default=0.0, ge=0.0, le=1.0)
    options: dict[str, Option] = Field(default={})


MU_RAISE = 2.0
"""`friction.set` accepts up to this many times the configured μ, unless ``mu_max`` is given."""


class Pose(StrictModel):
    """``pad_from_sensor``: transforms coordinates of the sensor frame to the pad frame.

    Attributes:
        xyz_m: Origin of the sensor frame in the pad frame, m. Wrong: centroid and torque are displaced, and warnings of
            a rotation come late or for nothing.
        quat_xyzw: Rotation from sensor coordinates to pad coordinates. Wrong: normal force and shear are mixed: the
            force is `pulled`, or utilisation does not follow the load.
    """

    xyz_m: Place = Field(default=[0.0, 0.0, 0.0])
    quat_xyzw: Quaternion = Field(default=[0.0, 0.0, 0.0, 1.0])


class Wrench(Stream):
    """``[finger.X.wrench]``: a force/torque sensor.

    Attributes:
        sign: +1 if the sensor reports the load on the finger, −1 if it reports the load that the finger exerts. Wrong:
            a press reads as a pull: the finger is unknown (`pulled`).
        pad_from_sensor: Pose of the sensor in the pad frame. Wrong: see its keys.
        mass_kg: Mass of the part of the finger beyond the sensor, kg; 0: no weight is compensated. Wrong: the weight of
            the finger counts as load, and changes with its orientation.
        com_m: Centre of mass of that part in the pad frame, m. Wrong: the torque of that weight counts as load.
        force_std_n: Noise of each force component, standard deviation, N. Wrong: too low, and noise causes false
            reports of slips; too high, and small slips are missed, and light grips are warned of late.
        torque_std_nm: Noise of each torque component, standard deviation, N·m. Wrong: the same for rotation.
        range_n: Largest force that the sensor can report, as the length of the vector, N. Readings beyond it, and jumps
            back and forth by a quarter of it, are treated as damaged. None: unknown; only readings above 1e6 N, which
            no sensor has, are treated as damaged. Wrong: too low, and strong grips are `garbage`; too high, and damaged
            readings pass.
        range_nm: Largest torque that the sensor can report, likewise, N·m. Wrong: likewise.
        stuck_after: The sensor counts as stuck after this many repeats of a reading (over 20 ms or more). A change by
            less than a thousandth of ``force_std_n`` and ``torque_std_nm`` is a repeat. Up to 50, repeats over 70 ms
            that are unusual for this sensor count too; above 50, for a sensor whose readings rest for long, only the
            number counts. 0: a reading may repeat for ever. In every case no grip is raised on a reading that repeats
            for longer than usual, or for over 50 ms. Wrong: too low, and a resting sensor is `stuck`; too high, and a
            dead one is noticed late.
        drift_tau_s: Time constant with which a drifting zero is followed while nothing touches, s; None: not followed.
            Wrong: too short, and a light contact is taken for drift; too long, and the zero wanders.
        drift_limit_n: Largest drift compensation of each force component since the tare, N; also part of the tolerance
            for a negative normal force. Wrong: too low, and a sensor that drifts needs a tare more often; too high, and
            a real pull is tolerated.
        drift_limit_nm: Largest drift compensation of each torque component since the tare, N·m. Wrong: likewise.
    """

    sign: Literal[1, -1] = 1
    pad_from_sensor: Pose = Pose()
    mass_kg: Annotated[float, within(1e-5, 10.0, "kg", "g", zero=True)] = 0.0  # from a fingertip to a whole gripper
    com_m: Place = Field(default=[0.0, 0.0, 0.0])
    force_std_n: Annotated[float, within(0.0, 10.0, "N", "mN")] = 0.02  # more hides every contact
    torque_std_nm: Annotated[float, within(0.0, 1.0, "N·m", "mN·m")] = 0.0005
    # From sensors for fingertips to those of large robots.
    range_n: Annotated[float, within(0.1, 1e5, "N")] | None = None
    range_nm: Annotated[float, within(1e-4, 1e5, "N·m", "mN·m")] | None = None
    stuck_after: int = Field(default=50, ge=0)
    drift_tau_s: Annotated[float, within(1e-2, 1e6, "s")] | None = None  # from seconds to days
    drift_limit_n: Annotated[float, within(1e-4, 100.0, "N", "mN")] = 1.0  # more belongs to a broken sensor
    drift_limit_nm: Annotated[float, within(1e-6, 10.0, "N·m", "mN·m")] = 0.02


class Pad(Stream):
    """``[finger.X.pad]``: a tactile pad.

    Attributes:
        rows: Rows of taxels. The longer side of the pad is at most 0.5 m. Wrong: every image is refused, or has its
            taxels in the wrong places.
        cols: Columns of taxels. Wrong: likewise.
        pitch_m: Distance between the centres of neighbouring taxels, m. Wrong: too large, and the resistance to
            rotation is overestimated: a rotation is reported late.
        electrode_m: Diameter of the sensing area of a taxel, m; at most ``pitch_m``. Wrong: an edge of the contact is
            misplaced by up to half of the difference.
        swap_xy: The rows of the scan run along X; the shear axes of three-axis taxels are swapped with them. Wrong: the
            image is turned against the force: warnings of a rotation come late or for nothing.
        flip_x: The scan runs against X. Shear changes its sign by ``axis_scale``, not by this key. Wrong: the image is
            mirrored against the force, likewise.
        flip_y: The scan runs against Y, likewise. Wrong: likewise.
        axis_scale: Newtons (or another unit) per count, one value for each component that a taxel measures; the sign
            sets the direction of the axis. Wrong: forces are wrong by the same factor; with a wrong sign the force is
            `pulled`, or shear points backwards.
        threshold: A taxel is active above this normal force, in the unit of ``axis_scale``. Wrong: too low, and noise
            is contact; too high, and the edge of the contact is missing.
        tare: Counts of the unloaded pad, one for each component of each taxel in scan order; empty: zero. Wrong: the
            pad feels a load that does not exist, or misses one.
        full_scale: Largest count of a taxel; None: unknown, and a saturated taxel is reported as stuck or hot. Wrong:
            too low, and loaded taxels count as saturated; too high, and saturated ones pass.
        gain_error: Relative error of ``axis_scale`` where it gives newtons, such as 0.05. The sum of the image is then
            compared with the force sensor. None: the unit is not newtons. Wrong: too low, and force and image
            contradict each other; too high, and a damaged pad passes.
        stuck_after: As for a wrench, for taxels that measure the force by themselves (three axes, no ``wrench``). The
            default is 0, because a pad without noise repeats its image as long as its load does; no grip is raised
            meanwhile. Wrong: as for a wrench.
        charge_tau_s: Leak time constant of the charge amplifiers, s; None for pads that measure force itself. Wrong: a
            steady load seems to fade or to grow.
    """

    rows: int = Field(gt=0, le=64)
    cols: int = Field(gt=0, le=64)
    pitch_m: Annotated[float, within(1e-4, 0.05, "m", "mm")]  # from the finest arrays to the coarsest skins
    electrode_m: Annotated[float, within(1e-5, 0.05, "m", "mm")]
    swap_xy: bool = False
    flip_x: bool = False
    flip_y: bool = False
    axis_scale: list[float] = Field(default=[1.0], min_length=1, max_length=3)
    threshold: NotNegative = 0.0
    tare: list[float] = Field(default=[])
    full_scale: Positive | None = None
    gain_error: float | None = Field(default=None, gt=0.0, lt=1.0)
    stuck_after: int = Field(default=0, ge=0)
    charge_tau_s: Annotated[float, within(1e-3, 3600.0, "s", "ms")] | None = None


class Slip(StrictModel):
    """``[finger.X.slip]``: when a fall of the load counts as a slip (see `slipd.fusion.contact_state.SlipSettings`).

    Attributes:
        drop: Least relative fall of the required friction; noise may ask for more. Wrong: too low, and more
            disturbances count as slips; too high, and short slips are missed.
        window_s: Longest fall, s; falls of 0.02 to 0.15 s that slow down are found too, whatever this is. Wrong: too
            short, and slips are missed or reported late; too long, and changes of the load count as slips.
        hold_s: Longest time for which a slip is reported without new evidence, s. Motion that ends earlier ends it.
            Wrong: too long, and a slip is reported after it ended unseen; too short, and the report ends too early.
    """

    drop: float = Field(default=0.03, gt=0.0, lt=1.0)
    window_s: Annotated[float, within(1e-3, 1.0, "s", "ms")] = 0.04  # no contact breaks loose more slowly
    hold_s: Annotated[float, within(1e-3, 60.0, "s", "ms")] = 3.0


class Finger(StrictModel):
    """``[finger.X]``: what is known of a finger; it has a force/torque sensor, a tactile pad, or both.

    Attributes:
        mu: Safe estimate of the coefficient of static friction; None: no level but "slipping" is known before a slip
            showed the friction. Wrong: too high, and warnings come too late, which is the dangerous side; too low, and
            they come early.
        mu_max: Largest μ that `friction.set` accepts, and that may be learned; None: twice ``mu``, at most 2. At least
            ``mu``. Wrong: too high, and a client can make verdicts too lenient; too low, and a good grip counts as
            weak.
        mu_spread: Relative standard deviation of ``mu``, and of what `friction.set` states; 0: it is known exactly, and
            none is learned. Wrong: too low, and a wrong μ is corrected slowly; too high, and a good one is given up
            quickly.
        mu_rotation: Coefficient of friction that limits a rotation, for taxels whose gains for shear and pressure are
            not calibrated against each other; None: ``mu``. It only judges whether a change of the image is a turn.
            Once the object turned, the coefficient at which it did so limits rotation in λ, until the grasp ends.
            Wrong: too high, and turns are seen late; too low, and changes of the load count as turns.
        min_normal_n: Below this normal force there is no contact, N. With a force sensor at most 50, and below
            ``range_n``. Wrong: too high, and a light grip is `no_contact`; too low, and noise is contact.
        load_rule: How the normal force is distributed over the taxels. Wrong: the resistance to rotation is misjudged.
        contact_growth: Exponent with which the size of the contact grows with the normal force: 0 rigid, 1/3 Hertz.
            Wrong: the force that `grip_needed_n` asks for against a rotation is wrong.
        grip_safety: Safety factor on the load in ``grip_needed_n``. Wrong: too low, and the grip asked for just holds;
            too high, and it crushes the object.
        wrench: The force/torque sensor, if there is one. Wrong: see its keys.
        pad: The tactile pad, if there is one. Wrong: see its keys.
        slip: Slip detection. Wrong: see its keys.
    """

    mu: Friction | None = None
    mu_max: Friction | None = None
    mu_spread: Annotated[float, within(1e-3, 1.0, "", zero=True)] = 0.1  # no μ is measured to a thousandth
    mu_rotation: Friction | None = None
    min_normal_n: Positive = 0.3
    load_rule: Literal["matched", "grey", "binary"] = "matched"
    contact_growth: float = Field(default=0.0, ge=0.0, le=1.0)
    grip_safety: float = Field(default=1.3, ge=1.0, le=10.0)
    wrench: Wrench | None = None
    pad: Pad | None = None
    slip: Slip = Slip()

    @property
    def most_mu(self) -> float:
        """Largest μ that `friction.set` accepts, and that may be learned."""
        if self.mu_max is not None:
            return self.mu_max
        return MOST_FRICTION if self.mu is None else min(MU_RAISE * self.mu, MOST_FRICTION)
