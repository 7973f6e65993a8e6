"""The words of the wire (topics, levels, reasons, health, error codes): both ends spell them alike."""

from __future__ import annotations

from enum import IntEnum
from typing import Literal, get_args

PROTOCOL_VERSION = 1
"""``v`` of every message, request and reply; raised by a change that an old client would misread."""

Level = Literal["no_contact", "stable", "caution", "warning", "slipping", "unknown"]
LEVELS: tuple[Level, ...] = get_args(Level)
"""Every level in the order of ``level_code``, 0 to 5. "unknown" is not "no slip"."""

REASONS = {
    "translation": "the pull along the pad nears what friction carries",
    "rotation": "the twist about the pad nears what friction carries",
    "tipping": "the contact nears the edge of the pad",
    "slip_detected": "the contact moves",
    "stale": "readings that this verdict needs have been missing for longer than `stale_s`; "
    "readings that wait for a late daemon are not missing",
    "no_mu": "no friction coefficient is given",
    "rotation_unobserved": "without a pad image it is not known how much twist the contact carries",
    "unsupportable": "no grip force holds this load",
    "not_finite": "a reading is not a finite number",
    "overload": "the sensor is beyond its range",
    "invalid": "the sensor marks its reading as invalid",
    "raw": "the sensor sends values that it has not calibrated",
    "weight_unknown": "the pull of the finger's own weight is not known, and may use up the margin or hide a contact",
    "stuck": "the sensor repeats its readings and should not",
    "garbage": "the sensor's readings are beyond its range, or jump to and fro faster than a force can",
    "not_tared": "the pad was never tared, and reads a load that may not exist",
    "pulled": "the normal force is clearly negative: sign, mounting or configuration of the sensor is wrong",
    "disagreement": "force sensor and pad image contradict each other",
    "disagreement_contact": "about the contact: the sensor feels a clear force, and the image shows none",
    "disagreement_centroid": "about where the contact is",
    "disagreement_force": "about how much presses; only where the image is calibrated to newtons",
}
"""Reason of a level → its meaning. A newer daemon may send further reasons: show them as they are."""

IMAGE_REASONS = {
    "stale": "no image came for too long",
    "not_finite": "a reading is not a finite number",
    "garbage": "the readings are larger than those of any pad",
    "overload": "the pad is beyond its range",
    "invalid": "the pad marks its image as invalid",
    "raw": "the pad sends values that it has not calibrated",
    "stuck": "the images repeat while the force moves",
    "not_tared": "the pad was never tared, and reads a load that may not exist",
    "masked": "more than a quarter of the taxels is masked",
    "contact_unseen": "the beginning of the contact was not seen, and charge shows only changes",
}
"""Why an image cannot be used → its meaning. A newer daemon may send further reasons: show them as they are."""

GRASP_TOPIC = "grasp"
GRIPPER_TOPIC = "gripper"
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

ErrorCode = Literal[
    "malformed",  # not one msgpack map within the limits
    "unsupported_version",  # ``v`` is not one the daemon speaks
    "unknown_op",
    "missing_field",
    "unknown_field",
    "bad_type",
    "not_finite",
    "out_of_range",
    "too_fast",  # the force of a held object may change so far again only later
    "budget_spent",  # the raises of this grasp add up to all that is allowed
    "wrong_boot",  # meant for another run of the daemon
    "deadline_passed",
    "deadline_too_far",
    "repeated_id",  # this client used the id for another request
    "replayed",  # another client sent this very request before
    "busy",  # too many requests: what they asked must be remembered until their deadlines
    "read_only",  # the client's key may not request
    "no_lease",  # the client holds no lease
    "lease_held",  # another client holds it
    "no_limit",  # the config gives no force limit, so nothing is moved
    "not_active",  # the gripper is not activated
    "activating",  # the gripper is still activating
    "in_contact",  # opening would drop an object, taring would erase its load
    "gripper_fault",
    "fault_latched",  # something went wrong: say fault.ack once it has been looked at
    "no_gripper",  # the config names none, or it does not answer
    "unknown_finger",
    "not_ready",  # what the request needs is not there, e.g. fresh readings
    "no_room",  # a limit of the recordings is reached: their number, or the free space of the disk
    "record_failed",  # the file of the recording could not be created
]
ERROR_CODES: tuple[ErrorCode, ...] = get_args(ErrorCode)
"""Every ``error.code`` of a reply. A newer daemon may send further codes."""


def level_code(level: str) -> int:
    """Number of a level, 0 to 5.

    Raises:
        ValueError: ``level`` is none of ``LEVELS``.
    """
    for code, known in enumerate(LEVELS):
        if known == level:
            return code
    raise ValueError(f"unknown level {level!r}; levels are {', '.join(LEVELS)}")


def slip_topic(finger: str) -> str:
    """Topic of the verdicts of one finger."""
    return f"slip.{finger}"


def wrench_topic(finger: str) -> str:
    """Topic of the forces of one finger."""
    return f"wrench.{finger}"


def tactile_topic(finger: str) -> str:
    """Topic of the pad image of one finger."""
    return f"tactile.{finger}"
