"""Slow a UR down while the grip would not hold: ``python3 ur_speed.py ROBOT``. It moves the speed slider, by RTDE.

The program on the robot needs no change. The slider scales speeds, so that accelerations fall by its square.
"""

from __future__ import annotations

import socket
import struct
import sys

from slipd_client.motion import MotionAdvisor

PORT, RATE_HZ = 30004, 50.0
FLOOR = 0.1
"""Slider while slipd does not know what holds, also with nothing in the gripper. 0 would pause the robot."""
RISE = 0.01
"""Largest rise in one step: the arm speeds up over two seconds, and slows down at once."""


class Rtde:
    """The parts of UR's Real-Time Data Exchange, protocol version 2, that this needs; integers are big-endian."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket, self._bytes = connection, connection.makefile("rb")
        self._ask(b"V", struct.pack(">H", 2))
        outputs = self._ask(b"O", struct.pack(">d", RATE_HZ) + b"timestamp")
        inputs = self._ask(b"I", b"speed_slider_mask,speed_slider_fraction")
        if outputs[1:] != b"DOUBLE" or inputs[1:] != b"UINT32,DOUBLE":
            raise SystemExit(f"the robot does not let this program move the slider: {inputs[1:].decode()}")
        self._recipe = inputs[0]
        if self._ask(b"S", b"") != b"\x01":
            raise SystemExit("the robot does not start the exchange")

    def wait(self) -> None:
        """Wait for the next package of the robot, which sends them at `RATE_HZ`."""
        self._receive(b"U")

    def set_slider(self, fraction: float) -> None:
        """Move the speed slider, 0 to 1."""
        self._send(b"U", struct.pack(">BId", self._recipe, 1, fraction))

    def _ask(self, kind: bytes, payload: bytes) -> bytes:
        self._send(kind, payload)
        return self._receive(kind)

    def _send(self, kind: bytes, payload: bytes) -> None:
        self._socket.sendall(struct.pack(">Hc", 3 + len(payload), kind) + payload)

    def _receive(self, wanted: bytes) -> bytes:
        while True:  # text messages of the robot may come between
            header = self._bytes.read(3)
            if len(header) < 3:
                raise SystemExit("the robot closed the connection")
            size, kind = struct.unpack(">Hc", header)
            payload = self._bytes.read(size - 3)
            if kind == wanted:
                return payload


def main(robot: str, port: int = PORT, publish: str | None = None) -> None:
    """Set the slider at every package of the robot, until it closes the connection."""
    slider = FLOOR
    with MotionAdvisor(publish) as advisor, socket.create_connection((robot, port), timeout=5.0) as connection:
        rtde = Rtde(connection)
        while True:
            rtde.wait()
            slider = min(advisor.speed_scale(FLOOR) or 0.0, slider + RISE)
            rtde.set_slider(slider)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: ur_speed.py ROBOT, its name or address")
    main(sys.argv[1])
