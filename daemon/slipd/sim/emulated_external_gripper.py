"""A driver of somebody else's gripper: it registers, reports at 50 Hz, and does what it is told, or not.

Between its jaws lies a part; what is held does not give.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgpack

from slipd.devices.external_gripper.external_gripper_message import (
    Registration,
    Report,
    encode_registration,
    encode_report,
)

DRIVER = Registration("emulated driver", (0.0, 0.1), (2.0, 60.0), (0.01, 0.2))
RATE_HZ = 50.0
SPEED_MPS = 0.1


class Driver:
    """The driver's end of its line; time is told to it.

    Attributes:
        part_m: Width of what lies between the jaws; 0 for nothing.
        report: What it reports.
        force_n: What it was told to press with, N on one pad.
        told: The set-points that it obeyed.
        notices: What the daemon said of it.
        excess: Share by which it presses harder than it was told.
        mute: It answers no set-point.
    """

    def __init__(self) -> None:
        self.options: dict[str, Any] = {}
        self.rate_hz = RATE_HZ
        self.part_m = 0.04
        self.report = Report(0.08)
        self.force_n = DRIVER.force_range_n[0]
        self.told: list[dict[str, Any]] = []
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
        self._greets = False

    def opened(self, t_ns: int) -> None:
        """Connected to the daemon: to register is next."""
        self._greets = True
        self._unpacker = msgpack.Unpacker()
        self._answered = 0

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Take what the daemon wrote; return the answers."""
        self._go_on(t_ns)
        self._unpacker.feed(data)
        said: list[bytes] = []
        try:
            for body in self._unpacker:
                said += self._obey(body)
        except (ValueError, KeyError, TypeError, msgpack.UnpackException):  # no daemon would say this: begin anew
            self._unpacker = msgpack.Unpacker()
        return said

    def advance(self, t_ns: int) -> list[bytes]:
        """Go on to ``t_ns`` and return the reports due until then."""
        self._go_on(t_ns)
        said = []
        if self._greets:
            self._greets = False
            said.append(encode_registration(DRIVER))
        while self._next_ns <= t_ns:
            said.append(encode_report(self.report))
            self._next_ns += round(1e9 / RATE_HZ)
        return said

    def _obey(self, body: dict[str, Any]) -> list[bytes]:
        if "op" not in body:
            self.notices.append(body)
            self._greets = self._greets or "refused" in body
            return []
        if self.mute:
            return []
        if body["id"] != self._answered:  # one that comes again is answered again, and done once
            self._answered = body["id"]
            self.told.append(body)
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
        self._tell(active=self.report.active or body["op"] == "activate", cured=body["op"] == "acknowledge")

    def _go_on(self, t_ns: int) -> None:
        reach_m = self._speed_mps * (t_ns - self._now_ns) * 1e-9
        self._now_ns = t_ns
        if self._goal_m is not None:
            least_m = self.part_m if self._width_m >= self.part_m else 0.0
            self._width_m += min(max(max(self._goal_m, least_m) - self._width_m, -reach_m), reach_m)
            self._tell(active=self.report.active, cured=False)

    def _tell(self, *, active: bool, cured: bool) -> None:
        goal_m, width_m = self._goal_m, self._width_m
        if goal_m is not None:
            self._blocked = goal_m < width_m == self.part_m
        blocked = self._blocked  # what is held when it stops stays held
        moving = goal_m is not None and not blocked and goal_m != width_m
        self.report = Report(
            width_m,
            active,
            moving,
            "contact_closing" if blocked else "moving" if moving else "none",
            "" if cured else self.report.fault,
            self.force_n * (1.0 + self.excess) if blocked else 0.0,
        )


def make(seed: int) -> Driver:
    """Make a driver; it has no noise that ``seed`` could tell apart."""
    del seed
    return Driver()
