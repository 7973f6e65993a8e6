"""Push the readings of a force sensor, whose port your program owns, to slipd: docs/devices.md, "External readings"."""

import itertools
import time
from collections.abc import Callable

import msgpack
import zmq


def push(endpoint: str, read_my_sensor: Callable[[], tuple[list[float], list[float]]]) -> None:
    """Push every reading, N and N·m in the sensor's frame, to the ``port`` of the config, for ever."""
    with zmq.Context.instance().socket(zmq.PUSH) as socket:
        socket.setsockopt(zmq.LINGER, 1000)
        socket.setsockopt(zmq.IMMEDIATE, 1)  # readings are not kept for a daemon that starts later: `send` waits for it
        socket.connect(endpoint)
        for seq in itertools.count():
            force_n, torque_nm = read_my_sensor()
            reading = {
                "stream": "left.wrench",
                "t_ns": time.monotonic_ns(),
                "seq": seq,
                "force_n": force_n,
                "torque_nm": torque_nm,
            }
            socket.send(msgpack.packb(reading))
