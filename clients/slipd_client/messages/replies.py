"""Every result that the daemon sends in a reply: one frozen class for each kind of result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from slipd_client.messages.fields import Triple, read_fields, wire
from slipd_client.messages.parts import TARE_ORIGIN, DaemonState, FrictionState

AnyReply = TypeVar("AnyReply", bound="Reply")


class Reply(dict[str, Any]):
    """The result of a request: the map as it arrived, whose known fields are attributes too.

    The classes below have an attribute for each field that they declare. An op without a class of its own, as one that
    this client does not know, has this one.
    """

    __slots__ = ()


def typed_reply(cls: type[AnyReply], raw: Mapping[str, Any]) -> AnyReply:
    """Return the map of a result as its class.

    Raises:
        Mismatch: A field that must be there is missing, or a field is of another kind.
    """
    reply = cls(**read_fields(cls, raw)) if cls is not Reply else cls()
    reply.update(raw)
    return reply


@dataclass(frozen=True, eq=False, kw_only=True)
class HelloReply(Reply):
    """The daemon's run and clock."""

    boot: str = wire("id of this run of the daemon")
    t_ns: int = wire("the daemon's clock")
    version: int | None = wire("version of this API", default=None)
    fingers: tuple[str, ...] = wire("names of the fingers", default=())


@dataclass(frozen=True, eq=False, kw_only=True)
class StatusReply(Reply, DaemonState):
    """The daemon, its fingers and its streams."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TareBegun(Reply):
    """A tare that has begun."""

    finger: str | None = wire("name of the finger", default=None)
    seconds: float | None = wire("averaging time, s", default=None)
    verified: bool | None = wire("the daemon knows that nothing touches the finger", default=None)
    tare_id: int | None = wire("tare still in use, of the first stream", default=None)
    tare_ids: Mapping[str, int] = wire("stream → its tare still in use", default={})


@dataclass(frozen=True, eq=False, kw_only=True)
class TareReply(Reply):
    """The tare in use of one stream, and whether another is in progress."""

    finger: str | None = wire("name of the finger", default=None)
    stream: str | None = wire('"wrench" or "pad"', default=None)
    tare_id: int = wire("tare in use; 0 is the config's")
    tare_origin: str | None = wire(TARE_ORIGIN, nil=True)
    taken_t_ns: int | None = wire("when it was taken; nil for the config's", nil=True)
    readings: int | None = wire("number of readings that it is the mean of", default=None)
    offset: tuple[float, ...] = wire("what is subtracted, in the sensor's units and frame", default=())
    by: str | None = wire('client that requested it, or "config"', default=None)
    gravity_mps2: Triple | None = wire(
        "gravity in the pad's frame under which it was taken; zeros for the config's; nil where it was not known",
        nil=True,
    )
    std: tuple[float, ...] | None = wire("standard deviation of one reading; nil for the config's", nil=True)
    busy: bool = wire("another tare is in progress")
    given_up: str | None = wire("why the last tare was given up, for people; nil where it was not", nil=True)
    given_up_reason: str | None = wire("the same as a word, see [Taring](#taring)", nil=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class GravityReply(Reply):
    """Whether the finger's weight is compensated."""

    gravity: str | None = wire("as in a stream of `status`", default=None)


@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionReply(Reply, FrictionState):
    """The friction in use."""

    finger: str | None = wire("name of the finger", default=None)
    mu_by: str | None = wire("client that set it", default=None)
    mu_t_ns: int | None = wire("when it was set", default=None)


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectReply(Reply):
    """The name of the object, and what is known of its friction."""

    object_name: str | None = wire("name of the object; nil where none is named", nil=True)
    fingers: Mapping[str, FrictionState] = wire(
        "finger → the friction in use for this object, as in a finger of `status`: `mu`, `mu_source`, `mu_low`, "
        "`mu_high`, `mu_d`",
        default={},
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class LeaseReply(Reply):
    """The lease that was granted."""

    ttl_ms: int | None = wire("life of the lease without renewal, ms", default=None)


@dataclass(frozen=True, eq=False, kw_only=True)
class GripReply(Reply):
    """The grip force that a motion commands."""

    applied_n: float | None = wire("grip force sent to the gripper: its setting for the requested force", nil=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class HoldReply(Reply):
    """The grip force that is kept."""

    force_n: float | None = wire("grip force in force; nil where none is known", nil=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class FaultReply(Reply):
    """The fault that was acknowledged."""

    fault: str | None = wire("fault that was latched; nil where none was", nil=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionReply(Reply):
    """Whether the grip holds a motion. None stands for what is not known: it is never to be read as "holds"."""

    utilisation: float | None = wire(
        "largest utilisation during the motion: the object slips or tips at 1; nil also where no grip holds it",
        nil=True,
    )
    at_s: float | None = wire("time of the point that has it; 0 for one acceleration", nil=True)
    finger: str | None = wire("finger that has it", nil=True)
    mode: str | None = wire('what would happen first: "translation", "rotation" or "tipping"', nil=True)
    grip_needed_n: float | None = wire(
        "grip force with which the whole motion holds with the configured safety; nil also where no grip force would",
        nil=True,
    )
    time_scale: float | None = wire(
        "largest 0 < s ≤ 1 with which the motion holds with that safety when it is slowed down: accelerations by s², "
        "velocities by s, gravity by nothing. 0: not even at rest",
        nil=True,
    )
    unknown: str | None = wire("why nothing of this is known, for people; nil where it is", nil=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordingReply(Reply):
    """The file of a recording."""

    name: str | None = wire("name of the file", default=None)
    path: str | None = wire("path of the file; nil where it is not created yet", nil=True)


class TareResult(Reply):
    """The tares that one call of the client has taken: as a map the reply of ``tare.get`` with ``verified``.

    For the stream "all" the map holds ``finger``, ``verified`` and ``streams``, the reply of each stream by its name.

    Attributes:
        finger: Name of the finger.
        verified: The daemon knew that nothing touched the finger.
        tares: Stream → the tare that was taken.
    """

    __slots__ = ("finger", "tares", "verified")

    def __init__(
        self, raw: Mapping[str, Any], finger: str, verified: bool | None, tares: Mapping[str, TareReply]
    ) -> None:
        super().__init__(raw)
        self.finger = finger
        self.verified = verified
        self.tares = tares
