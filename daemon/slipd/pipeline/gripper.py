"""The gripper behind its session: newtons and metres in, commands out, and what it says of itself."""

from __future__ import annotations

from typing import Any

from slipd.config import Gripper as GripperConfig
from slipd.devices.robotiq_2f import Session
from slipd.grip.force_map import ForceMap, interpolate
from slipd.grip.policy import GripLimits, GripPolicy, Refusal
from slipd.pipeline.report import number
from slipd.samples import GripperSample

FULL = 255
Result = dict[str, Any] | Refusal
_NOT_ACTIVE = Refusal("not_active", "request gripper.activate first; it moves the fingers fully")

#: Speed where none is asked for: the middle of the gripper's range.
DEFAULT_SPEED = 128


class GripperControl:
    """One gripper: requests that passed the policy become commands of its session.

    Args:
        config: ``[gripper]``.
        session: The conversation with it.
    """

    def __init__(self, config: GripperConfig, session: Session) -> None:
        self._config = config
        self._session = session
        self._forces = ForceMap(config.force_table)
        self._closures = [(width, closure) for closure, width in reversed(config.width_table)]
        least = config.force_table[0][1] if config.min_force_n is None else config.min_force_n
        self.policy = GripPolicy(GripLimits(least, config.max_force_n), config.max_lease_ms)
        self.sample: GripperSample | None = None
        self.force_command_n: float | None = None

    def take(self, sample: GripperSample) -> None:
        """Takes a status reading."""
        self.sample = sample
        if not sample.active:
            self.force_command_n = None

    def lose(self) -> None:
        """The link went down: nothing is known of the gripper, and nobody holds the lease."""
        self.sample = None
        self.policy.end_lease()

    def may_activate(self) -> Refusal | None:
        """Why the gripper may not be activated: without a force limit nothing may be moved."""
        if self._config.max_force_n is None:
            return Refusal("no_limit", "gripper.max_force_n is not configured, so nothing may be moved")
        if self.sample is None or self._session.state == "no reply":
            return Refusal("no_gripper", "the gripper does not answer; see status.streams.gripper")
        return None

    def refuse(self) -> Refusal | None:
        """Why the gripper cannot move now; None where it can."""
        refusal = self.may_activate()
        if refusal is not None or self.sample is None:
            return refusal
        if self.sample.fault:
            return Refusal("gripper_fault", f"the gripper reports {self.sample.fault}")
        if not self.sample.active:
            return _NOT_ACTIVE
        return None

    def activate(self, t_ns: int) -> dict[str, Any]:
        """Activates the gripper, which opens and closes it fully."""
        self._session.activate(t_ns)
        return {}

    def close(self, force_n: float, width_m: float | None, speed_mps: float | None) -> Result:
        """Closes to a width with a force; never opens."""
        position = FULL if width_m is None else self._position(width_m)
        if self.sample is not None and position < round(FULL * self.sample.closure):
            now_m = interpolate(self._config.width_table, self.sample.closure)
            return Refusal("out_of_range", f"width_m must be at most the present {now_m:.4f} m: it closes", "width_m")
        return self._check_goal(width_m, speed_mps) or self._move(position, force_n, speed_mps)

    def open(self, width_m: float | None, speed_mps: float | None) -> Result:
        """Opens to a width with the least force."""
        position = 0 if width_m is None else self._position(width_m)
        return self._check_goal(width_m, speed_mps) or self._move(position, self._forces.newtons(0), speed_mps)

    def set_force(self, force_n: float) -> Result:
        """Sets the force while holding."""
        units = self._forces.units(force_n)
        return self._applied(units) if self._session.set_force(units) else _NOT_ACTIVE

    def halt(self) -> Result:
        """Stops the fingers where they are."""
        return {} if self._session.halt() else _NOT_ACTIVE

    def body(self, t_ns: int) -> dict[str, Any]:
        """The ``gripper`` message."""
        sample = self.sample
        config = self._config
        return {
            "width_m": None if sample is None else interpolate(config.width_table, sample.closure),
            "force_command_n": number(self.force_command_n),
            "force_limit_n": config.max_force_n,
            "active": None if sample is None else sample.active,
            "object": None if sample is None else sample.object,
            "moving": None if sample is None else sample.moving,
            "fault": None if sample is None else sample.fault,
            "echo_ok": None if sample is None else sample.echo_ok,
            "current_a": None if sample is None else sample.current_a,
            "age_s": None if sample is None else (t_ns - sample.t_ns) * 1e-9,
        }

    def _check_goal(self, width_m: float | None, speed_mps: float | None) -> Refusal | None:
        """Refuses a width or speed that the gripper does not have."""
        widths = [width for _, width in self._config.width_table]
        if width_m is not None and not widths[-1] <= width_m <= widths[0]:
            allowed = f"{widths[-1]:g} to {widths[0]:g} m"
            return Refusal("out_of_range", f"width_m must be {allowed}, not {width_m:g}", "width_m")
        if speed_mps is None:
            return None
        if self._config.speed_table is None:
            return Refusal("out_of_range", "gripper.speed_table is not configured: leave the speed out", "speed_mps")
        speeds = [speed for _, speed in self._config.speed_table]
        if not speeds[0] <= speed_mps <= speeds[-1]:
            allowed = f"{speeds[0]:g} to {speeds[-1]:g} m/s"
            return Refusal("out_of_range", f"speed_mps must be {allowed}, not {speed_mps:g}", "speed_mps")
        return None

    def _move(self, position: int, force_n: float, speed_mps: float | None) -> Result:
        units = self._forces.units(force_n)
        return self._applied(units) if self._session.move(position, self._speed(speed_mps), units) else _NOT_ACTIVE

    def _applied(self, units: int) -> dict[str, Any]:
        """The device setting is whole, so what is applied is told; it never exceeds what was asked for."""
        self.force_command_n = self._forces.newtons(units)
        return {"applied_n": self.force_command_n}

    def _position(self, width_m: float) -> int:
        return round(FULL * interpolate(self._closures, width_m))

    def _speed(self, speed_mps: float | None) -> int:
        if speed_mps is None or self._config.speed_table is None:
            return DEFAULT_SPEED
        return round(interpolate([(speed, units) for units, speed in self._config.speed_table], speed_mps))
