"""The words of the wire and their meanings: topics, levels, reasons, health, error codes."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Literal, get_args

PROTOCOL_VERSION = 1
"""``v`` of every message, request and reply; raised by a change that an old client would misread."""

Level = Literal["no_contact", "stable", "caution", "warning", "slipping", "unknown"]
LEVELS: tuple[Level, ...] = get_args(Level)
"""Every level in the order of ``level_code``, 0 to 5. "unknown" is not "no slip"."""

SEVERITY: dict[str, int] = {"no_contact": 0, "stable": 1, "unknown": 2, "caution": 3, "warning": 4, "slipping": 5}
"""Severity of each level; "unknown" is worse than any level at which the grip holds."""

LEVEL_MEANINGS: dict[Level, str] = {
    "no_contact": "nothing presses on the pad",
    "stable": "the contact holds",
    "caution": "utilisation is at or above 0.70 (all thresholds are configurable)",
    "warning": "utilisation is at or above 0.85: act now",
    "slipping": "the contact slips",
    "unknown": 'the daemon cannot tell; `reasons` say why. **Unknown is not "no slip"**',
}


class SlipLevel(str, Enum):
    """How close a contact is to slipping, for Python; each is also its word (``level == "warning"``)."""

    NO_CONTACT = "no_contact"
    STABLE = "stable"
    CAUTION = "caution"
    WARNING = "warning"
    SLIPPING = "slipping"
    UNKNOWN = "unknown"

    @property
    def alarming(self) -> bool:
        """Whether the robot must act: the contact is about to slip, or slips. Unknown is not alarming, nor safe."""
        return self in (SlipLevel.WARNING, SlipLevel.SLIPPING)

    def __str__(self) -> str:
        return str(self.value)


REASONS = {
    "translation": "the tangential force is close to what friction can carry",
    "rotation": "the torque about the pad's normal is close to what friction can carry",
    "tipping": "the contact is close to the edge of the pad",
    "slip_detected": "the contact moves",
    "stale": "readings that this verdict needs have been missing for longer than `stale_s`; "
    "readings that wait in a queue because the daemon is late are not missing",
    "no_mu": "no friction coefficient is known: motion is seen, but a slip is not predicted",
    "rotation_unobserved": "there is no usable pad image, so the torque that the contact can carry is not known",
    "unsupportable": "no grip force holds this load",
    "not_finite": "a reading is not a finite number",
    "overload": "the sensor is beyond its range",
    "invalid": "the sensor marks its reading as invalid",
    "raw": "the sensor sends uncalibrated values",
    "weight_unknown": "the direction of the finger's own weight is not known, because neither an arm stream nor "
    "`gravity.set` gives it; it may use up the margin or hide a contact",
    "stuck": "the sensor repeats its readings, and a working one would not",
    "garbage": "the readings are beyond the sensor's range, or change faster than a force can",
    "not_tared": "the zero of a sensor is not known: its reading may be an offset, and its offset may hide a load",
    "pulled": "the normal force is clearly negative: sign, mounting or configuration of the sensor is wrong",
    "disagreement": "force sensor and pad image contradict each other",
    "disagreement_contact": "they differ on whether there is a contact: one of both shows a clear contact, "
    "the other none",
    "disagreement_centroid": "they differ on where the contact is",
    "disagreement_force": "they differ on the normal force; only where the image is calibrated to newtons",
}
"""Reason of a level → its meaning. A newer daemon may send further reasons: show them as they are."""

EVIDENCE = {
    "load_drop": "the load fell from what static friction carries to what dynamic friction carries, or is larger than "
    "any friction carries",
    "image_change": "the shares of the taxels change while the load does not",
    "width": "the width of the gripper changes while the grip force does not",
    "external": "an external driver measured that the object moves",
}
"""Evidence that the object moves → its meaning. A newer daemon may send further words: show them as they are."""

IMAGE_REASONS = {
    "stale": "no image has arrived for too long",
    "not_finite": "a reading is not a finite number",
    "garbage": "the readings are larger than any pad can produce",
    "overload": "the pad is beyond its range",
    "invalid": "the pad marks its image as invalid",
    "raw": "the pad sends uncalibrated values",
    "stuck": "the images repeat while the force changes",
    "not_tared": "the zero of a sensor is not known: its reading may be an offset, and its offset may hide a load",
    "masked": "more than a quarter of the taxels is masked",
    "contact_unseen": "the beginning of the contact was not observed, and this pad measures only changes",
}
"""Why an image cannot be used → its meaning. A newer daemon may send further reasons: show them as they are."""

TareReason = Literal["contact", "pulled", "moved", "turned", "silent", "ended", "undone"]
TARE_REASONS: dict[TareReason, str] = {
    "contact": "a contact began",
    "pulled": "the normal force became negative",
    "moved": "the readings spread wider than the sensor's noise",
    "turned": "the arm stream or `gravity.set` reported that the finger was turned",
    "silent": "the stream was silent for half a second",
    "ended": "the link went down, or the host slept",
    "undone": "`tare.undo` took it back",
}
"""Why a tare was given up → its meaning. A newer daemon may send further reasons."""

GRASP_TOPIC = "grasp"
GRIPPER_TOPIC = "gripper"
MOTION_TOPIC = "motion"
WARNING_TOPIC = "warning"
STATUS_TOPIC = "status"


class Health(IntEnum):
    """Health of a stream, in the numbers of ROS diagnostics."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


HEALTH = tuple(Health.__members__)
"""Names of the health codes, in code order."""

GRIP_UNKNOWN = "an object is held with a force that is not known"
"""In the message of the stream of a gripper whose grip no request can change."""

DAEMON_LATE = "the daemon was late by"
"""Begin of the message of a stream that waited for the daemon, and is well itself."""

ErrorCode = Literal[
    "malformed",
    "unsupported_version",
    "unknown_op",
    "missing_field",
    "unknown_field",
    "bad_type",
    "not_finite",
    "out_of_range",
    "too_fast",
    "budget_spent",
    "wrong_boot",
    "deadline_passed",
    "deadline_too_far",
    "repeated_id",
    "replayed",
    "busy",
    "read_only",
    "no_lease",
    "lease_held",
    "no_limit",
    "not_active",
    "activating",
    "in_contact",
    "gripper_fault",
    "fault_latched",
    "no_gripper",
    "unknown_finger",
    "not_ready",
    "no_room",
    "record_failed",
]
ERROR_CODES: tuple[ErrorCode, ...] = get_args(ErrorCode)
"""Every ``error.code`` of a reply. A newer daemon may send further codes."""

ERROR_MEANINGS: dict[ErrorCode, str] = {
    "malformed": "not one msgpack map within the [limits](#limits)",
    "unsupported_version": "the daemon does not support this `v`",
    "unknown_op": "there is no such op",
    "missing_field": "a field that the op requires is missing",
    "unknown_field": "the op has no such field",
    "bad_type": "a field has another type than the op requires",
    "not_finite": "a number is NaN or infinite",
    "out_of_range": "a value is outside its range, or a step of the force is too large",
    "too_fast": "the force of a held object may change by that much only later; the message says when",
    "budget_spent": "the raises of this grasp add up to the configured budget: open, and grip again",
    "wrong_boot": "the request is meant for another run of the daemon: send `hello` again",
    "deadline_passed": "the request arrived after its deadline and was not carried out",
    "deadline_too_far": "the deadline is more than 500 ms ahead: send `hello` again",
    "repeated_id": "this client used the `id` for another request",
    "replayed": "another client sent exactly this request before",
    "busy": "there are too many requests at once: ask again later",
    "read_only": "the client's key may read but not request",
    "no_lease": "the client does not hold the lease, or it has ended",
    "lease_held": "another client holds the lease, and only its holder may do this",
    "no_limit": "the config gives no force limit",
    "not_active": "the gripper is not activated",
    "activating": "the gripper is still activating: ask again once `active` is true",
    "in_contact": "opening would drop an object, or a tare would erase its load",
    "gripper_fault": "the gripper reports a fault",
    "fault_latched": "a fault is latched: look at it, then send `fault.ack`",
    "no_gripper": "the config has no gripper, or the gripper does not answer",
    "unknown_finger": "there is no such finger",
    "not_ready": "a condition of the request is not met, e.g. there are no fresh readings",
    "no_room": "a limit of the recordings is reached: their number, or the free disk space",
    "record_failed": "the file of the recording could not be created; the message says why",
}
"""Error code → its meaning."""


def level_code(level: str) -> int:
    """Return the number of a level, 0 to 5.

    Raises:
        ValueError: ``level`` is not one of ``LEVELS``.
    """
    return LEVELS.index(level)


def slip_topic(finger: str) -> str:
    """Return the topic of the verdicts on one finger."""
    return f"slip.{finger}"


def wrench_topic(finger: str) -> str:
    """Return the topic of the force on one finger."""
    return f"wrench.{finger}"


def tactile_topic(finger: str) -> str:
    """Return the topic of the pad image of one finger."""
    return f"tactile.{finger}"
