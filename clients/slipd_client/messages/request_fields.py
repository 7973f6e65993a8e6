"""The fields of requests: those that every request has, and each field that some op has."""

from __future__ import annotations

from dataclasses import replace

from slipd_client.messages.fields import FLAG, INTEGER, NUMBER, ROWS, TEXT, TEXT_OR_INTEGER, TRIPLE, Field

ENVELOPE = (
    Field("v", INTEGER, "version of this API: 1"),
    Field("id", TEXT_OR_INTEGER, "chosen by the client and repeated in the reply; use each only once"),
    Field("op", TEXT, "operation, see below"),
    Field("boot", TEXT, "run of the daemon that the request is meant for: another run refuses it"),
    Field(
        "deadline_ns", INTEGER, "in the daemon's clock, at most 500 ms ahead: a request that arrives later is refused"
    ),
)
"""The fields that every request has, besides those of its op; those of `OPEN_OPS` may leave out the last two."""

FINGER = Field("finger", TEXT, "name of the finger", limit="a name of `hello`, else `unknown_finger`")
TARE_S = 0.5
"""Long enough to average the noise of a force sensor, short enough for a finger to stay untouched."""

SECONDS = Field("seconds", NUMBER, "averaging time of the tare", unit="s", above=0, most=10, default=TARE_S)
STREAM = Field(
    "stream",
    TEXT,
    "stream of the finger",
    words=("wrench", "pad"),
    omitted="the one that measures the force, which is the pad of a finger without force sensor",
)
STREAM_OR_ALL = replace(STREAM, meaning='stream of the finger; "all" is for `tare` alone', words=(*STREAM.words, "all"))
UNLOADED = Field(
    "unloaded",
    FLAG,
    "confirm that nothing touches the finger: its negative normal force is the bias of its sensor",
    default=False,
)
GRAVITY_MPS2 = Field(
    "gravity_mps2",
    TRIPLE,
    "gravity minus the acceleration of the finger, in the frame of its pad",
    unit="m/s²",
    limit="at most 5 g long",
)
MU_S = Field(
    "mu_s",
    NUMBER,
    "coefficient of static friction between pad and object",
    above=0,
    limit="at most the finger's `mu_max`, by default twice its `mu` and at most 2",
)
MU_D = Field(
    "mu_d",
    NUMBER,
    "coefficient of dynamic friction between pad and object",
    above=0,
    limit="at most `mu_s`",
    omitted="the drop of friction that counts as a slip stays as it is",
)
OBJECT_NAME = Field(
    "name",
    TEXT,
    "name of the object that is gripped, or about to be; nil: none is named",
    nullable=True,
    pattern="[A-Za-z0-9][A-Za-z0-9._-]{0,63}",
    limit="1 to 64 letters, digits, `.`, `_` and `-`, the first a letter or digit",
)
TTL_MS = Field(
    "ttl_ms",
    INTEGER,
    "life of the lease without renewal",
    unit="ms",
    least=1,
    limit="at most `gripper.max_lease_ms` (200 or less)",
)
FORCE_N = Field(
    "force_n",
    NUMBER,
    "grip force",
    unit="N on one pad",
    least=0,
    limit="`gripper.min_force_n` to `gripper.max_force_n`",
)
DELTA_N = Field(
    "delta_n",
    NUMBER,
    "change of the grip force in force; a negative change loosens the grip",
    unit="N on one pad",
    limit="the sum with the force in force is judged as `force_n`",
)
WIDTH_M = Field(
    "width_m",
    NUMBER,
    "width between the pads to move to",
    unit="m",
    least=0,
    limit="the range of the gripper. To open: at least the present width. To close: at most the present width, and of "
    "a grip in force at most the one it was closed to. Of moving fingers the width that they move to counts as well",
    omitted="as far as the gripper goes",
)
SPEED_MPS = Field(
    "speed_mps",
    NUMBER,
    "speed of the fingers",
    unit="m/s",
    above=0,
    limit="the range of the gripper; no value where the gripper accepts none",
    omitted="the gripper's usual one",
)
DROP = Field("drop", FLAG, "open even if an object is held, or may be", default=False)
POINT_COLUMNS = ("t_s", "gx", "gy", "gz", "wx", "wy", "wz", "ax", "ay", "az")
"""Columns of a point: time, s; gravity minus the acceleration of the gripper frame's origin, m/s²; angular velocity,
rad/s; angular acceleration, rad/s². All in the gripper frame, as in ``docs/arm.md``."""

MOST_POINTS = 2000
POINTS = Field(
    "points",
    ROWS,
    f"points of a trajectory: rows [{', '.join(POINT_COLUMNS)}] of time, s, then `gravity_mps2`, angular velocity, "
    "rad/s, and angular acceleration, rad/s², of the gripper as in [The arm's motion](arm.md#what-to-send)",
    limit=f"1 to {MOST_POINTS:,} rows of {len(POINT_COLUMNS)} finite numbers; their times rise",
    omitted="`acceleration_mps2` is judged",
)
ACCELERATION_MPS2 = Field(
    "acceleration_mps2",
    TRIPLE,
    "acceleration of the gripper from its present orientation, in the gripper frame",
    unit="m/s²",
    limit="at most 5 g long",
    omitted="`points` are judged",
)
