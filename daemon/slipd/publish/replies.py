"""Replies to requests: their envelope, the results that handlers return, and errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from slipd.errors import printable
from slipd.events import Body, RecordingChanged
from slipd.finger.finger import Finger
from slipd.finger.finger_tares import Tares
from slipd.finger.force_channel import ForceChannel
from slipd.grasp.motion_answers import MotionCheck
from slipd.grasp.object_estimate import NamedObject
from slipd.gripper.gripper_control import GripperControl
from slipd.publish.finger_messages import friction_body, friction_setter_body
from slipd.types.arrays import finite_fields, finite_or_none
from slipd.types.permit import Refusal
from slipd_client.messages import PROTOCOL_VERSION


def granted(number: object, result: Body, t_ns: int) -> Body:
    """Return the reply to request ``number``, carried out at ``t_ns``."""
    return {"v": PROTOCOL_VERSION, "id": number, "t_ns": t_ns, "ok": True, "result": result}


def refused(number: object, refusal: Refusal, t_ns: int) -> Body:
    """Return the reply to request ``number``, refused at ``t_ns``."""
    return {"v": PROTOCOL_VERSION, "id": number, "t_ns": t_ns, "ok": False, "error": _error(refusal)}


def error_body(number: object, refusal: Refusal) -> Body:
    """Return the reply to a request that no handler has seen; ``number`` may be anything that a client sent."""
    known = number if type(number) in (str, int) else None
    return {"v": PROTOCOL_VERSION, "id": known, "ok": False, "error": _error(refusal)}


def _error(refusal: Refusal) -> Body:
    """Return an error; its text may name a path that is no UTF-8."""
    return {"code": refusal.code, "message": printable(refusal.message), "field": refusal.field}


def done(_: object = None) -> Body:
    """Return the result of a request that has nothing to report."""
    return {}


def hello(boot: str, t_ns: int, fingers: Iterable[str]) -> Body:
    """Return the run and the clock of the daemon."""
    return {"boot": boot, "t_ns": t_ns, "version": PROTOCOL_VERSION, "fingers": list(fingers)}


def lease_granted(ttl_ms: int) -> Body:
    """Return the life of the lease without renewal."""
    return {"ttl_ms": ttl_ms}


def force_applied(gripper: GripperControl) -> Body:
    """Return the force that the gripper was sent: its setting for the one that was requested."""
    return {"applied_n": gripper.grip.command_n}


def force_held(gripper: GripperControl) -> Body:
    """Return the force in force, which the gripper keeps."""
    return {"force_n": finite_or_none(gripper.policy.force_n)}


def fault_acknowledged(fault: str) -> Body:
    """Return the fault that was latched until now, or "" if there was none."""
    return {"fault": fault or None}


def friction_set(finger: Finger) -> Body:
    """Return the friction in use."""
    return {"finger": finger.name, **friction_setter_body(finger)}


def object_named(named: NamedObject, fingers: Mapping[str, Finger]) -> Body:
    """Return the name of the object, and the friction in use for it."""
    known = {name: friction_body(finger.friction.state) for name, finger in fingers.items()}
    return {"object_name": named.name, "fingers": known}


def gravity_set(force: ForceChannel, t_ns: int) -> Body:
    """Return whether the weight of the finger is compensated."""
    return {"gravity": force.gravity.state(t_ns)}


def tare_begun(tares: Tares, seconds: float, *, verified: bool) -> Body:
    """Return the tares in use while others are measured; ``tare_id`` is that of the first stream.

    Args:
        tares: The streams.
        seconds: Averaging time, s.
        verified: The finger was known to be untouched when the tare began.
    """
    ids = {kind: channel.tare.current.id for kind, channel in tares.channels.items()}
    return {
        "finger": tares.finger.name,
        "seconds": seconds,
        "verified": verified,
        "tare_id": next(iter(ids.values())),
        "tare_ids": ids,
    }


def tare_in_use(tares: Tares) -> Body:
    """Return the tare in use of the one stream, and whether another is measured."""
    [(kind, channel)] = tares.channels.items()
    tare, offset = channel.tare, channel.tare.current
    return {
        "finger": tares.finger.name,
        "stream": kind,
        "tare_id": offset.id,
        "tare_origin": channel.zero.origin,
        "taken_t_ns": offset.t_ns,
        "readings": offset.readings,
        "offset": offset.value.ravel().tolist(),
        "by": offset.by,
        "gravity_mps2": None if offset.gravity_mps2 is None else offset.gravity_mps2.tolist(),
        "std": None if offset.std is None else offset.std.ravel().tolist(),
        "busy": tare.busy,
        "given_up": tare.aborted_text or None,
        "given_up_reason": tare.aborted_reason,
    }


def recording_file(recording: RecordingChanged) -> Body:
    """Return name and path of the file of a recording that began or was ended."""
    return {"name": recording.name, "path": printable(recording.path) or None}


def motion_checked(found: MotionCheck) -> Body:
    """Return whether the present grip holds a motion."""
    return finite_fields(
        {
            "utilisation": found.utilisation,
            "at_s": found.at_s,
            "finger": found.finger,
            "mode": found.mode,
            "grip_needed_n": found.grip_needed_n,
            "time_scale": found.time_scale,
            "unknown": found.unknown or None,
        }
    )
