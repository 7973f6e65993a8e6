"""A box between two pads, with the truth about when it slips. Pure: time is an argument.

The fingers close until they meet the box; the grip force follows the command with a lag; the script's loads come
on. Both pads carry half of everything, so one limit surface decides for both. While λ(μ_s) ≤ 1 the box sticks.
Beyond that it slides about the velocity pole of its load: friction carries the load scaled to the surface at μ_d,
whose normal is that motion, the excess accelerates the box along it, and it sticks again when its speed is back to
zero. So one number, the speed, is all its dynamics.

Left out, because the story does not need it: momentum along another motion than the load's, creep before slip,
compliance of the pads and growth of the patch with the force, tipping, the change of a lever with the box's angle,
inertia of what is poured in, a gripper that stalls. A box that has moved or turned too far is dropped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from slipd.sim.scene_script import Script
from slipd.sim.true_contact import FrictionLimit, Load, Need, Patch

LARGEST_STEP_S = 0.002
"""Longer steps are cut: the hand's spring and damper are integrated explicitly and need this."""

LET_GO_N = 0.05
"""An opening gripper's fingers leave the box when the force has decayed to this."""

FAR, FAR_S = 0.9, 0.005
"""While λ was below ``FAR``, what a load needs is worked out this seldom: no load of the script reaches 1 so fast."""

FORECAST_S = 1e-4
"""How finely the time is sought at which the box would begin to turn; a tenth of a reading's period."""

AT_REST = Need(0.0, (0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class GripCommand:
    """What the gripper's drive is asked for.

    Attributes:
        width_m: Where to go.
        speed_mps: How fast.
        force_n: Normal force per pad once something is held.
    """

    width_m: float
    speed_mps: float
    force_n: float


@dataclass(frozen=True, slots=True)
class Truth:
    """One change worth telling: ``event`` at ``t_s`` with the numbers that belong to it."""

    t_s: float
    event: str
    values: dict[str, float | None]


@dataclass
class Scene:
    """The box, its contact, the script, and what has become of them.

    Attributes:
        script: What pulls at the box, and when.
        patch: The contact on the left pad; the right one is its mirror image.
        object_width_m: Distance between the pads when they meet the box.
        open_width_m: Distance at which the gripper starts.
        mass_kg: Of the box.
        inertia_kgm2: Of the box about the pads' normal through the contact.
        mu_s: True static friction coefficient.
        mu_d: True dynamic friction coefficient.
        grip_lag_s: Time constant with which the grip force follows the command.
        lost_at_m: A box that has slid so far falls.
        lost_at_rad: A box that has turned so far falls.
        cell_m: Grid of the true contact; 2 mm puts its limit within 0.5 % of the continuous contact's.
        truth: Every change so far.
        t_s: Time of the last step.
        width_m: Distance between the pads.
        moving: The fingers move.
        in_contact: Both pads touch the box.
        normal_n: Grip force per pad.
        friction: What both pads together carry, left pad's frame.
        utilisation: True λ at μ_s of what the world asks of one pad; inf for a load that nothing carries.
        sliding: The box moves over the pads.
        displacement_m: How far it has slid, left pad's frame.
        angle_rad: How far it has turned, left pad's frame.
        rotation_would_begin_s: When the poured load would turn the box at the grip force held when the pouring
            began; None when it would not, and before that time.
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
            raise ValueError(f"mu_d {self.mu_d} and mu_s {self.mu_s}: 0 < mu_d <= mu_s is needed")
        self.width_m = self.open_width_m
        self._limit = FrictionLimit(self.patch, self.cell_m)
        self._solve(self.script.weight(self.script.pour_s, self.mass_kg))  # compiles the solver now, not in mid-scene
        self._need_load: Load = (0.0, 0.0, 0.0)
        self._need, self._need_s = AT_REST, 0.0
        self._present = True
        self._speed = 0.0  # of the one motion, as the root of twice the kinetic energy
        self._velocity: Load = (0.0, 0.0, 0.0)
        self._slide_began_s = 0.0
        self._tug_origin_m: float | None = None
        self._hand_gone = False
        self._phase = "approach"

    def step(self, t_s: float, command: GripCommand) -> None:
        """Go on to ``t_s`` with the gripper driven by ``command``.

        Raises:
            ValueError: ``t_s`` lies before the last step.
        """
        if t_s < self.t_s:
            raise ValueError(f"time goes back from {self.t_s} s to {t_s} s")
        begin_s, n = self.t_s, math.ceil((t_s - self.t_s) / LARGEST_STEP_S - 1e-9)
        for i in range(1, n + 1):
            now_s = t_s if i == n else begin_s + (t_s - begin_s) * i / n
            dt_s, self.t_s = now_s - self.t_s, now_s
            self._turn_pages()
            self._move_fingers(command, dt_s)
            self._carry(self._load(), dt_s)

    def _turn_pages(self) -> None:
        """Tell the phase when it changes, and what follows from the change."""
        phase = self.script.phase(self.t_s)
        if phase == self._phase:
            return
        self._phase = phase
        if phase == "lift" and not self.in_contact:
            self._present = False
            self._tell("left_behind")
            return
        self._tell(phase)
        if phase == "pour" and self.in_contact:
            self.rotation_would_begin_s = self._rotation_begin_s(self.normal_n)
            self._tell("forecast", rotation_would_begin_s=self.rotation_would_begin_s)

    def _move_fingers(self, command: GripCommand, dt_s: float) -> None:
        squeeze = self._present and command.width_m < self.object_width_m
        if self.in_contact:
            target_n = command.force_n if squeeze else 0.0
            self.normal_n += (target_n - self.normal_n) * -math.expm1(-dt_s / self.grip_lag_s)
            self.moving = False
            if squeeze or (self._present and self.normal_n > LET_GO_N):
                return
            self.in_contact, self.normal_n = False, 0.0
            self._tell("contact_ends")
        stop_m = self.object_width_m if squeeze and self.width_m >= self.object_width_m else command.width_m
        away_m, reach_m = stop_m - self.width_m, command.speed_mps * dt_s
        self.moving = abs(away_m) > reach_m
        self.width_m = self.width_m + math.copysign(reach_m, away_m) if self.moving else stop_m
        if squeeze and self.width_m == self.object_width_m:
            self.in_contact, self.moving = True, False
            self._tell("contact")

    def _load(self) -> Load:
        """What the world asks both pads to carry."""
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
            self._tell("tug_ends")
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
            self._tell("slide_begins", **self._numbers(), load_fx_n=fx, load_fy_n=fy, load_spin_nm=spin)
        self.friction = load
        if self.sliding:
            self._slide(load, need, dt_s)

    def _slide(self, load: Load, need: Need, dt_s: float) -> None:
        """One step of sliding under ``load``."""
        dynamic = self.utilisation * self.mu_s / self.mu_d
        vx, vy, spin_rate = need.twist
        size = math.sqrt(self.mass_kg * (vx * vx + vy * vy) + self.inertia_kgm2 * spin_rate * spin_rate)
        if size == 0.0:  # no load, no motion of its own: what took the load stops the box
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
            self._tell("dropped", **self._numbers())

    def _stop(self) -> None:
        self.sliding, self._speed, self._velocity = False, 0.0, (0.0, 0.0, 0.0)
        self._tell("slide_ends", **self._numbers())

    def _solve(self, load: Load) -> Need:
        """What one pad's half of ``load`` needs at μ_s."""
        return self._limit.need((load[0] / 2, load[1] / 2, load[2] / 2), self.mu_s)

    def _rotation_begin_s(self, normal_n: float) -> float | None:
        """When the poured load alone would reach the limit at this grip force; by bisection, as it only grows."""

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

    def _tell(self, event: str, **values: float | None) -> None:
        self.truth.append(Truth(self.t_s, event, values))


def _ratio(needed_n: float, normal_n: float) -> float:
    if needed_n == 0.0:
        return 0.0
    return needed_n / normal_n if normal_n > 0.0 else math.inf
