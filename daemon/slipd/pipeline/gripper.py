"""The gripper behind its session: newtons and metres in, commands out, and what it says of itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from slipd.config import Gripper as GripperConfig
from slipd.devices import GripperSession
from slipd.grip.policy import GripLimits, GripPolicy, Refusal
from slipd.permit import Permit
from slipd.pipeline.gripper_watch import COMMAND_LOST, LINK_LOST, NO_ANSWER, GripperWatch
from slipd.pipeline.report import number
from slipd.samples import GripperSample
from slipd_client.messages import Health

Result = dict[str, Any] | Refusal

#: A gripper that was not heard for so long, or for three of its periods, does not answer. A session that repeats an
#: unanswered command twice gives it up first.
SILENCE_NS, SILENT_PERIODS = 400_000_000, 3.0
#: Of the time from one look at the clock to the next so much counts: beyond it the daemon itself stood still, what the
#: gripper said meanwhile waits to be read, and what it was to be told was meant for another situation.
LONGEST_LOOK_NS = 50_000_000
_NOT_ACTIVE = Refusal("not_active", "request gripper.activate first; it moves the fingers fully")
_NO_ANSWER = Refusal("no_gripper", "the gripper does not answer; see status.streams.gripper")


class GripperControl:
    """One gripper: requests that passed the policy become commands of its session.

    Args:
        config: ``[gripper]``.
        session: The conversation with it.

    Attributes:
        policy: The lease, the limits, the force in force and the latched fault.
        sample: The newest reading; None while nothing is known.
        force_command_n: The force that the gripper was told last; None where it was told none, or is not active.
    """

    def __init__(self, config: GripperConfig, session: GripperSession) -> None:
        self._config = config
        self._session = session
        self._watch = GripperWatch()
        self._silence_ns = max(SILENCE_NS, round(SILENT_PERIODS * 1e9 / config.rate_hz))
        self.policy = GripPolicy(_limits(config), config.max_lease_ms)
        self.sample: GripperSample | None = None
        self.force_command_n: float | None = None
        self._held = False  # in this grasp, the gripper has said that something stopped it
        self._goal_m = self._closing_m = math.inf  # of the last motion, of the last that closed
        self._moves = False  # the fingers, as far as is known
        self._moved_ns = 0  # when they were sent somewhere
        self._looked_ns = self._silent_ns = 0
        self._before_n: float | None = None  # the force in force before the session was told any
        self._told_fault = ""

    def take(self, sample: GripperSample, *, pressed: bool = False) -> None:
        """Takes a status reading; while a finger feels that it is ``pressed``, no word of the gripper ends a grasp."""
        self.sample, self._silent_ns = sample, 0
        self._latch(self._watch.take(sample))
        self._moves = sample.moving or (self._moves and sample.t_ns <= self._moved_ns)
        if not sample.active:
            self._let_go()
            self.force_command_n = None
        elif sample.t_ns > self._moved_ns:
            if sample.object.startswith("contact"):
                self._held = True
            elif self._held and sample.object == "none" and not pressed:
                self._let_go()

    def look(self, t_ns: int) -> None:
        """Looks at the clock before anything is written: after a stall nothing is sent that was asked for before it."""
        passed_ns, self._looked_ns = t_ns - self._looked_ns, t_ns
        self._silent_ns += min(passed_ns, LONGEST_LOOK_NS)
        if passed_ns > LONGEST_LOOK_NS:
            self._drop()

    def wake(self) -> None:
        """The host slept: nothing is sent that was asked for before, leases are over, and what was heard is old."""
        self._drop()
        self.policy.end_lease()
        self.sample = None

    def on_time(self, t_ns: int) -> bool:
        """Lets time pass; True where there is news: the latched fault is another, or a lease ended by itself."""
        self.look(t_ns)
        self._latch(self._watch.take_command(lost=self._session.command_lost))
        if self.sample is not None and self._silent_ns > self._silence_ns:
            self._forget(NO_ANSWER)
        lapsed = self.policy.lapsed(t_ns)
        if lapsed and self._config.lease_end == "stop" and self._moves:
            self._undo(self._stop)
        told, self._told_fault = self._told_fault, self.policy.fault
        return lapsed or self._told_fault != told

    def lose(self) -> None:
        """The link went down: nothing is known of the gripper, and nobody holds the lease."""
        self._forget(LINK_LOST)
        self.policy.end_lease()

    def may_activate(self) -> Refusal | None:
        """Why the gripper may not be activated: without a force limit, or while a fault is latched, nothing moves."""
        if self._config.max_force_n is None:
            return Refusal("no_limit", "gripper.max_force_n is not configured, so nothing may be moved")
        return self.policy.check_fault() or (_NO_ANSWER if self.sample is None else None)

    def refuse(self) -> Refusal | None:
        """Why the gripper cannot move now; None where it can."""
        refusal = self.may_activate()
        if refusal is not None or self.sample is None:
            return refusal
        if self.sample.fault:
            return Refusal("gripper_fault", f"the gripper reports {self.sample.fault}")
        return None if self.sample.active else _NOT_ACTIVE

    def check_force(self, force_n: float) -> Refusal | None:
        """Refuses a force outside the configured limits, or outside what the gripper says it can do."""
        refusal = self.policy.check_force(force_n)
        least_n, most_n = self._session.force_range_n
        if refusal is None and not least_n <= force_n <= most_n:
            allowed = f"{least_n:g} to {most_n:g} N"
            return Refusal("out_of_range", f"force_n: the gripper has {allowed} on one pad, not {force_n:g}", "force_n")
        if refusal is None and (applied_n := self.applied_n(force_n)) < (self._config.min_force_n or 0.0):
            steps = f"the gripper's settings are steps, and that of {force_n:g} N gives {applied_n:g} N: ask for more"
            return Refusal("out_of_range", f"force_n: {steps}", "force_n")
        return refusal

    def applied_n(self, force_n: float) -> float:
        """The force that the gripper would be told for ``force_n``."""
        return self._session.applied_n(force_n)

    def activate(self, t_ns: int) -> Result:
        """Activates the gripper, which opens and closes it fully."""
        if not self._session.execute(Permit("activate"), t_ns):
            return _NO_ANSWER
        self._watch.activate(t_ns)
        self._let_go()
        self.force_command_n = None
        return {}

    def close(self, force_n: float, width_m: float | None, speed_mps: float | None, t_ns: int) -> Result:
        """Closes to a width with a force; never opens."""
        refusal = self._check_goal(width_m, speed_mps) or self._check_closes(width_m)
        if refusal is not None:
            return refusal
        goal_m = self._session.width_range_m[0] if width_m is None else width_m
        self._keep_force()
        applied_n = self._execute(Permit("move", goal_m, speed_mps, force_n), t_ns)
        if applied_n is not None:
            self._held = self._held and self.policy.force_n is not None
            self.policy.grip(applied_n, t_ns)
            self._closing_m = goal_m
            self._send_off(goal_m, t_ns)
        return self._sent(applied_n)

    def open(self, width_m: float | None, speed_mps: float | None, t_ns: int) -> Result:
        """Opens to a width with the least force that may be asked for; ends the grasp."""
        refusal = self._check_goal(width_m, speed_mps)
        goal_m = self._session.width_range_m[1] if width_m is None else width_m
        if refusal is None and math.isinf(goal_m):
            refusal = Refusal("not_ready", "the gripper has not told its widths yet: give width_m", "width_m")
        least_n = max(self._session.force_range_n[0], self._config.min_force_n or 0.0)
        if refusal is None and self.policy.check_force(least_n) is not None:
            above = f"the least force of the gripper, {least_n:g} N, is above max_force_n"
            refusal = Refusal("out_of_range", f"{above}: it may not be told any")
        if refusal is not None:
            return refusal
        self._keep_force()
        applied_n = self._execute(Permit("move", goal_m, speed_mps, least_n), t_ns)
        if applied_n is not None:
            self._let_go()
            self._send_off(goal_m, t_ns)
        return self._sent(applied_n)

    def set_force(self, force_n: float, t_ns: int, *, reflex: bool = False) -> Result:
        """Sets the force while holding, for a client or for the reflex."""
        self._keep_force()
        applied_n = self._execute(Permit("set_force", force_n=force_n), t_ns)
        if applied_n is not None:
            self.policy.grip(applied_n, t_ns, reflex=reflex)
        return self._sent(applied_n)

    @property
    def width_m(self) -> float | None:
        """Width between the pads, m; None where it is not known."""
        return None if self.sample is None else self.sample.width_m

    def react(self, force_n: float, t_ns: int) -> bool:
        """Sets the force for the reflex; False where the gripper cannot take it now."""
        if self.refuse() is not None or self.check_force(force_n) is not None:
            return False
        return not isinstance(self.set_force(force_n, t_ns, reflex=True), Refusal)

    def halt(self) -> Result:
        """Stops the fingers where they are, whatever else is wrong."""
        return {} if self._undo(self._stop) else (self.may_activate() or _NOT_ACTIVE)

    def hold(self) -> Result:
        """Keeps what is: moving fingers stop, a force in force stays."""
        if self._moves or self.sample is None or not self.sample.active:
            stopped = self.halt()
            if isinstance(stopped, Refusal):
                return stopped
        return {"force_n": number(self.policy.force_n)}

    def acknowledge(self) -> Result:
        """Clears the latched fault; returns which it was. What is held by a gripper that is not heard stays a fault."""
        if self.sample is None and self.policy.force_n is not None:
            return Refusal("not_ready", "nothing is heard of the gripper, which had a grip in force: wait until it is")
        fault = self.policy.fault
        self.policy.acknowledge()
        self._watch.acknowledge()
        self._session.acknowledge()
        return {"fault": fault or None}

    def lease(self, t_ns: int) -> dict[str, Any]:
        """``lease`` of the messages."""
        expires_in_s = self.policy.expires_in_s(t_ns)
        return {"held": expires_in_s is not None, "expires_in_s": expires_in_s}

    def conditions(self) -> list[tuple[Health, str]]:
        """What ails the gripper, for the status of its stream."""
        fault = self.policy.fault
        return [(Health.ERROR, f"{fault} is latched: say fault.ack once it was looked at")] if fault else []

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
            "latched_fault": self.policy.fault,
            "echo_ok": None if sample is None else sample.echo_ok,
            "current_a": None if sample is None else number(sample.current_a),
            "force_n": None if sample is None else number(sample.force_n),
            "lease": self.lease(t_ns),
            "reflex": None,
            "age_s": None if sample is None else (t_ns - sample.t_ns) * 1e-9,
        }

    def _execute(self, permit: Permit, t_ns: int) -> float | None:
        """Hands the session a permit; returns the force that will be in force, None where it is not taken."""
        return self._session.force_told_n if self._session.execute(permit, t_ns) else None

    def _stop(self) -> bool:
        return self._session.execute(Permit("halt"), self._looked_ns)

    def _latch(self, fault: str) -> None:
        if fault:
            self.policy.latch(fault)

    def _forget(self, fault: str) -> None:
        """Nothing is heard of the gripper any more; a fault only where it has something to hold."""
        if self.policy.force_n is not None:
            self.policy.latch(fault)
        self._watch.forget()
        self.sample = None

    def _keep_force(self) -> None:
        """A session that began anew knows of no force: that of a grip from before is kept here."""
        if self._session.force_told_n is None:
            self._before_n = self.policy.force_n

    def _drop(self) -> None:
        """Forgets what was not sent yet; that it never will be is a fault."""
        if self._undo(self._session.drop):
            self.policy.latch(COMMAND_LOST)

    def _undo(self, forget: Callable[[], bool]) -> bool:
        """Lets the session forget what was not sent yet, and puts back the force that it would have changed."""
        to_be_n = self._session.force_told_n
        done = forget()
        told_n = self._session.force_told_n
        if told_n != to_be_n:
            self.force_command_n = self._before_n if told_n is None else told_n
            self.policy.put_back(self.force_command_n)
        return done

    def _let_go(self) -> None:
        """The grasp ended: its force and its budget with it."""
        self.policy.let_go()
        self._held = False

    def _check_closes(self, width_m: float | None) -> Refusal | None:
        """Refuses a width beyond the present one, that of moving fingers' goal, and that of the grip in force.

        Each would open, or take away what presses on the object.
        """
        if width_m is None:
            return None
        most_m = None if self.sample is None else self.sample.width_m
        if most_m is None:
            return Refusal("not_ready", "the present width is not known: leave width_m out", "width_m")
        if self._moves:
            most_m = min(most_m, self._goal_m)
        if self.policy.force_n is not None:
            most_m = min(most_m, self._closing_m)
        if width_m <= most_m:
            return None
        return Refusal("out_of_range", f"width_m must be at most {most_m:.4f} m here: it closes", "width_m")

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

    def _send_off(self, goal_m: float, t_ns: int) -> None:
        """The fingers are sent somewhere: until a later reading says otherwise, they move."""
        self._goal_m, self._moves, self._moved_ns = goal_m, True, t_ns

    def _sent(self, applied_n: float | None) -> Result:
        """What the gripper is told is told: its settings may be steps, and never exceed what was asked for."""
        if applied_n is None:
            return _NOT_ACTIVE
        self.force_command_n = applied_n
        return {"applied_n": applied_n}


def _limits(config: GripperConfig) -> GripLimits:
    budget_n = config.max_force_n if config.budget_n is None else config.budget_n
    return GripLimits(
        min_n=config.min_force_n or 0.0,
        max_n=config.max_force_n,
        step_n=config.step_n,
        raise_n_per_s=config.raise_n_per_s,
        lower_n_per_s=config.lower_n_per_s,
        budget_n=budget_n or 0.0,
    )
