"""Decoder of the readings of a WSG gripper."""

from __future__ import annotations

from slipd.devices.health import DecoderHealth
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import FINGERS, Reply
from slipd.samples import GripperSample


class Decoder:
    """Makes a gripper sample of each system state and of the width, force and grasping state that came since the last.

    The gripper sends the four one by one, each at the same period. Where one is missing there is no sample.
    ``active`` means referenced; ``echo_ok`` is None, because the updates do not contain what was requested; `Session`
    adds it. ``force_n`` is half of the force that the gripper sends, which is the sum of both fingers.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.words: frozenset[str] = frozenset()
        self._scanner = wire.Replies(self.health)
        self._round: dict[int, bytes] = {}

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete."""
        samples = (self.take(reply, t_ns) for reply in self.replies(data))
        return [sample for sample in samples if sample is not None]

    def forget(self) -> None:
        """Drop a partial reading, because the line was closed."""
        self._scanner.forget()
        self._round.clear()

    def replies(self, data: bytes) -> list[Reply]:
        """Take bytes and return every reply they complete; `take` makes samples of them."""
        return self._scanner.replies(data)

    def take(self, reply: Reply, t_ns: int) -> GripperSample | None:
        """Take a reply, received at ``t_ns``; return the sample whose last part it is."""
        if reply.id not in wire.UPDATES or reply.status != wire.OK:
            return None
        if reply.id != wire.STATE:
            if reply.id in self._round:  # the state between was damaged: what came before it is not mixed with this
                self._round.clear()
            self._round[reply.id] = reply.data
            return None
        told, self._round = self._round, {}
        if len(told) < len(wire.UPDATES) - 1:
            return None
        self.health.good += 1
        self.words = wire.parse_state(reply.data)
        return GripperSample(
            t_ns=t_ns,
            device_time_ns=None,
            active="referenced" in self.words,
            width_m=wire.parse_number(told[wire.WIDTH]) / 1000,
            moving="moving" in self.words,
            object=_object(self.words, wire.GRASPING_STATES[told[wire.GRASPING][0]]),
            fault=next((fault for fault in wire.FAULTS if fault in self.words), ""),
            echo_ok=None,
            force_n=wire.parse_number(told[wire.FORCE]) / FINGERS,
        )


def _object(words: frozenset[str], grasping: str) -> str:
    if "blocked_minus" in words or grasping == "holding":
        return "contact_closing"
    if "blocked_plus" in words:
        return "contact_opening"
    return "moving" if "moving" in words else "none"
