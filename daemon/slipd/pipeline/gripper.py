"""The gripper behind its session: newtons and metres in, commands out, and what it says of itself."""

from __future__ import annotations

from typing import Any

from slipd.config import Gripper as GripperConfig
from slipd.devices import GripperSession
from slipd.grip.policy import GripLimits, GripPolicy, Refusal
from slipd.pipeline.report import number
from slipd.samples import GripperSample

Result = dict[str, Any] | Refusal
_NOT_ACTIVE = Refusal("not_active", "request gripper.activate first; it moves the fingers fully")


class GripperControl:
    """One gripper: requests that passed the policy become commands of its session.

    Args:
        config: ``[gripper]``.
        session: The conversation with it.
    """

    def __init__(self, config: GripperConfig, session: GripperSession) -> None:
        self._config = config
        self._session = session
        self.policy = GripPolicy(GripLimits(config.min_force_n or 0.0, config.max_force_n), config.max_lease_ms)
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
        refusal = self._check_goal(width_m, speed_mps) or self._check_closes(width_m)
        if refusal is not None:
            return refusal
        goal_m = self._session.width_range_m[0] if width_m is None else width_m
        return self._applied(self._session.move(goal_m, speed_mps, force_n))

    def open(self, width_m: float | None, speed_mps: float | None) -> Result:
        """Opens to a width with the least force."""
        refusal = self._check_goal(width_m, speed_mps)
        if refusal is not None:
            return refusal
        goal_m = self._session.width_range_m[1] if width_m is None else width_m
        return self._applied(self._session.move(goal_m, speed_mps, self._session.force_range_n[0]))

    def set_force(self, force_n: float) -> Result:
        """Sets the force while holding."""
        return self._applied(self._session.set_force(force_n))

    def halt(self) -> Result:
        """Stops the fingers where they are."""
        return {} if self._session.halt() else _NOT_ACTIVE

    def body(self, t_ns: int) -> dict[str, Any]:
        """The ``gripper`` message."""
        sample = self.sample
        return {
            "width_m": None if sample is None else number(sample.width_m),
            "force_command_n": number(self.force_command_n),
            "force_limit_n": self._config.max_force_n,
            "active": None if sample is None else sample.active,
            "object": None if sample is None else sample.object,
            "moving": None if sample is None else sample.moving,
            "fault": None if sample is None else sample.fault,
            "echo_ok": None if sample is None else sample.echo_ok,
            "current_a": None if sample is None else number(sample.current_a),
            "force_n": None if sample is None else number(sample.force_n),
            "age_s": None if sample is None else (t_ns - sample.t_ns) * 1e-9,
        }

    def _check_closes(self, width_m: float | None) -> Refusal | None:
        """Refuses a width beyond the present one."""
        now_m = None if self.sample is None else self.sample.width_m
        if width_m is None or (now_m is not None and width_m <= now_m):
            return None
        if now_m is None:
            return Refusal("not_ready", "the present width is not known: leave width_m out", "width_m")
        return Refusal("out_of_range", f"width_m must be at most the present {now_m:.4f} m: it closes", "width_m")

    def _check_goal(self, width_m: float | None, speed_mps: float | None) -> Refusal | None:
        """Refuses a width or speed that the gripper does not have."""
        least_m, most_m = self._session.width_range_m
        if width_m is not None and not least_m <= width_m <= most_m:
            return Refusal("out_of_range", f"width_m must be {least_m:g} to {most_m:g} m, not {width_m:g}", "width_m")
        if speed_mps is None:
            return None
        speeds = self._session.speed_range_mps
        if speeds is None:
            return Refusal("out_of_range", "this gripper is told no speed: leave it out", "speed_mps")
        if not speeds[0] <= speed_mps <= speeds[1]:
            allowed = f"{speeds[0]:g} to {speeds[1]:g} m/s"
            return Refusal("out_of_range", f"speed_mps must be {allowed}, not {speed_mps:g}", "speed_mps")
        return None

    def _applied(self, applied_n: float | None) -> Result:
        """What the gripper is told is told: its settings may be steps, and never exceed what was asked for."""
        if applied_n is None:
            return _NOT_ACTIVE
        self.force_command_n = applied_n
        return {"applied_n": applied_n}
