"""The maps within messages and replies: lease, gripper, fingers, streams and recordings of ``status``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slipd_client.messages.fields import Sextuple, Triple, wire
from slipd_client.messages.names import Health, SlipLevel

MU = "coefficient of static friction in use: a low estimate"
TARE_ORIGIN = (
    'where the zero comes from: "config" (`tare` of the pad), "measured" (a tare of this run), "stored" (a tare of an '
    'earlier run) or "observed" (the pad itself, while the force sensor measured no contact); nil: it is not known, '
    "see [Taring](#taring)"
)
TARE_AGE = "age of the tare; nil for the config's"

MU_SOURCE = (
    'where that coefficient comes from: "config", "request" (`friction.set`), "learned" (from what this grasp, or an '
    'earlier one of this object, carried and did not carry), or "none": it is not known'
)
MU_LOW = "lower end of the interval in which the coefficient of static friction is expected"
MU_HIGH = "upper end of that interval; nil where nothing limits it"
MU_D = "coefficient of dynamic friction; nil where it is not known"
"""Meanings of the fields that several maps share: friction in use, its source and its interval."""


@dataclass(frozen=True, slots=True)
class LeaseStatus:
    """Who may move the gripper."""

    held: bool = wire("a client holds the lease")
    expires_in_s: float | None = wire(
        "time until the lease ends unless it is renewed; nil where nobody holds it", nil=True
    )


@dataclass(frozen=True, slots=True)
class ReflexAct:
    """What the reflex has just done."""

    force_n: float | None = wire("grip force that it commands", default=None)
    from_n: float | None = wire("grip force before", default=None)
    reason: str | None = wire('why: "needed", "slipping" or "calm"', default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldObject:
    """What is known of the object in the grasp, in the gripper frame."""

    mass_kg: float | None = wire("mass", nil=True)
    mass_std_kg: float | None = wire("its standard deviation", nil=True)
    com_m: Triple | None = wire(
        "centre of mass; nil also while a component of it is unknown, which a turn of the gripper changes", nil=True
    )
    com_std_m: Triple | None = wire("standard deviation of each component", nil=True)
    inertia_kgm2: float | None = wire(
        "moment of inertia about the line through the centre of mass along the normal of the pads; nil until a turn "
        "about it has shown it",
        nil=True,
    )
    inertia_std_kgm2: float | None = wire("standard deviation of that moment", nil=True)
    unknown: str = wire("why mass or centre of mass is unknown, for people; empty where both are known")


@dataclass(frozen=True, kw_only=True)
class GripperState:
    """The state of the gripper; forces are grip forces, on one pad."""

    width_m: float | None = wire("width between the pads", nil=True)
    force_command_n: float | None = wire(
        "grip force that was sent to the gripper last, by the run before where its grip lasts; nil where it is not "
        "active or was sent none",
        nil=True,
    )
    force_limit_n: float | None = wire("largest force that may be requested; nil: none may", nil=True)
    active: bool | None = wire("the gripper accepts commands", nil=True)
    object: str | None = wire('"moving", "contact_opening", "contact_closing" or "none"', nil=True)
    moving: bool | None = wire("the fingers move", nil=True)
    fault: str | None = wire("fault that the gripper reports now; empty when it reports none", nil=True)
    latched_fault: str | None = wire(
        "first fault since the last `fault.ack`; empty when there was none; see [Faults](#faults)", default=None
    )
    echo_ok: bool | None = wire("the gripper repeats the last command correctly; nil before the first", nil=True)
    current_a: float | None = wire("motor current", nil=True)
    force_n: float | None = wire("grip force that the gripper itself measures", nil=True)
    lease: LeaseStatus | None = wire("as in `status`", default=None)
    reflex: ReflexAct | None = wire(
        'what the reflex has just done: `force_n` commanded, `from_n` before, `reason` ("needed", "slipping" or '
        '"calm"); nil in every other message',
        nil=True,
    )
    reading_age_s: float | None = wire("age of the reading at publication", key="age_s", nil=True)


@dataclass(frozen=True, kw_only=True)
class FrictionState:
    """The friction in use on one finger."""

    mu: float | None = wire(MU, nil=True)
    mu_source: str | None = wire(MU_SOURCE, default=None)
    mu_low: float | None = wire(MU_LOW, nil=True)
    mu_high: float | None = wire(MU_HIGH, nil=True)
    mu_d: float | None = wire(MU_D, nil=True)


@dataclass(frozen=True, kw_only=True)
class FingerStatus(FrictionState):
    """One finger in ``status``."""

    level: SlipLevel = wire("as in `slip`")
    reasons: tuple[str, ...] = wire("as in `slip`", default=())
    evidence: tuple[str, ...] = wire("as in `slip`", default=())
    tare_id: int | None = wire("tare in use of the sensor that measures the force", default=None)
    tare_busy: bool | None = wire("a tare of that sensor is in progress", default=None)
    mu_by: str | None = wire("client that set it last", nil=True)
    mu_t_ns: int | None = wire("when that client set it", nil=True)


@dataclass(frozen=True, slots=True)
class StreamStatus:
    """One stream in ``status``."""

    health: Health = wire("0 OK, 1 WARN, 2 ERROR, 3 STALE")
    message: str | None = wire(
        "why it is not OK, the worst first; also hints while it is, e.g. why the last tare was given up. A stream "
        "without readings says what arrives instead: nothing, bytes of which none is a frame, or readings of other "
        "sensors. One line of at most 500 characters; control characters are escaped",
        default=None,
    )
    hardware_id: str | None = wire("identity that the device reports, else what was opened; nil before that", nil=True)
    address: str | None = wire("port or server of the config", default=None)
    state: str | None = wire("state of the conversation, of devices that answer to commands", nil=True)
    expected_hz: float | None = wire("rate of the config", default=None)
    rate_hz: float | None = wire("measured rate", nil=True)
    age_s: float | None = wire("time since the last reading was received", nil=True)
    samples: int | None = wire("number of readings", default=None)
    good: int | None = wire("intact frames", default=None)
    bad: int | None = wire("damaged frames", default=None)
    lost: int | None = wire("readings that are missing by the device's own numbering", default=None)
    duplicates: int | None = wire("readings that arrived twice, or after a newer one; they are not used", default=None)
    restarts: int | None = wire("times that the device's numbering restarted", default=None)
    bad_bytes: int | None = wire("bytes that belong to no frame", default=None)
    dropped: int | None = wire(
        "readings dropped because the device sends more than four times its expected rate", default=None
    )
    reconnects: int | None = wire("times that the link came up again", default=None)
    clock: str | None = wire(
        'source of the times: "locked" (the device\'s clock: times are those of the acquisition), "delayed" '
        '(likewise, and the readings come later than before for a lasting time), "settling", "not_a_clock" or "none" '
        '(the receipt), or "host" (the clock of the program that sends the readings)',
        default=None,
    )
    clock_uncertainty_s: float | None = wire(
        "bound of the error of the times, in addition to the least delay of the line", nil=True
    )
    clock_drift_ppm: float | None = wire("how much too fast the device's clock runs", nil=True)
    tare_id: int | None = wire("tare in use", default=None, only="force sensors and pads")
    tare_origin: str | None = wire(TARE_ORIGIN, nil=True, only="force sensors and pads")
    tare_age_s: float | None = wire(TARE_AGE, nil=True, only="force sensors and pads")
    tare_busy: bool | None = wire("another tare is in progress", default=None, only="force sensors and pads")
    gravity: str | None = wire(
        '"none" (the config gives no `mass_kg`), "compensated" or "unknown_orientation"',
        default=None,
        only="force sensors",
    )
    drift: Sextuple | None = wire(
        "what is subtracted for drift (force, N, and torque, N·m, in the pad's frame); nil where drift is not followed",
        nil=True,
        only="force sensors",
    )
    drift_frozen: bool | None = wire("no drift is learned at present", nil=True, only="force sensors")
    masked: tuple[int, ...] | None = wire(
        "taxels that are not used, by their index in scan order", default=None, only="pads"
    )
    taxel_faults: Mapping[str, tuple[int, ...]] | None = wire(
        '"dead", "stuck", "hot", "saturated", "row" or "column" → the taxels, rows or columns',
        default=None,
        only="pads",
    )


@dataclass(frozen=True, slots=True)
class RecordingStatus:
    """One recording in ``status``."""

    name: str | None = wire("name of its file; nil for the recording of the whole run, and before the first", nil=True)
    path: str | None = wire("path of its file; nil until the file is created", nil=True)
    state: str | None = wire(
        '"none", "running", "stopped" (`record.stop`), "limited" (a limit of `[recording]` ended it in good order, or '
        'prevented it) or "failed"',
        default=None,
    )
    running: bool | None = wire('`state` is "running"', default=None)
    failure: str | None = wire("why it ended by itself; nil where it did not", nil=True)
    lost: int | None = wire("entries that are known to be missing from the file", default=None)


@dataclass(frozen=True, slots=True)
class IncidentsStatus:
    """What was saved of incidents, in ``status``."""

    saved: int | None = wire("files saved in this run", default=None)
    not_saved: int | None = wire("files that could not be saved", default=None)
    lost: int | None = wire("entries that never reached the memory of the last seconds: a gap of time", default=None)
    dropped: int | None = wire("entries that left it before `before_s`, because it was full", default=None)
    path: str | None = wire("path of the last file that was saved; nil before the first", nil=True)
    failure: str | None = wire("why the last file was not saved; nil if it was", nil=True)


@dataclass(frozen=True, slots=True)
class PublisherStatus:
    """The publisher in ``status``."""

    messages: int | None = wire("messages published since the start", default=None)


@dataclass(frozen=True, kw_only=True)
class DaemonState:
    """What the topic ``status`` and the reply to the op ``status`` have in common."""

    version: str | None = wire("version of the daemon", default=None)
    uptime_s: float | None = wire("time since the daemon's start", default=None)
    fingers: Mapping[str, FingerStatus] = wire("finger → its map, see below", default={})
    object_name: str | None = wire("name of the object (`object.set`); nil where none is named", nil=True)
    object_by: str | None = wire("client that named it, or took its name back", nil=True)
    object_t_ns: int | None = wire("when that client did", nil=True)
    streams: Mapping[str, StreamStatus] = wire("stream, e.g. `left.wrench` → its map, see below", default={})
    publisher: PublisherStatus | None = wire("`messages`: messages published since the start", default=None)
    late_s: float | None = wire(
        "longest stall of the daemon within the last second if it is above 0.01 s, else 0", default=None
    )
    lease: LeaseStatus | None = wire(
        "`held`: a client holds the lease; `expires_in_s`?: time until it ends unless it is renewed", default=None
    )
    gripper: GripperState | None = wire(
        "the newest state, as the topic `gripper`; nil where the config names no gripper", nil=True
    )
    recording: RecordingStatus | None = wire("the newest recording on request, see below", default=None)
    run_recording: RecordingStatus | None = wire(
        "the recording of the whole run (`slipd run --record`), likewise; nil where there is none", nil=True
    )
    incidents: IncidentsStatus | None = wire(
        "what was saved of incidents, see below", default=None, only="with `[recording.incidents]`"
    )
    notices: Mapping[str, str] = wire(
        'what is wrong around the daemon: "config" (a changed file has faults, and the config read before is kept), '
        '"realtime" (the priority is not permitted), "state" (what the run before kept is not used, or cannot be kept '
        'for the next), "latency" and a link (a USB adapter holds its bytes back) → the text for people',
        default={},
    )
