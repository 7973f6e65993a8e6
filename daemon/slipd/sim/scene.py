"""A box between two pads, with the true times at which it slips. Pure: time is an argument.

The fingers close until they touch the box; the grip force follows the command with a lag; the loads of the script act.
Each pad carries half of every load, so one limit surface decides for both. While λ(μ_s) ≤ 1 the box sticks. Beyond that
it slides about the velocity pole of its load: friction carries the load scaled to the surface at μ_d, whose normal is
that motion, the excess accelerates the box along it, and the box sticks again when its speed is back to zero. So the
speed is the only state of its dynamics.

Not modelled, because the script does not need it: momentum along other motions, creep before slip, compliance of the
pads, growth of the patch with the force, tipping, the change of a lever with the angle of the box, inertia of the
poured weight, a gripper that stalls. A box that has moved or turned too far is dropped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from slipd.sim.scene_script import Script
from slipd.sim.true_contact import FrictionLimit, Load, Need, Patch

LARGEST_STEP_S = 0.002
"""Longest integration step, s: spring and damper of the hand are integrated explicitly. Longer steps are divided."""

LET_GO_N = 0.05
"""Force at which the fingers of an opening gripper leave the box, N."""

FAR, FAR_S = 0.9, 0.005
"""While λ is below ``FAR``, the limit is solved only every ``FAR_S``: no load of the script reaches 1 faster."""

FORECAST_S = 1e-4
"""Resolution of the time at which the box would begin to turn, s; a tenth of the period of the readings."""

AT_REST = Need(0.0, (0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class GripCommand:
    """Command to the drive of the gripper.

    Attributes:
        width_m: Target width, m.
        speed_mps: Speed, m/s.
        force_n: Normal force on one pad once something is held, N.
    """

    width_m: float
    speed_mps: float
    force_n: float


@dataclass(frozen=True, slots=True)
class Truth:
    """One event of the scene at ``t_s``, with its values."""

    t_s: float
    event: str
    values: dict[str, float | None]


@dataclass
class Scene:
    """The box, its contact, the script, and their present state.

    Attributes:
        script: The loads over time.
        patch: The contact on the left pad; that on the right one is its mirror image.
        object_width_m: Distance between the pads when they touch the box.
        open_width_m: Distance between the pads at the start.
        mass_kg: Mass of the box.
        inertia_kgm2: Moment of inertia of the box about the normal of the pads through the contact.
        mu_s: True static friction coefficient.
        mu_d: True dynamic friction coefficient.
        grip_lag_s: Time constant with which the grip force follows the command.
        lost_at_m: A box that has slid this far falls.
        lost_at_rad: A box that has turned this far falls.
        cell_m: Cell of the grid of the true contact; with 2 mm its limit is within 0.5 % of the continuous contact.
        truth: All events so far.
        t_s: Time of the last step.
        width_m: Distance between the pads.
        moving: The fingers move.
        in_contact: Both pads touch the box.
        normal_n: Grip force on one pad.
        friction: Load that both pads together carry, in the frame of the left pad.
        utilisation: True λ at μ_s of the load on one pad; inf for a load without a normal force.
        sliding: Whether the box slides over the pads.
        displacement_m: How far the box has slid, in the frame of the left pad.
        angle_rad: How far the box has turned, in the frame of the left pad.
        rotation_would_begin_s: When the poured load would turn the box at the grip force at the start of the pouring;
            None if it would not, and before the pouring.
    """

    script: Script = field(default_factory=Script)
    patch: Patch = field(default_factory=Patch)
    object_width_m: float = 0.060
    open_width_m: float = 0.085
    mass_kg: float = 0.25
    inertia_kgm2: float = 1e-3
    mu_s: float = 0.6
    mu_d: float = 0.45
    grip_lag_s: float = 0.06
    lost_at_m: float = 0.040
    lost_at_rad: float = 1.0
    cell_m: float = 0.002

    truth: list[Truth] = field(default_factory=list, init=False)
    t_s: float = field(default=0.0, init=False)
    width_m: float = field(init=False)
    moving: bool = field(default=False, init=False)
    in_contact: bool = field(default=False, init=False)
    normal_n: float = field(default=0.0, init=False)
    friction: Load = field(default=(0.0, 0.0, 0.0), init=False)
    utilisation: float = field(default=0.0, init=False)
    sliding: bool = field(default=False, init=False)
    displacement_m: tuple[float, float] = field(default=(0.0, 0.0), init=False)
    angle_rad: float = field(default=0.0, init=False)
    rotation_would_begin_s: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.mu_d <= self.mu_s:
            raise ValueError(f"must be 0 < mu_d <= mu_s, got mu_d {self.mu_d} and mu_s {self.mu_s}")
        self.width_m = self.open_width_m
        self._limit = FrictionLimit(self.patch, self.cell_m)
        self._solve(self.script.weight(self.script.pour_s, self.mass_kg))  # compiles the solver before the scene runs
        self._need_load: Load = (0.0, 0.0, 0.0)
        self._need, self._need_s = AT_REST, 0.0
        self._present = True
        self._speed = 0.0  # square root of twice the kinetic energy
        self._velocity: Load = (0.0, 0.0, 0.0)
        self._slide_began_s = 0.0
        self._tug_origin_m: float | None = None
        self._hand_gone = False
        self._phase = "approach"

    def step(self, t_s: float, command: GripCommand) -> None:
        """Advance to ``t_s`` while the gripper follows ``command``.

        Raises:
            ValueError: ``t_s`` is before the last step.
        """
        if t_s < self.t_s:
            raise ValueError(f"t_s must not decrease, got {t_s} after {self.t_s}")
        begin_s, n = self.t_s, math.ceil((t_s - self.t_s) / LARGEST_STEP_S - 1e-9)
        for i in range(1, n + 1):
            now_s = t_s if i == n else begin_s + (t_s - begin_s) * i / n
            dt_s, self.t_s = now_s - self.t_s, now_s
            self._follow_script()
            self._move_fingers(command, dt_s)
            self._carry(self._load(), dt_s)

    def _follow_script(self) -> None:
        """Record a change of the phase, and what follows from it."""
        phase = self.script.phase(self.t_s)
        if phase == self._phase:
            return
        self._phase = phase
        if phase == "lift" and not self.in_contact:
            self._present = False
            self._record("left_behind")
            return
        self._record(phase)
        if phase == "pour" and self.in_contact:
            self.rotation_would_begin_s = self._rotation_begin_s(self.normal_n)
            self._record("forecast", rotation_would_begin_s=self.rotation_would_begin_s)

    def _move_fingers(self, command: GripCommand, dt_s: float) -> None:
        squeeze = self._present and command.width_m < self.object_width_m
        if self.in_contact:
            target_n = command.force_n if squeeze else 0.0
            self.normal_n += (target_n - self.normal_n) * -math.expm1(-dt_s / self.grip_lag_s)
            self.moving = False
            if squeeze or (self._present and self.normal_n > LET_GO_N):
                return
            self.in_contact, self.normal_n = False, 0.0
            self._record("contact_ends")
        stop_m = self.object_width_m if squeeze and self.width_m >= self.object_width_m else command.width_m
        away_m, reach_m = stop_m - self.width_m, command.speed_mps * dt_s
        self.moving = abs(away_m) > reach_m
        self.width_m = self.width_m + math.copysign(reach_m, away_m) if self.moving else stop_m
        if squeeze and self.width_m == self.object_width_m:
            self.in_contact, self.moving = True, False
            self._record("contact")

    def _load(self) -> Load:
        """Return the load on both pads together."""
        carried = self.script.carried(self.t_s)
        if not self._present or carried == 0.0:
            return 0.0, 0.0, 0.0
        fx, fy, spin = self.script.weight(self.t_s, self.mass_kg)
        if self._phase != "tug" or self._hand_gone:
            return fx, fy, spin
        if self._tug_origin_m is None:
            self._tug_origin_m = self.displacement_m[1]
        if self.sliding and self.t_s - self._slide_began_s >= self.script.tug_slip_s:
            self._hand_gone = True
            self._record("tug_ends")
            return fx, fy, spin
        moved_m = self.displacement_m[1] - self._tug_origin_m
        return fx, fy + self.script.tug_n(self.t_s - self.script.tug_s, moved_m, self._velocity[1]), spin

    def _carry(self, load: Load, dt_s: float) -> None:
        """Stick or slide under ``load``."""
        near = self.sliding or self.utilisation >= FAR or self.t_s - self._need_s >= FAR_S
        if near and load != self._need_load:
            self._need, self._need_load, self._need_s = self._solve(load), load, self.t_s
        need = self._need
        self.utilisation = _ratio(need.normal_n, self.normal_n)
        if not self.sliding and self.utilisation > 1.0 and self._present:
            self.sliding, self._slide_began_s = True, self.t_s
            fx, fy, spin = load
            self._record("slide_begins", **self._numbers(), load_fx_n=fx, load_fy_n=fy, load_spin_nm=spin)
        self.friction = load
        if self.sliding:
            self._slide(load, need, dt_s)

    def _slide(self, load: Load, need: Need, dt_s: float) -> None:
        """Advance the sliding by one step under ``load``."""
        dynamic = self.utilisation * self.mu_s / self.mu_d
        vx, vy, spin_rate = need.twist
        size = math.sqrt(self.mass_kg * (vx * vx + vy * vy) + self.inertia_kgm2 * spin_rate * spin_rate)
        if size == 0.0:  # no load and so no direction of motion: the box stops
            self._speed = 0.0
        else:
            push = (load[0] * vx + load[1] * vy + load[2] * spin_rate) / size
            self._speed = max(self._speed + push * (1.0 - 1.0 / dynamic) * dt_s, 0.0)
            rate = self._speed / size
            self._velocity = (rate * vx, rate * vy, rate * spin_rate)
            self.displacement_m = (
                self.displacement_m[0] + self._velocity[0] * dt_s,
                self.displacement_m[1] + self._velocity[1] * dt_s,
            )
            self.angle_rad += self._velocity[2] * dt_s
            self.friction = (load[0] / dynamic, load[1] / dynamic, load[2] / dynamic)
        if self._speed == 0.0 and self.utilisation <= 1.0:
            self._stop()
            self.friction = load
        elif math.hypot(*self.displacement_m) > self.lost_at_m or abs(self.angle_rad) > self.lost_at_rad:
            self._stop()
            self._present, self.friction = False, (0.0, 0.0, 0.0)
            self._record("dropped", **self._numbers())

    def _stop(self) -> None:
        self.sliding, self._speed, self._velocity = False, 0.0, (0.0, 0.0, 0.0)
        self._record("slide_ends", **self._numbers())

    def _solve(self, load: Load) -> Need:
        """Return what the half of ``load`` on one pad needs at μ_s."""
        return self._limit.need((load[0] / 2, load[1] / 2, load[2] / 2), self.mu_s)

    def _rotation_begin_s(self, normal_n: float) -> float | None:
        """Return when the poured load alone would reach the limit at this grip force; it only grows: bisection."""

        def holds(t_s: float) -> bool:
            return self._solve(self.script.weight(t_s, self.mass_kg)).normal_n <= normal_n

        low_s, high_s = self.script.pour_s, self.script.pour_until_s
        if holds(high_s):
            return None
        while high_s - low_s > FORECAST_S:
            middle_s = (low_s + high_s) / 2
            low_s, high_s = (middle_s, high_s) if holds(middle_s) else (low_s, middle_s)
        return high_s

    def _numbers(self) -> dict[str, float | None]:
        return {
            "utilisation": self.utilisation if math.isfinite(self.utilisation) else None,
            "normal_n": self.normal_n,
            "displacement_m": math.hypot(*self.displacement_m),
            "angle_rad": self.angle_rad,
        }

    def _record(self, event: str, **values: float | None) -> None:
        self.truth.append(Truth(self.t_s, event, values))


def _ratio(needed_n: float, normal_n: float) -> float:
    if needed_n == 0.0:
        return 0.0
    return needed_n / normal_n if normal_n > 0.0 else math.inf
