"""Push a serial WitMotion IMU (WT901 and relatives) on the gripper to slipd's stream ``[grasp.arm]`` (docs/arm.md).

    python3 imu_pusher.py /dev/ttyUSB0 ipc:///run/slipd/readings.ipc

Set the IMU to 200 Hz and 115,200 baud with the maker's program, and mount its axes along those of the gripper frame,
near its origin: away from it, add α × r + ω × (ω × r). Packets of 11 bytes: 0x55, a kind, four little-endian int16, the
sum of all bytes before. Kind 0x51 is the specific force (32768: 16 g), 0x52 the angular velocity (32768: 2000 °/s).
"""

from __future__ import annotations

import contextlib
import itertools
import math
import struct
import sys
import time
from collections.abc import Iterator

import msgpack
import serial
import zmq

BAUD, PACKET = 115_200, 11
FORCE, TURN = 0x51, 0x52
MPS2, RADPS = 16.0 * 9.80665 / 32768, math.radians(2000.0) / 32768


class Packets:
    """Finds packets in bytes, however these are split."""

    def __init__(self) -> None:
        self._rest = b""

    def receive(self, data: bytes) -> Iterator[tuple[int, list[int]]]:
        """Yield the kind and the first three numbers of each packet whose sum is right."""
        self._rest += data
        while (begin := self._rest.find(0x55)) >= 0 and len(self._rest) >= begin + PACKET:
            packet = self._rest[begin : begin + PACKET]
            if sum(packet[:-1]) & 0xFF == packet[-1]:
                self._rest = self._rest[begin + PACKET :]
                yield packet[1], list(struct.unpack_from("<3h", packet, 2))
            else:
                self._rest = self._rest[begin + 1 :]
        self._rest = self._rest[max(begin, 0) :] if begin >= 0 else b""


def readings(data: bytes, packets: Packets, newest: dict[int, list[int]]) -> Iterator[dict[str, list[float]]]:
    """Yield a reading at each angular velocity; gravity is the specific force with the other sign."""
    for kind, numbers in packets.receive(data):
        newest[kind] = numbers
        if kind == TURN and FORCE in newest:
            force, turn = newest.pop(FORCE), newest.pop(TURN)
            yield {
                "gravity_mps2": [-MPS2 * number for number in force],
                "angular_velocity_radps": [RADPS * number for number in turn],
            }


def main(port: str, endpoint: str) -> None:
    """Push every reading, for ever."""
    packets, newest, numbers = Packets(), {}, itertools.count()
    with serial.Serial(port, BAUD, timeout=1.0) as line, zmq.Context.instance().socket(zmq.PUSH) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.IMMEDIATE, 1)  # a reading is not kept for a daemon that starts later
        socket.connect(endpoint)
        while True:
            data = line.read(max(line.in_waiting, PACKET))
            t_ns = time.monotonic_ns()
            for reading in readings(data, packets, newest):
                message = msgpack.packb({"stream": "arm", "t_ns": t_ns, "seq": next(numbers), **reading})
                with contextlib.suppress(zmq.Again):  # no daemon takes it
                    socket.send(message, zmq.NOBLOCK)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit("usage: imu_pusher.py PORT ENDPOINT, e.g. /dev/ttyUSB0 ipc:///run/slipd/readings.ipc")
    main(*sys.argv[1:])
