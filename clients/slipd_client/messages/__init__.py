"""The wire format shared by the daemon and its clients. Imports nothing of slipd.

``schema`` declares every message, request and reply once; ``names`` holds their words, ``codec`` turns maps into bytes
and back. The same for people: ``docs/protocol.md``.
"""

from slipd_client.errors import MessageError, fault_text
from slipd_client.messages.codec import (
    CHECK_LIMITS,
    MESSAGE_LIMITS,
    REQUEST_LIMITS,
    Limits,
    decode,
    encode,
    request_limits,
)
from slipd_client.messages.names import (
    ERROR_CODES,
    EVIDENCE,
    GRASP_TOPIC,
    GRIPPER_TOPIC,
    HEALTH,
    IMAGE_REASONS,
    LEVELS,
    MOTION_TOPIC,
    PROTOCOL_VERSION,
    REASONS,
    SEVERITY,
    STATUS_TOPIC,
    TARE_REASONS,
    WARNING_TOPIC,
    ErrorCode,
    Health,
    Level,
    TareReason,
    level_code,
    slip_topic,
    tactile_topic,
    wrench_topic,
)

__all__ = [
    "CHECK_LIMITS",
    "ERROR_CODES",
    "EVIDENCE",
    "GRASP_TOPIC",
    "GRIPPER_TOPIC",
    "HEALTH",
    "IMAGE_REASONS",
    "LEVELS",
    "MESSAGE_LIMITS",
    "MOTION_TOPIC",
    "PROTOCOL_VERSION",
    "REASONS",
    "REQUEST_LIMITS",
    "SEVERITY",
    "STATUS_TOPIC",
    "TARE_REASONS",
    "WARNING_TOPIC",
    "ErrorCode",
    "Health",
    "Level",
    "Limits",
    "MessageError",
    "TareReason",
    "decode",
    "encode",
    "fault_text",
    "level_code",
    "request_limits",
    "slip_topic",
    "tactile_topic",
    "wrench_topic",
]
