"""Decoder of the readings and answers of a Robotous sensor."""

from __future__ import annotations

import math

import numpy as np

from slipd.devices.robotous import robotous_packets as packets
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.frame_scanner import FixedLengthScanner
from slipd.types.samples import WrenchSample

COUNTS_PER_N = 50.0

_RAILS = frozenset((-(1 << 15), (1 << 15) - 1))


class Decoder:
    """Decode readings to wrench samples.

    The packets have neither sequence number nor time: `health.lost` stays 0 and ``device_time_ns`` is None. The only
    status name is "overload": an axis is out of range, or its count is at the end of its range.

    Args:
        torque_divider: Counts per N·m: 2000 for most models, 1000 for the RFT60-HA01.

    Raises:
        ValueError: The divider is below 1 or not finite.

    Attributes:
        replies: Answers among the bytes received last: the number of the command, and the 15 bytes after it.
    """

    def __init__(self, torque_divider: float = 2000.0) -> None:
        if not (math.isfinite(torque_divider) and torque_divider >= 1):
            raise ValueError(f"torque_divider must be a number of at least 1, got {torque_divider}")
        self.health = DecoderHealth()
        self.replies: list[tuple[int, bytes]] = []
        self._counts_per_unit = np.repeat((COUNTS_PER_N, torque_divider), 3)
        self._frames = FixedLengthScanner(packets.SYNC, packets.RESPONSE_LENGTH, packets.is_valid_response, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete, in the sensor's frame."""
        buffer, found = self._frames.receive(data)
        samples: list[WrenchSample] = []
        self.replies = []
        for at, in_sync in found:
            if buffer[at + 1] not in packets.READINGS:
                self.replies.append((buffer[at + 1], buffer[at + 2 : at + 17]))
                continue
            counts, overload, unused = packets.parse_reading(buffer, at)
            if any(unused) and not in_sync:
                # An 8-bit sum accepts too much noise. Out of sync, the unused bytes of a reading must be zero as well;
                # readings of a sensor that uses them are accepted from the second one on.
                self.health.bad += 1
                continue
            values = (np.array(counts) / self._counts_per_unit).tolist()
            is_in_range = not overload and _RAILS.isdisjoint(counts)
            samples.append(WrenchSample(t_ns, None, values[:3], values[3:], () if is_in_range else ("overload",)))
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a partial packet, because the line was closed."""
        self._frames.forget()
