"""Every request that a client may send: its op, its fields, its reply, and who may send it when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from slipd_client.messages.schema.fields import FLAG, INTEGER, NUMBER, TEXT, TEXT_OR_INTEGER, TRIPLE, Field
from slipd_client.messages.schema.replies import (
    FaultReply,
    FrictionReply,
    GravityReply,
    GripReply,
    HelloReply,
    HoldReply,
    LeaseReply,
    RecordingReply,
    Reply,
    StatusReply,
    TareBegun,
    TareReply,
)

ENVELOPE = (
    Field("v", INTEGER, "version of this API: 1"),
    Field("id", TEXT_OR_INTEGER, "chosen by the client and repeated in the reply; use each only once"),
    Field("op", TEXT, "operation, see below"),
    Field("boot", TEXT, "run of the daemon that the request is meant for: another run refuses it"),
    Field(
        "deadline_ns", INTEGER, "in the daemon's clock, at most 500 ms ahead: a request that arrives later is refused"
    ),
)
"""The fields that every request has, in addition to those of its op; those of `OPEN_OPS` may leave out the last two."""

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

LeaseRule = Literal["holder", "not_another's", "anyone"]
"""Who may send an op: the holder of the lease alone; the holder, or anyone while nobody holds the lease (some requests
need the lease even then); anyone."""


@dataclass(frozen=True)
class Op:
    """One operation of the daemon.

    Attributes:
        name: Its name on the wire.
        does: What it does.
        fields: Its fields by name, in the order in which they are checked.
        reply: Class of its result.
        lease: Who may send it.
        open: It changes nothing and may come without ``boot`` and ``deadline_ns``; a copy is answered anew.
        urgent: It keeps a grip as it is or makes it safer: the lease holder never gets "busy" for it.
        needs: What must hold for it, with the code of its refusal.
    """

    name: str
    does: str
    fields: Mapping[str, Field]
    reply: type[Reply]
    lease: LeaseRule
    open: bool
    urgent: bool
    needs: str


def _op(
    name: str,
    does: str,
    *fields: Field,
    reply: type[Reply] = Reply,
    lease: LeaseRule = "anyone",
    open: bool = False,  # noqa: A002 - the name of the attribute
    urgent: bool = False,
    needs: str = "",
) -> Op:
    return Op(name, does, {field.name: field for field in fields}, reply, lease, open, urgent, needs)


_LENIENT = "see [What makes verdicts more lenient](#what-makes-verdicts-more-lenient)"

OPS: dict[str, Op] = {
    op.name: op
    for op in (
        _op("hello", "Return the run, the clock and the fingers of the daemon.", reply=HelloReply, open=True),
        _op("status", "Return the body of the topic `status`.", reply=StatusReply, open=True),
        _op(
            "tare",
            "Take the mean of the next `seconds` as zero.",
            FINGER,
            SECONDS.optional(),
            STREAM_OR_ALL.optional(),
            UNLOADED.optional(),
            reply=TareBegun,
            lease="not_another's",
            needs="fresh readings (`not_ready`), no contact, and while a grip is in force a finger known to be free "
            "(`in_contact`), no `pulled` normal force unless `unloaded` is true (`not_ready`), no lease of another "
            "client (`lease_held`)",
        ),
        _op("tare.get", "Return the tare in use.", FINGER, STREAM.optional(), reply=TareReply),
        _op(
            "tare.undo",
            "Return to the tare before the last one, or give up the one in progress.",
            FINGER,
            STREAM.optional(),
            reply=TareReply,
            lease="not_another's",
            needs="an earlier tare, or one in progress (`not_ready`); no lease of another client (`lease_held`); where "
            "something presses, the lease (`no_lease`)",
        ),
        _op(
            "gravity.set",
            "Report gravity in the frame of a pad.",
            FINGER,
            GRAVITY_MPS2,
            reply=GravityReply,
            needs=f"a force sensor (`not_ready`); {_LENIENT}",
        ),
        _op(
            "friction.set",
            "Set the friction between a pad and the object.",
            FINGER,
            MU_S,
            MU_D.optional(),
            reply=FrictionReply,
            lease="not_another's",
            needs=f"lease, where it makes verdicts more lenient; {_LENIENT}",
        ),
        _op(
            "lease.acquire",
            "Acquire the lease.",
            TTL_MS,
            reply=LeaseReply,
            lease="not_another's",
            needs="no other holder (`lease_held`)",
        ),
        _op("lease.renew", "Renew the lease.", lease="holder", urgent=True, needs="lease"),
        _op("lease.release", "Give the lease back.", lease="holder", needs="lease"),
        _op(
            "grip.set",
            "Set the grip force of a grip in force.",
            FORCE_N,
            reply=GripReply,
            lease="holder",
            needs="lease, ready, a grip in force (`not_ready`), force, change, feeling",
        ),
        _op(
            "grip.adjust",
            "Change the grip force of a grip in force.",
            DELTA_N,
            reply=GripReply,
            lease="holder",
            needs="as `grip.set`; `field` is then `delta_n`",
        ),
        _op(
            "grip.hold",
            "Stop moving fingers, and keep a grip in force as it is.",
            reply=HoldReply,
            lease="holder",
            urgent=True,
            needs="lease, active",
        ),
        _op(
            "gripper.activate",
            "Make the gripper ready; some grippers open and close fully for it.",
            DROP.optional(),
            lease="holder",
            needs="lease, limit, no latched fault, an answering gripper, free",
        ),
        _op(
            "gripper.close",
            "Close onto an object.",
            FORCE_N,
            WIDTH_M.optional(),
            SPEED_MPS.optional(),
            reply=GripReply,
            lease="holder",
            needs="lease, ready, force; where a grip is in force also change and feeling; it only narrows",
        ),
        _op(
            "gripper.open",
            "Open.",
            WIDTH_M.optional(),
            SPEED_MPS.optional(),
            DROP.optional(),
            reply=GripReply,
            lease="holder",
            needs="lease, ready, free; a gripper whose least force is within `max_force_n` (`out_of_range`); it only "
            "widens",
        ),
        _op("gripper.stop", "Stop the fingers.", lease="holder", urgent=True, needs="lease, active"),
        _op(
            "fault.ack",
            "Acknowledge the latched fault.",
            reply=FaultReply,
            lease="holder",
            needs="lease; where a grip was in force, a gripper that answers (`not_ready`)",
        ),
        _op(
            "record.start",
            "Start a recording.",
            reply=RecordingReply,
            needs="no recording in progress (`not_ready`), room (`no_room`), a disk that accepts the file "
            "(`record_failed`)",
        ),
        _op("record.stop", "End the recording.", reply=RecordingReply, needs="a recording in progress (`not_ready`)"),
    )
}
"""Every op by its name."""

OPEN_OPS = frozenset(op.name for op in OPS.values() if op.open)
"""Ops that may come without ``boot`` and ``deadline_ns``."""

URGENT_OPS = frozenset(op.name for op in OPS.values() if op.urgent)
"""Ops for which the lease holder never gets "busy"."""

_FAMILIES_OF_HOLDER = frozenset(op.name.partition(".")[0] for op in OPS.values() if op.lease == "holder")


def lease_rule(op: str) -> LeaseRule:
    """Return who may send an op; of one that only a newer daemon knows, as for the ops with the same first word."""
    known = OPS.get(op)
    if known is not None:
        return known.lease
    return "holder" if op.partition(".")[0] in _FAMILIES_OF_HOLDER else "anyone"
