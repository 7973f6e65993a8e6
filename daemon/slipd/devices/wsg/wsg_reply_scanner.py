"""Find the replies of a WSG gripper in a stream of bytes, and reject those that cannot be its own."""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import wsg_messages as wire

_TYPICAL_BYTES = 14


class Reply(NamedTuple):
    """An answer or an update: id, status, and the data after it."""

    id: int
    status: int
    data: bytes


class ReplyScanner(PacketScanner):
    """Find the replies in a stream.

    Args:
        health: Receives ``bad`` and ``bad_bytes``.
    """

    def __init__(self, health: DecoderHealth) -> None:
        super().__init__(SEED_WITH_PREAMBLE, _is_reply, _TYPICAL_BYTES, health)

    def replies(self, data: bytes) -> list[Reply]:
        """Scan the next bytes of the stream; return the replies they complete."""
        return [
            Reply(
                packet.id,
                int.from_bytes(packet.payload[: wire.STATUS_LENGTH], "little"),
                packet.payload[wire.STATUS_LENGTH :],
            )
            for packet in self.packets(data)
        ]


def _is_reply(reply_id: int, size: int, payload: bytes) -> bool:
    expected = wire.REPLY_SIZES.get(reply_id)
    if expected is None or size not in (wire.STATUS_LENGTH, wire.STATUS_LENGTH + expected):
        return False
    if len(payload) < wire.STATUS_LENGTH:
        return True
    status = int.from_bytes(payload[: wire.STATUS_LENGTH], "little")
    if status >= len(weiss.STATUS_WORDS) or size != wire.STATUS_LENGTH + (expected if status == wire.OK else 0):
        return False
    return len(payload) < size or _is_sound(reply_id, status, payload[wire.STATUS_LENGTH :])


def _is_sound(reply_id: int, status: int, data: bytes) -> bool:
    """Return whether the numbers of a reply are plausible."""
    if status != wire.OK:
        return True
    if reply_id in (wire.GET_FORCE, wire.WIDTH, wire.FORCE):
        return abs(wire.parse_number(data)) <= wire.MOST  # also False for NaN
    if reply_id == wire.GRASPING:
        return data[0] < len(wire.GRASPING_STATES)
    if reply_id == wire.LIMITS:
        return _are_limits(wire.parse_limits(data))
    return True


def _are_limits(limits: wire.Limits) -> bool:
    return (
        all(map(math.isfinite, limits))
        and 0.0 < limits.stroke_mm <= wire.MOST
        and 0.0 <= limits.min_speed < limits.max_speed <= wire.MOST
        and 0.0 <= limits.min_force < limits.nominal_force <= wire.MOST
    )
