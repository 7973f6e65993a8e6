"""A box between two pads, with the true times at which it slips. Pure: time is an argument.

The fingers close until they touch the box; the grip force follows the command with a lag; the loads of the script act.
From contact on, the simulator `slipd.tools.sim.stepped_grasp` moves the box: every cell of the contact sticks or slides
by itself. The limit surface decides nothing here. It only gives the true utilisation, and when the poured load
would turn the box.

Not modelled, because the script does not need it: growth of the patch with the force, tipping, the change of a lever
with the angle of the box, inertia of the poured weight, a gripper that stalls. A box that has moved or turned too far
is dropped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import bisect

from slipd.tools.sim.bristle_kernels import Body
from slipd.tools.sim.emulators import moved_jaws
from slipd.tools.sim.scene_parts import FrictionLimit, Load, Patch, Script
from slipd.tools.sim.stepped_grasp import DAMPING_NS_PER_M3, STIFFNESS_N_PER_M3, FrictionLaw, SteppedGrasp
from slipd.types.arrays import Array

LARGEST_STEP_S = 0.002
"""Longest step, s: spring and damper of the hand follow the box one step late. Longer steps are divided."""

LET_GO_N = 0.05
"""Force at which the fingers of an opening gripper leave the box, N."""

SLIDES_MPS = 1e-3
"""The box slides if all of its contact does and is faster than this, m/s: elastic motion of the pads is slower."""

PAUSE_S = 0.01
"""Shorter pauses of sliding do not end it, s."""

FORECAST_S = 1e-4
"""Resolution of the time at which the box would begin to turn, s; a tenth of the period of the readings."""

FREE = np.zeros(6)

MIRROR = np.array((1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
"""The wrench on the right finger over that on the left one: nothing tilts the box, so the contacts are mirrored."""


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
        friction: True friction of both pads.
        object_width_m: Distance between the pads when they touch the box.
        open_width_m: Distance between the pads at the start.
        mass_kg: Mass of the box.
        inertia_kgm2: Moment of inertia of the box about the normal of the pads through the contact.
        grip_lag_s: Time constant with which the grip force follows the command.
        lost_at_m: A box that has slid this far falls.
        lost_at_rad: A box that has turned this far falls.
        cell_m: Cell of the grid of the true contact; with 2 mm the demo slips within 10 ms of when it does with 1 mm.
        truth: All events so far.
        t_s: Time of the last step.
        width_m: Distance between the pads.
        moving: The fingers move.
        in_contact: Both pads touch the box.
        sliding: Whether the box slides over the pads.
    """

    script: Script = field(default_factory=Script)
    patch: Patch = field(default_factory=Patch)
    friction: FrictionLaw = field(default_factory=FrictionLaw)
    object_width_m: float = 0.060
    open_width_m: float = 0.085
    mass_kg: float = 0.25
    inertia_kgm2: float = 1e-3
    grip_lag_s: float = 0.06
    lost_at_m: float = 0.040
    lost_at_rad: float = 1.0
    cell_m: float = 0.002

    truth: list[Truth] = field(default_factory=list, init=False)
    t_s: float = field(default=0.0, init=False)
    width_m: float = field(init=False)
    moving: bool = field(default=False, init=False)
    in_contact: bool = field(default=False, init=False)
    sliding: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self.width_m = self.open_width_m
        self._limit = FrictionLimit(self.patch, self.cell_m)
        self._need_n((1.0, 0.0, 0.0))  # compiles the kernels before the scene runs
        self._grasp = self._grip()
        self._grasp.advance(LARGEST_STEP_S, (0.0, 0.0), 0.0, 0.0)
        self._wrench = FREE
        self._present = True
        self._slide_began_s = self._slid_s = 0.0
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
            if self.in_contact:
                self._hold(command, dt_s)
            else:
                self._move_fingers(command, dt_s)

    @property
    def normal_n(self) -> float:
        """Grip force on one pad, N."""
        return self._grasp.normal_n if self.in_contact else 0.0

    @property
    def displacement_m(self) -> tuple[float, float]:
        """How far the box has moved since contact at the centre of the patch, in the frame of the left pad, m."""
        (x_m, y_m), (cx_m, cy_m) = self._grasp.motion[:2].tolist(), self.patch.centre_m
        return x_m - cx_m, y_m - cy_m

    @property
    def angle_rad(self) -> float:
        """How far the box has turned since contact, in the frame of the left pad, rad."""
        return float(self._grasp.motion[2])

    @property
    def utilisation(self) -> float:
        """True λ at μ_s of the load that the pads carry; 0 out of contact."""
        normal_n = self.normal_n
        if normal_n == 0.0:
            return 0.0
        (fx, fy, _, _, _, about_origin), (cx, cy) = self.wrench(right=False).tolist(), self.patch.centre_m
        return self._need_n((2 * fx, 2 * fy, 2 * (about_origin - cx * fy + cy * fx))) / normal_n

    def wrench(self, *, right: bool) -> Array:
        """Return force and torque of the box on a finger, in its pad frame about the centre of the pad, shape (6,)."""
        return self._wrench * MIRROR if right else self._wrench

    def _grip(self) -> SteppedGrasp:
        """Return the box at rest between pads that do not press yet; its centre of mass is that of the contact."""
        limit, area_m2 = self._limit, self._limit.area_m2
        law = self.friction.of_cell(STIFFNESS_N_PER_M3 * area_m2, DAMPING_NS_PER_M3 * area_m2)
        body = Body(self.mass_kg, self.inertia_kgm2, load_x=0.0, load_y=0.0)
        return SteppedGrasp(law, body, self.patch.centre_m, limit.cells, limit.shares, grip_lag_s=self.grip_lag_s)

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
            self._record("forecast", rotation_would_begin_s=self._rotation_begin_s(self.normal_n))

    def _move_fingers(self, command: GripCommand, dt_s: float) -> None:
        part_m = self.object_width_m if self._present else 0.0
        reach_m = command.speed_mps * dt_s
        self.width_m, self.moving, self.in_contact = moved_jaws(self.width_m, command.width_m, part_m, reach_m)
        if self.in_contact:
            self._grasp = self._grip()
            self._record("contact")

    def _hold(self, command: GripCommand, dt_s: float) -> None:
        """Hold the box for one step, or leave it."""
        fx, fy, spin = self._load()
        squeeze = self._present and command.width_m < self.object_width_m
        self._grasp.advance(dt_s, (fx, fy), spin, command.force_n if squeeze else 0.0)
        (fx_n, fy_n, spin_nm), (x_m, y_m) = self._grasp.carried(), self.patch.centre_m
        self._wrench = np.array((fx_n, fy_n, -self.normal_n, -y_m * self.normal_n, x_m * self.normal_n, spin_nm))
        self._judge_motion((fx, fy, spin))
        if not self._present or (not squeeze and self.normal_n <= LET_GO_N):
            self._stop_sliding()
            self.in_contact, self._wrench = False, FREE
            self._record("contact_ends")

    def _load(self) -> Load:
        """Return the load on both pads together."""
        fx, fy, spin = self.script.weight(self.t_s, self.mass_kg)
        if self._phase != "tug" or self._hand_gone:
            return fx, fy, spin
        at_m = self.displacement_m[1]
        if self._tug_origin_m is None:
            self._tug_origin_m = at_m
        if self.sliding and self.t_s - self._slide_began_s >= self.script.tug_slip_s:
            self._hand_gone = True
            self._record("tug_ends")
            return fx, fy, spin
        speed_mps = self._grasp.motion.item(4)
        return fx, fy + self.script.tug_n(self.t_s - self.script.tug_s, at_m - self._tug_origin_m, speed_mps), spin

    def _judge_motion(self, load: Load) -> None:
        """Record that the box begins or ceases to slide, or falls."""
        vx, vy, rate = self._grasp.motion[3:].tolist()
        speed_mps = math.sqrt(vx * vx + vy * vy + (rate * self._limit.gyration_m) ** 2)
        if self._grasp.gross and speed_mps > SLIDES_MPS:
            self._slid_s = self.t_s
            if not self.sliding:
                self.sliding, self._slide_began_s = True, self.t_s
                fx, fy, spin = load
                self._record("slide_begins", **self._numbers(), load_fx_n=fx, load_fy_n=fy, load_spin_nm=spin)
        elif self.sliding and self.t_s - self._slid_s >= PAUSE_S:
            self._stop_sliding()
        is_lost = math.hypot(*self.displacement_m) > self.lost_at_m or abs(self.angle_rad) > self.lost_at_rad
        if speed_mps > SLIDES_MPS and is_lost:
            self._stop_sliding()
            self._present = False
            self._record("dropped", **self._numbers())

    def _stop_sliding(self) -> None:
        if self.sliding:
            self.sliding = False
            self._record("slide_ends", **self._numbers())

    def _need_n(self, load: Load) -> float:
        """Return the grip force on one pad that half of ``load`` needs at μ_s."""
        return self._limit.need_n((load[0] / 2, load[1] / 2, load[2] / 2), self.friction.mu_s)

    def _rotation_begin_s(self, normal_n: float) -> float | None:
        """Return when the poured load alone, which grows, would reach the limit at this grip force; None if never."""

        def lacking_n(t_s: float) -> float:
            return self._need_n(self.script.weight(t_s, self.mass_kg)) - normal_n

        begin_s, end_s = self.script.pour_s, self.script.pour_until_s
        if lacking_n(end_s) <= 0.0:
            return None
        return begin_s if lacking_n(begin_s) > 0.0 else float(bisect(lacking_n, begin_s, end_s, xtol=FORECAST_S))

    def _numbers(self) -> dict[str, float | None]:
        return {
            "utilisation": self.utilisation,
            "normal_n": self.normal_n,
            "displacement_m": math.hypot(*self.displacement_m),
            "angle_rad": self.angle_rad,
        }

    def _record(self, event: str, **values: float | None) -> None:
        self.truth.append(Truth(self.t_s, event, values))
