"""The messages of another driver in a stream of bytes, and the readings in its reports."""

from __future__ import annotations

import re

from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Message, Report
from slipd.devices.health import DecoderHealth
from slipd.samples import GripperSample

_BEGIN = re.compile(rb"[\x82-\x8a](?:[\xa1-\xaf]|\Z)")  # a map of so many fields, and a key


class Decoder:
    """Makes a gripper sample of every report; ``echo_ok`` is None: `Session` knows what was asked.

    Bytes that are no message are `bad_bytes`, and each stretch of them is one `bad`; so is a message with an unknown
    key, a wrong kind of value, or a number that is not finite or beyond what a gripper can be.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._tail = b""
        self._in_garbage = False

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete."""
        samples = [sample(message, t_ns) for message in self.messages(data) if isinstance(message, Report)]
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a partial message, because the line was closed."""
        self._drop(len(self._tail))
        self._tail = b""

    def messages(self, data: bytes) -> list[Message]:
        """Decode bytes; return every message they complete."""
        buffer = self._tail + data
        found: list[Message] = []
        done = at = 0
        while (begin := _BEGIN.search(buffer, at)) is not None:
            at = begin.start()
            length = wire.measure(buffer, at)
            if length == 0:
                break
            message = wire.parse(buffer[at : at + length]) if length > 0 else None
            if message is None:
                at += 1
                continue
            self._drop(at - done)
            self._in_garbage = False
            done = at = at + length
            found.append(message)
        keep = at if begin is not None else len(buffer)
        self._drop(keep - done)
        self._tail = buffer[keep:]
        return found

    def _drop(self, count: int) -> None:
        """Count bytes that are no message."""
        if count:
            self.health.bad_bytes += count
            self.health.bad += not self._in_garbage
            self._in_garbage = True


def sample(report: Report, t_ns: int) -> GripperSample:
    """Return the reading of a report, received at ``t_ns``."""
    return GripperSample(
        t_ns=t_ns,
        device_time_ns=None,
        active=report.active,
        width_m=report.width_m,
        moving=report.moving,
        object=report.object,
        fault=report.fault,
        echo_ok=None,
        force_n=report.force_n,
    )
