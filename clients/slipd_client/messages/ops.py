"""Every request that a client may send: its op, its fields, its reply, and who may send it when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from slipd_client.messages.fields import Field
from slipd_client.messages.replies import (
    FaultReply,
    FrictionReply,
    GravityReply,
    GripReply,
    HelloReply,
    HoldReply,
    LeaseReply,
    MotionReply,
    ObjectReply,
    RecordingReply,
    Reply,
    StatusReply,
    TareBegun,
    TareReply,
)
from slipd_client.messages.request_fields import (
    ACCELERATION_MPS2,
    DELTA_N,
    DROP,
    FINGER,
    FORCE_N,
    GRAVITY_MPS2,
    MU_D,
    MU_S,
    OBJECT_NAME,
    POINTS,
    SECONDS,
    SPEED_MPS,
    STREAM,
    STREAM_OR_ALL,
    TTL_MS,
    UNLOADED,
    WIDTH_M,
)

LeaseRule = Literal["holder", "not_another's", "anyone"]
"""Who may send an op: the holder of the lease alone; the holder, or anyone while nobody holds the lease (some requests
need the lease even then); anyone."""

SteeringRule = Literal["never", "in_grasp", "always"]
"""When the reflex may act on what an op states, and so move the gripper: it then needs the lease, as a motion does."""


@dataclass(frozen=True)
class Op:
    """One operation of the daemon.

    Attributes:
        name: Its name on the wire.
        does: What it does.
        fields: Its fields by name, in the order in which they are checked.
        reply: Class of its result.
        lease: Who may send it.
        open: It changes nothing and may come without ``boot`` and ``deadline_ns``; a copy is answered again.
        urgent: It keeps a grip as it is or makes it safer: the lease holder never gets "busy" for it.
        steers: When it needs the lease on a rig with a reflex: "in_grasp" is while a grip is in force.
        needs: What must hold for it, with the code of its refusal.
    """

    name: str
    does: str
    fields: Mapping[str, Field]
    reply: type[Reply]
    lease: LeaseRule
    open: bool
    urgent: bool
    steers: SteeringRule
    needs: str


_REFLEX = "[with a reflex](#what-the-reflex-acts-on) the lease"
_STEERING = {"always": _REFLEX, "in_grasp": f"{_REFLEX} while a grip is in force"}


def _op(
    name: str,
    does: str,
    *fields: Field,
    reply: type[Reply] = Reply,
    lease: LeaseRule = "anyone",
    open: bool = False,  # noqa: A002 - the name of the attribute
    urgent: bool = False,
    steers: SteeringRule = "never",
    needs: str = "",
) -> Op:
    needs += f"; {_STEERING[steers]}" if steers in _STEERING else ""
    return Op(name, does, {field.name: field for field in fields}, reply, lease, open, urgent, steers, needs)


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
            steers="in_grasp",
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
            steers="always",
            needs="an earlier tare, or one in progress (`not_ready`); no lease of another client (`lease_held`); where "
            "something presses, the lease (`no_lease`)",
        ),
        _op(
            "gravity.set",
            "Report gravity in the frame of a pad.",
            FINGER,
            GRAVITY_MPS2,
            reply=GravityReply,
            steers="always",
            needs=f"a force sensor, and no fresh [arm stream](arm.md) (`not_ready`); {_LENIENT}",
        ),
        _op(
            "friction.set",
            "Set the friction between a pad and the object.",
            FINGER,
            MU_S,
            MU_D.optional(),
            reply=FrictionReply,
            lease="not_another's",
            steers="always",
            needs=f"lease, where it makes verdicts more lenient; {_LENIENT}",
        ),
        _op(
            "object.set",
            "Name the object, or take its name back. Friction is learned for each name.",
            OBJECT_NAME,
            reply=ObjectReply,
            lease="not_another's",
            steers="always",
            needs=f"lease, where the name is another than before; {_LENIENT}",
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
            "motion.check",
            "Report whether the present grip holds a motion, and how far to slow it down. It moves nothing.",
            POINTS.optional(),
            ACCELERATION_MPS2.optional(),
            reply=MotionReply,
            open=True,
            needs="`[grasp]` in the config (`not_ready`); either `points` or `acceleration_mps2`",
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
