"""Robotiq TSF-85 fingertips as seen from their line: packets at a period, with arrays that change 60 times per second.

Not emulated: the asynchronous stream, single readings, and signals of the inertial sensors.
"""

from __future__ import annotations

import numpy as np

from slipd.devices import tsf85
from slipd.devices.tsf85 import encode_block
from slipd.tools.sim.emulators import EmulatedTactile, TactileStream

FIRMWARE = b"1.1.8"
REFRESH_HZ = 60.0
NOISE_COUNTS = 2.0
REST_COUNTS = 30
"""Reading of a taxel without load."""

_HEAD_LENGTH = 4
_LONGEST = _HEAD_LENGTH + 255
_FULL_SCALE = (1 << 16) - 1


class Fingertips(EmulatedTactile):
    """The sensors on their line; their caller passes the time.

    Args:
        seed: Seed of the noise.
        timestamp_unit_ns: Unit of its timestamp.
    """

    def __init__(self, seed: int, timestamp_unit_ns: int = 1000) -> None:
        stream = TactileStream(seed, 1000.0, (tsf85.TAXELS,), NOISE_COUNTS)
        super().__init__(stream, REFRESH_HZ, timestamp_unit_ns=timestamp_unit_ns)
        self._unit_ns = timestamp_unit_ns
        self._refresh = -1
        self._arrays = b""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; return the answers."""
        self._received += data
        output: list[bytes] = []
        while (at := self._received.find(b"\x9a")) >= 0:
            packet = self._received[at:]
            if len(packet) < _HEAD_LENGTH or len(packet) < (length := _HEAD_LENGTH + packet[3]):
                break
            output += self._obey(packet[2], packet[_HEAD_LENGTH:length], t_ns)
            self._received = packet[length:]
        self._received = self._received[-_LONGEST:]
        return output

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the packets due by then."""
        return [self._packet(taken_ns) for taken_ns in self._stream.times(t_ns)]

    def _obey(self, command: int, content: bytes, t_ns: int) -> list[bytes]:
        if command == tsf85.VERSION:
            return [tsf85.encode_packet(tsf85.VERSION, FIRMWARE)]
        if command == tsf85.AUTOSEND and content and content[0]:
            self._stream.start(t_ns, 1000.0 / content[0])
            self._refresh = -1
        elif command == tsf85.AUTOSEND:
            self._stream.stop()
        return []

    def _packet(self, taken_ns: int) -> bytes:
        refresh = int(taken_ns * REFRESH_HZ // 1e9)
        fresh, self._refresh = refresh != self._refresh, refresh
        if fresh:
            images = (self._stream.image(str(finger)) + REST_COUNTS for finger in range(tsf85.FINGERS))
            counts = [np.clip(np.rint(image), 0, _FULL_SCALE) for image in images]
            self._arrays = b"".join(encode_block(tsf85.STATIC, finger, each) for finger, each in enumerate(counts))
        blocks = self._arrays
        for finger in range(tsf85.FINGERS):
            blocks += encode_block(tsf85.DYNAMIC, finger, [0])
            blocks += encode_block(tsf85.ACCELEROMETER, finger, [0, 0, 16384])
            blocks += encode_block(tsf85.TIMESTAMP, finger, [taken_ns // self._unit_ns])
        return tsf85.encode_packet(tsf85.AUTOSEND, blocks)


make = Fingertips
