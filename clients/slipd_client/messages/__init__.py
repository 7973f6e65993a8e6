"""The wire schema shared by the daemon and its clients: names, version and codec. Imports nothing of slipd.

What each message and request carries is told in ``docs/protocol.md``.
"""

from slipd_client.messages.codec import (
    MESSAGE_LIMITS,
    REQUEST_LIMITS,
    Limits,
    MessageError,
    decode,
    encode,
    fault_text,
)
from slipd_client.messages.names import (
    ERROR_CODES,
    GRASP_TOPIC,
    GRIPPER_TOPIC,
    HEALTH,
    IMAGE_REASONS,
    LEVELS,
    PROTOCOL_VERSION,
    REASONS,
    STATUS_TOPIC,
    WARNING_TOPIC,
    ErrorCode,
    Health,
    Level,
    level_code,
    slip_topic,
    tactile_topic,
    wrench_topic,
)

__all__ = [
    "ERROR_CODES",
    "GRASP_TOPIC",
    "GRIPPER_TOPIC",
    "HEALTH",
    "IMAGE_REASONS",
    "LEVELS",
    "MESSAGE_LIMITS",
    "PROTOCOL_VERSION",
    "REASONS",
    "REQUEST_LIMITS",
    "STATUS_TOPIC",
    "WARNING_TOPIC",
    "ErrorCode",
    "Health",
    "Level",
    "Limits",
    "MessageError",
    "decode",
    "encode",
    "fault_text",
    "level_code",
    "slip_topic",
    "tactile_topic",
    "wrench_topic",
]
