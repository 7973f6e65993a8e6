"""A lab's own programs on the sockets of the daemon: one that pushes readings, and the driver of a gripper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import msgpack
import numpy as np

from slipd.devices.external import encode_reading
from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Registration, Report
from slipd.tools.sim.emulators import EmulatedDevice, ReadingStream, WrenchStream, moved_jaws
from slipd.types.arrays import Array

WRENCH, PAD = "left.wrench", "left.pad"
"""Names of the streams."""

READINGS_HZ = 500.0
PAD_EVERY = 5
"""Wrench readings per image."""

TAXELS = 16
NOISE = 0.01
"""Standard deviation of each taxel."""

ARM_NOISE = 0.02, 0.002
"""Standard deviation of each component of an arm's gravity, m/s², and angular velocity, rad/s."""

_WRENCH_FIELDS, _ARM_FIELDS = ("force_n", "torque_nm"), ("gravity_mps2", "angular_velocity_radps")


class Pusher(EmulatedDevice):
    """A program that pushes the readings of force/torque sensors, pads and an arm, each a stream of its own.

    Args:
        seed: Seed of the noise.
        wrenches: Names of the streams of force/torque sensors, each with the noise of its forces, N, and torques, N·m.
        pads: Names of the streams of pads, each with the shape of its image, (taxels,) or (taxels, 3).
        arms: Names of the streams of the arm's motion.
        rates_hz: Rate of a stream by its name, Hz; by default 500 for a sensor or arm, and 100 for a pad.

    Attributes:
        began_ns: CLOCK_MONOTONIC of the start; the times of its readings count from it.
    """

    def __init__(
        self,
        seed: int,
        wrenches: Mapping[str, tuple[float, float]] = {WRENCH: (0.02, 0.0005)},
        pads: Mapping[str, tuple[int, ...]] = {PAD: (TAXELS,)},
        arms: Sequence[str] = (),
        rates_hz: Mapping[str, float] = {},
    ) -> None:
        super().__init__(READINGS_HZ)
        self.began_ns = 0
        self._streams: dict[str, ReadingStream] = {}
        self._fields = dict.fromkeys(wrenches, _WRENCH_FIELDS) | dict.fromkeys(arms, _ARM_FIELDS)
        for k, (name, noise) in enumerate(wrenches.items()):
            self._streams[name] = WrenchStream(seed + k, rates_hz.get(name, READINGS_HZ), *noise)
        for k, (name, shape) in enumerate(pads.items()):
            self._streams[name] = ReadingStream(seed + k, rates_hz.get(name, READINGS_HZ / PAD_EVERY), shape, NOISE)
        for k, name in enumerate(arms):
            self._streams[name] = WrenchStream(seed + k, rates_hz.get(name, READINGS_HZ), *ARM_NOISE)
        for stream in self._streams.values():
            stream.start(0)
        self._sent = dict.fromkeys(self._streams, 0)

    def feel(self, force_n: Array, torque_nm: Array, sensor: str = WRENCH) -> None:
        """Set the load on a sensor from now on, in the frame of the sensor, N and N·m."""
        self._streams[sensor].press(np.concatenate((force_n, torque_nm)))

    def press(self, values: Array, sensor: str = PAD) -> None:
        """Set the load on each taxel of a pad from now on, of the shape of its image."""
        self._streams[sensor].press(values)

    def carry(self, gravity_mps2: Array, velocity_radps: Array, sensor: str) -> None:
        """Set the motion of an arm from now on: apparent gravity, m/s², and angular velocity, rad/s."""
        self.feel(gravity_mps2, velocity_radps, sensor)

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the messages due by then, in the order of their times."""
        readings = [(t, name, stream.reading()) for name, stream in self._streams.items() for t in stream.times(t_ns)]
        return [self._message(*reading) for reading in sorted(readings, key=lambda reading: reading[0])]

    def _message(self, taken_ns: int, stream: str, values: Array) -> bytes:
        fields: dict[str, Any] = {"values": values}
        if stream in self._fields:
            fields = dict(zip(self._fields[stream], (values[:3], values[3:]), strict=True))
        self._sent[stream] += 1
        return encode_reading(stream, self.began_ns + taken_ns, seq=self._sent[stream] - 1, **fields)


DRIVER = Registration("emulated driver", (0.0, 0.1), (2.0, 60.0), (0.01, 0.2))
REPORTS_HZ = 50.0
SPEED_MPS = 0.1
PART_M, STARTS_AT_M = 0.04, 0.08


_LEFT_OUT = {"speed_range_mps": None, "id": None, "error": ""}
"""Keys that a message has only with another value."""


def encode_driver_message(message: Registration | Report) -> bytes:
    """Return the registration of a driver, or its report, which may be the answer to a set-point.

    Raises:
        ValueError: The daemon would reject it.
    """
    body: dict[str, Any] = {"v": wire.VERSION} | asdict(message)
    if body.get("id") is None:
        body.pop("applied_n", None)
    body = {key: value for key, value in body.items() if key not in _LEFT_OUT or value != _LEFT_OUT[key]}
    data: bytes = msgpack.packb(body)
    if wire.read(data, 0)[0] != len(data):
        raise ValueError(f"a driver's message must have finite numbers within their bounds, got {body}")
    return data


class Driver(EmulatedDevice):
    """The driver of a gripper: it registers, reports at 50 Hz, and obeys set-points, or not.

    Attributes:
        part_m: Width of the rigid part between the jaws, m; 0: no part.
        report: Its present report.
        force_n: Commanded force, N on one pad.
        obeyed: The set-points that it obeyed.
        notices: Notices from the daemon.
        excess: Relative excess of its force over the command.
        mute: Whether it ignores set-points.
    """

    def __init__(self) -> None:
        super().__init__(REPORTS_HZ)
        self.part_m = PART_M
        self.report = Report(STARTS_AT_M)
        self.force_n = DRIVER.force_range_n[0]
        self.obeyed: list[dict[str, Any]] = []
        self.notices: list[dict[str, Any]] = []
        self.excess = 0.0
        self.mute = False
        self._unpacker = msgpack.Unpacker()
        self._goal_m: float | None = None
        self._speed_mps = SPEED_MPS
        self._width_m = STARTS_AT_M
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
                output += self._handle(body)
        except (ValueError, KeyError, TypeError, msgpack.UnpackException):  # no daemon sends this: start over
            self._unpacker = msgpack.Unpacker()
        return output

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the reports due by then."""
        self._move(t_ns)
        output = [encode_driver_message(DRIVER)] if self._registers else []
        self._registers = False
        while self._next_ns <= t_ns:
            output.append(encode_driver_message(self.report))
            self._next_ns += round(1e9 / REPORTS_HZ)
        return output

    def _handle(self, body: dict[str, Any]) -> list[bytes]:
        if "op" not in body:
            self.notices.append(body)
            self._registers = self._registers or "refused" in body
            return []
        if self.mute:
            return []
        if body["id"] != self._answered:  # a repeated set-point is answered again, but obeyed once
            self._answered = body["id"]
            self.obeyed.append(body)
            self._carry_out(body)
        applied_n = self.force_n * (1.0 + self.excess) if "force_n" in body else None
        return [encode_driver_message(replace(self.report, id=body["id"], applied_n=applied_n))]

    def _carry_out(self, body: dict[str, Any]) -> None:
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
