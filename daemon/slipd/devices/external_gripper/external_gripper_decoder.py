"""Decoder of the messages of an external driver, and of the readings in its reports."""

from __future__ import annotations

import re

from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Message, Report
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.msgpack_scanner import MsgpackScanner
from slipd.types.samples import GripperSample

_BEGIN = re.compile(rb"[\x82-\x8a](?:[\xa1-\xaf]|\Z)")  # a map of 2 to 10 fields, and a key


class Decoder:
    """Return a gripper sample of every report; `Session` sets its ``echo_ok``, because it knows the requests.

    Bytes outside messages are `bad_bytes`, and each stretch of them is one `bad`; so is a message with an unknown key,
    a value of the wrong type, or a number that is not finite or beyond any gripper's range.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._scanner: MsgpackScanner[Message] = MsgpackScanner(
            _BEGIN, wire.measure, wire.parse, self.health, limited=False
        )

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete."""
        samples = [sample(message, t_ns) for message in self.messages(data) if isinstance(message, Report)]
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a partial message, because the line was closed."""
        self._scanner.forget()

    def messages(self, data: bytes) -> list[Message]:
        """Decode bytes; return every message they complete."""
        return self._scanner.messages(data)


def sample(report: Report, t_ns: int) -> GripperSample:
    """Return the reading of a report received at ``t_ns``."""
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
