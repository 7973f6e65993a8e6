"""Replies of a WSG gripper, found in a stream of bytes, and the readings among them."""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.frame_scanner import FrameDecoder
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import FINGERS
from slipd.types.samples import GripperSample

_TYPICAL_BYTES = 14


class Reply(NamedTuple):
    """An answer or an update: id, status, and the data after it."""

    id: int
    status: int
    data: bytes


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


NEWEST = 2 * len(wire.UPDATES)
"""An update counts for as long as it is one of this many newest: in any order, those of two periods."""


class Decoder(FrameDecoder):
    """Return a gripper sample of each system state, with the newest width, force and grasping state.

    The gripper sends the four one by one, each at the same period, but in no fixed order: the Robotics Library
    (roboticslibrary/rl at 91df9f2, ``src/rl/hal/WeissWsg50.cpp``, ``recv`` and ``step``) keeps the newest of each too.
    If one is missing for longer than a period there is no sample. ``active``
    means referenced. ``echo_ok`` is None, because the updates do not contain the requests; `Session` sets it.
    ``force_n`` is half of the force that the gripper sends, which is the sum of both fingers.
    """

    _frames: PacketScanner

    def __init__(self) -> None:
        super().__init__()
        self.words: frozenset[str] = frozenset()
        self._frames = PacketScanner(SEED_WITH_PREAMBLE, _is_reply, _TYPICAL_BYTES, self.health)
        self._newest: dict[int, tuple[int, bytes]] = {}  # by id: number and data of the update
        self._count = 0  # of updates

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete."""
        samples = (self.decode_reply(reply, t_ns) for reply in self.messages(data))
        return [sample for sample in samples if sample is not None]

    def forget(self) -> None:
        """Drop a partial reading, because the line was closed."""
        super().forget()
        self._newest.clear()

    def messages(self, data: bytes) -> list[Reply]:
        """Scan bytes; return every reply they complete, for `decode_reply`."""
        return [
            Reply(
                packet.id,
                int.from_bytes(packet.payload[: wire.STATUS_LENGTH], "little"),
                packet.payload[wire.STATUS_LENGTH :],
            )
            for packet in self._frames.packets(data)
        ]

    def decode_reply(self, reply: Reply, t_ns: int) -> GripperSample | None:
        """Decode a reply received at ``t_ns``; return the sample that it completes, if any."""
        if reply.id not in wire.UPDATES or reply.status != wire.OK:
            return None
        self._count += 1
        self._newest[reply.id] = self._count, reply.data
        if reply.id != wire.STATE:
            return None
        parts = {update: data for update, (number, data) in self._newest.items() if self._count - number < NEWEST}
        if len(parts) < len(wire.UPDATES):
            return None
        self.health.good += 1
        self.words = wire.parse_state(reply.data)
        return GripperSample(
            t_ns=t_ns,
            device_time_ns=None,
            active="referenced" in self.words,
            width_m=wire.parse_number(parts[wire.WIDTH]) / 1000,
            moving="moving" in self.words,
            object=_object(self.words, wire.GRASPING_STATES[parts[wire.GRASPING][0]]),
            fault=next((fault for fault in wire.FAULTS if fault in self.words), ""),
            echo_ok=None,
            force_n=wire.parse_number(parts[wire.FORCE]) / FINGERS,
        )


def _object(words: frozenset[str], grasping: str) -> str:
    if "blocked_minus" in words or grasping == "holding":
        return "contact_closing"
    if "blocked_plus" in words:
        return "contact_opening"
    return "moving" if "moving" in words else "none"
