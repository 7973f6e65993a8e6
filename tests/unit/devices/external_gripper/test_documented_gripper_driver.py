"""The example driver of docs/devices.md, run against a session."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from external_gripper_driver import drive
from permits import halt, move, set_force

from slipd.devices.external_gripper import Session

PATIENCE_S = 30.0


def test_the_documented_driver_registers_reports_and_obeys(tmp_path: Path) -> None:
    path = str(tmp_path / "gripper")
    setpoints: list[dict[str, Any]] = []

    def obey(setpoint: dict[str, Any]) -> float | None:
        setpoints.append(setpoint)
        return setpoint.get("force_n")

    driver = threading.Thread(target=drive, args=(path, lambda: {"width_m": 0.05, "moving": False}, obey))
    session, until_s = Session(), time.monotonic() + PATIENCE_S
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path)
        server.listen()
        driver.start()
        line, _ = server.accept()
        with line:
            line.settimeout(0.005)
            session.start(0)  # the time of the session stands still: no pause of this process is a silent driver

            def settle() -> None:
                """Go on until the driver has obeyed."""
                while session.state != "active" or session._queue.due_ns is not None:
                    assert time.monotonic() < until_s, session.state
                    line.sendall(session.on_time(0))
                    with suppress(TimeoutError):
                        session.receive(line.recv(4096), 0)

            settle()
            assert move(session, 0.0, None, 100.0) == 60.0
            settle()
            assert set_force(session, 7.0) == 7.0
            settle()
            assert halt(session)
            settle()
    driver.join(PATIENCE_S)
    assert not driver.is_alive()
    obeyed = [(setpoint["op"], setpoint.get("force_n")) for setpoint in setpoints]
    assert obeyed == [("move", 60.0), ("force", 7.0), ("stop", None)]
    assert (session.identity, session.command_lost, session._queue.echo_ok) == ("my gripper", False, True)
    assert (session.health.bad, session.health.lost) == (0, 0)
