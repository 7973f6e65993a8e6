"""The driver of another gripper: it registers, reports at 50 Hz, and obeys set-points, or not.

A rigid part is between its jaws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgpack

from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Registration, Report
from slipd.tools.sim.emulators import EmulatedDevice
from slipd.tools.sim.jaws import moved_jaws

DRIVER = Registration("emulated driver", (0.0, 0.1), (2.0, 60.0), (0.01, 0.2))
RATE_HZ = 50.0
SPEED_MPS = 0.1


def encode_registration(registration: Registration) -> bytes:
    """Return the registration of a driver.

    Args:
        registration: Name (letters, digits, spaces and ``_./-``; the connection keeps it), and smallest and largest
            width between the pads, m, force on one pad, N, and speed, m/s (None if the speed cannot be set).

    Raises:
        ValueError: The daemon would reject it.
    """
    body: dict[str, Any] = {"v": wire.VERSION, "name": registration.name}
    body |= {"width_range_m": registration.width_range_m, "force_range_n": registration.force_range_n}
    if registration.speed_range_mps is not None:
        body["speed_range_mps"] = registration.speed_range_mps
    return _checked(body)


def encode_report(report: Report) -> bytes:
    """Return a report of a driver, or its answer to a set-point.

    Raises:
        ValueError: The daemon would reject it.
    """
    body: dict[str, Any] = {
        "v": wire.VERSION,
        "width_m": report.width_m,
        "active": report.active,
        "moving": report.moving,
    }
    body |= {"object": report.object, "fault": report.fault, "force_n": report.force_n}
    if report.id is not None:
        body |= {"id": report.id, "applied_n": report.applied_n}
    if report.error:
        body["error"] = report.error
    return _checked(body)


def _checked(body: dict[str, Any]) -> bytes:
    data: bytes = msgpack.packb(body)
    if wire.measure(data, 0) != len(data) or wire.parse(data) is None:
        raise ValueError(f"a driver's message must have finite numbers within their bounds, got {body}")
    return data


class Driver(EmulatedDevice):
    """The driver on its line; its caller passes the time.

    Attributes:
        part_m: Width of the part between the jaws, m; 0: no part.
        report: Its present report.
        force_n: Commanded force, N on one pad.
        obeyed: The set-points that it obeyed.
        notices: Notices from the daemon.
        excess: Relative excess of its force over the command.
        mute: Whether it ignores set-points.
    """

    def __init__(self) -> None:
        super().__init__(RATE_HZ)
        self.part_m = 0.04
        self.report = Report(0.08)
        self.force_n = DRIVER.force_range_n[0]
        self.obeyed: list[dict[str, Any]] = []
        self.notices: list[dict[str, Any]] = []
        self.excess = 0.0
        self.mute = False
        self._unpacker = msgpack.Unpacker()
        self._goal_m: float | None = None
        self._speed_mps = SPEED_MPS
        self._width_m = 0.08
        self._blocked = False
        self._now_ns = self._next_ns = 0
        self._answered = 0
        self._registers = False

    @property
    def grip_n(self) -> float:
        """Grip force on one pad, N."""
        return self.force_n if self._blocked else 0.0

    def opened(self, t_ns: int) -> None:
        """Handle the connection to the daemon: register next."""
        self._registers = True
        self._unpacker = msgpack.Unpacker()
        self._answered = 0
        self._next_ns = max(self._next_ns, t_ns)  # no reports of the time without a connection

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the daemon; return the answers."""
        self._move(t_ns)
        self._unpacker.feed(data)
        output: list[bytes] = []
        try:
            for body in self._unpacker:
                output += self._obey(body)
        except (ValueError, KeyError, TypeError, msgpack.UnpackException):  # no daemon sends this: start over
            self._unpacker = msgpack.Unpacker()
        return output

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the reports due by then."""
        self._move(t_ns)
        output = []
        if self._registers:
            self._registers = False
            output.append(encode_registration(DRIVER))
        while self._next_ns <= t_ns:
            output.append(encode_report(self.report))
            self._next_ns += round(1e9 / RATE_HZ)
        return output

    def _obey(self, body: dict[str, Any]) -> list[bytes]:
        if "op" not in body:
            self.notices.append(body)
            self._registers = self._registers or "refused" in body
            return []
        if self.mute:
            return []
        if body["id"] != self._answered:  # a repeated set-point is answered again, but obeyed once
            self._answered = body["id"]
            self.obeyed.append(body)
            self._do(body)
        applied_n = self.force_n * (1.0 + self.excess) if "force_n" in body else None
        return [encode_report(replace(self.report, id=body["id"], applied_n=applied_n))]

    def _do(self, body: dict[str, Any]) -> None:
        self.force_n = body.get("force_n", self.force_n)
        if body["op"] == "move":
            self._goal_m = body["width_m"]
            self._speed_mps = body["speed_mps"] or SPEED_MPS
        elif body["op"] == "stop":
            self._goal_m = None
        active = self.report.active or body["op"] == "activate"
        self._update_report(0.0, active=active, acknowledged=body["op"] == "acknowledge")

    def _move(self, t_ns: int) -> None:
        reach_m = self._speed_mps * (t_ns - self._now_ns) * 1e-9
        self._now_ns = t_ns
        if self._goal_m is not None:
            self._update_report(reach_m, active=self.report.active, acknowledged=False)

    def _update_report(self, reach_m: float, *, active: bool, acknowledged: bool) -> None:
        """Move the jaws, and report; a part held at the stop stays held."""
        moving = False
        if self._goal_m is not None:
            self._width_m, moving, self._blocked = moved_jaws(self._width_m, self._goal_m, self.part_m, reach_m)
        self.report = Report(
            self._width_m,
            active,
            moving,
            "contact_closing" if self._blocked else "moving" if moving else "none",
            "" if acknowledged else self.report.fault,
            self.force_n * (1.0 + self.excess) if self._blocked else 0.0,
        )


def make(seed: int) -> Driver:
    """Return a driver; it has no noise, so ``seed`` is unused."""
    return Driver()
