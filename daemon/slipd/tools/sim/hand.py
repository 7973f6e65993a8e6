"""A hand that presses, pushes and twists the pads of emulated devices, the object in the gripper, and the arm.

Pure: time is an argument. Friction is Coulomb's: a load beyond the static limit slides until it falls below the dynamic
one. There is no inertia and no elasticity; `slipd.tools.sim.scene` has a physical grasp.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from slipd.grasp.grasp_fingers import Place
from slipd.signals.gravity import STANDARD_GRAVITY_MPS2, FingerWeight, gravity_at
from slipd.tools.sim.hand_commands import Command, CommandError
from slipd.types.arrays import Array

MU_S, MU_D = 0.6, 0.45


@dataclass(frozen=True, slots=True)
class PadLoad:
    """What acts on a pad, in its frame.

    Attributes:
        place_m: Centre of pressure, m.
        normal_n: Normal force, N.
        tangential_n: Force along X and Y, N.
        spin_nm: Torque about the normal through the centre of pressure, N·m.
    """

    place_m: tuple[float, float] = (0.0, 0.0)
    normal_n: float = 0.0
    tangential_n: tuple[float, float] = (0.0, 0.0)
    spin_nm: float = 0.0

    def wrench(self) -> Array:
        """Return force, N, and torque about the origin of the pad, N·m, on the finger, shape (6,)."""
        (x, y), (fx, fy), fz = self.place_m, self.tangential_n, -self.normal_n
        return np.array((fx, fy, fz, y * fz, -x * fz, x * fy - y * fx + self.spin_nm))


class _Ramp:
    """A value that changes linearly to its goal."""

    def __init__(self, size: int) -> None:
        self.begin = self.goal = np.zeros(size)
        self.begin_s = self.takes_s = 0.0

    def at(self, t_s: float) -> Array:
        done = 1.0 if self.takes_s <= 0.0 else min(max((t_s - self.begin_s) / self.takes_s, 0.0), 1.0)
        return self.begin + done * (self.goal - self.begin)

    def set(self, goal: Array, t_s: float, takes_s: float) -> None:
        self.begin, self.goal, self.begin_s, self.takes_s = self.at(t_s), goal, t_s, takes_s


@dataclass(slots=True)
class _Touched:
    """One finger: the touch of the hand, and the finger's own weight."""

    weight: FingerWeight
    place_m: tuple[float, float] = (0.0, 0.0)
    press_n: _Ramp = field(default_factory=lambda: _Ramp(1))
    push_n: _Ramp = field(default_factory=lambda: _Ramp(2))
    twist_nm: _Ramp = field(default_factory=lambda: _Ramp(1))
    gravity_mps2: Array = field(default_factory=lambda: np.array((STANDARD_GRAVITY_MPS2, 0.0, 0.0)))
    by_arm: bool = False  # its gravity is that of the arm
    sliding: bool = False

    def tilt(self, gravity: tuple[float, ...]) -> None:
        self.by_arm = False
        self.gravity_mps2 = np.array(gravity) * (STANDARD_GRAVITY_MPS2 / math.hypot(*gravity))

    def release(self) -> None:
        self.press_n, self.push_n, self.twist_nm = _Ramp(1), _Ramp(2), _Ramp(1)
        self.place_m = (0.0, 0.0)


class Hand:
    """What acts on each finger, by the commands so far.

    Args:
        weights: Weight of each finger beyond its force sensor.
        mirrored: Fingers whose Y axis points the other way than that of the first finger; a pull on a held object
            reverses its Y for them.
        pads: Places of the pads in the gripper frame, by finger; the arm moves these fingers, half open.

    Attributes:
        part_m: Width of the object between the pads, m; 0: none.
    """

    def __init__(
        self,
        weights: Mapping[str, FingerWeight],
        mirrored: frozenset[str] = frozenset(),
        pads: Mapping[str, Place] = {},
    ) -> None:
        self.part_m = 0.0
        self._fingers = {name: _Touched(weight) for name, weight in weights.items()}
        self._mirrored, self._pads = mirrored, pads
        self._arm = _Ramp(6)  # apparent gravity and angular velocity in the gripper frame
        for name, pad in list(pads.items())[:1]:
            upright = np.concatenate((pad.rotation @ self._fingers[name].gravity_mps2, np.zeros(3)))
            self._arm.set(upright, 0.0, 0.0)
        self._pull_n = _Ramp(2)
        self._mu_s, self._mu_d = MU_S, MU_D

    def carry_out(self, command: Command, t_s: float) -> None:
        """Carry out a command that changes a load.

        Raises:
            CommandError: A push or a twist acts on a finger that nothing presses, or an arm moves no finger.
        """
        values, takes_s = command.values, command.seconds
        finger = self._fingers.get(command.finger)
        if command.verb == "object":
            (self.part_m,) = values
        elif command.verb == "friction":
            self._mu_s, self._mu_d = values
        elif command.verb == "pull":
            self._pull_n.set(values[0] * np.array(command.direction), t_s, takes_s)
        elif command.verb == "arm":
            if not self._pads:
                raise CommandError("arm: the config must have [grasp.pads], which say how the arm moves each finger")
            self._arm.set(np.array(values), t_s, takes_s)
            for name in self._pads:
                self._fingers[name].by_arm = True
        elif command.verb in ("tilt", "release"):
            for each in self._fingers.values() if finger is None else (finger,):
                each.tilt(values) if values else each.release()
        elif finger is not None:
            self._touch(finger, command, t_s)

    def _touch(self, finger: _Touched, command: Command, t_s: float) -> None:
        values, takes_s = command.values, command.seconds
        if command.verb == "press":
            if command.place_m is not None:
                finger.place_m = command.place_m[0], command.place_m[1]
            finger.press_n.set(np.array(values), t_s, takes_s)
        elif command.verb == "weight":
            finger.weight = FingerWeight(values[0], finger.weight.com_m if command.place_m is None else command.place_m)
        elif not finger.press_n.goal.any() and not self.part_m:
            raise CommandError(f"{command.verb}: press finger {command.finger} first; friction needs a normal force")
        elif command.verb == "push":
            finger.push_n.set(values[0] * np.array(command.direction), t_s, takes_s)
        else:
            finger.twist_nm.set(np.array(values), t_s, takes_s)

    def load(self, name: str, t_s: float, grip_n: float) -> PadLoad:
        """Return the load on a finger.

        Args:
            name: Name of the finger.
            t_s: Time, s.
            grip_n: Force on one pad with which the gripper holds an object, N; it acts at the centre of the pad.
        """
        finger = self._fingers[name]
        press_n = float(finger.press_n.at(t_s)[0])
        normal_n = press_n + grip_n
        if normal_n <= 0.0:
            finger.sliding = False
            return PadLoad()
        share = press_n / normal_n
        place_m = finger.place_m[0] * share, finger.place_m[1] * share
        wanted_n = finger.push_n.at(t_s)
        if grip_n > 0.0:
            wanted_n = wanted_n + self._pull_n.at(t_s) / 2 * (1.0, -1.0 if name in self._mirrored else 1.0)
        return PadLoad(place_m, normal_n, self._carried(finger, wanted_n, normal_n), float(finger.twist_nm.at(t_s)[0]))

    def arm(self, t_s: float) -> tuple[Array, Array]:
        """Return the apparent gravity, m/s², and the angular velocity, rad/s, of the arm in the gripper frame."""
        motion = self._arm.at(t_s)
        return motion[:3], motion[3:]

    def weight(self, name: str, t_s: float) -> Array:
        """Return the wrench of a finger's own weight about the origin of its pad, N and N·m, shape (6,)."""
        finger = self._fingers[name]
        if not finger.by_arm:
            return finger.weight.wrench(finger.gravity_mps2)
        pad, motion = self._pads[name], self._arm.at(t_s).tolist()
        centre_m = pad.nearest_m(None) + pad.rotation @ finger.weight.com_m
        return finger.weight.wrench(gravity_at(centre_m.tolist(), motion[:3], motion[3:], None) @ pad.rotation)

    def _carried(self, finger: _Touched, wanted_n: Array, normal_n: float) -> tuple[float, float]:
        """Return the part of a tangential force that friction transmits."""
        amount_n = math.hypot(*wanted_n)
        finger.sliding = amount_n > (self._mu_d if finger.sliding else self._mu_s) * normal_n
        scale = self._mu_d * normal_n / amount_n if finger.sliding else 1.0
        return float(scale * wanted_n[0]), float(scale * wanted_n[1])
