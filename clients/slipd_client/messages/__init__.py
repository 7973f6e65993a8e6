"""The wire format shared by the daemon and its clients: every message, request and reply, each declared once.

``topics`` declares the messages and ``parts`` the maps within them, ``ops`` and ``request_fields`` the requests,
``replies`` their results; ``fields`` says what a field is, ``names`` holds the words, ``codec`` turns maps into bytes
and back. The daemon's check of requests, the typed messages and replies (``typed``), the arguments of ``slipctl`` and
the tables of ``docs/protocol.md`` all come from here.
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
