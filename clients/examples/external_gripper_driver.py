"""Control a gripper of your own for slipd: docs/devices.md, "External gripper"."""

import socket
from collections.abc import Callable
from typing import Any

import msgpack


def message(**values: Any) -> bytes:
    """Pack one message of the format, version 1."""
    return msgpack.packb({"v": 1, **values})


def drive(
    path: str, state_of_my_gripper: Callable[[], dict[str, Any]], obey: Callable[[dict[str, Any]], float | None]
) -> None:
    """Register at the socket of the config's ``port``, report, and answer set-points until the daemon disconnects.

    Args:
        path: The path of ``unix:///PATH``.
        state_of_my_gripper: Returns a report, such as ``{"width_m": 0.05, "moving": False}``.
        obey: Starts the motion of a set-point, does not wait for its end, and returns the force that it set.
    """
    with socket.socket(socket.AF_UNIX) as daemon:
        daemon.connect(path)
        daemon.settimeout(0.02)
        daemon.sendall(message(name="my gripper", width_range_m=[0.0, 0.085], force_range_n=[5.0, 60.0]))
        received = msgpack.Unpacker()
        data = None
        while data != b"":
            try:
                data = daemon.recv(4096)
                received.feed(data)
            except TimeoutError:
                daemon.sendall(message(**state_of_my_gripper()))
            for request in received:
                if "op" in request:
                    applied_n = obey(request)
                    daemon.sendall(message(id=request["id"], applied_n=applied_n, **state_of_my_gripper()))
