"""One pad of a grasp as the advice on motion needs it: its load over the last moments, friction and pressure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slipd.finger.finger_state import LoadDistribution
from slipd.finger.trust import is_trusted
from slipd.fusion.contact_state import WrenchUncertainty
from slipd.fusion.friction_learning import Z
from slipd.fusion.held_pad import NET_SHARE, HeldPad, tipping_edges, twist_net
from slipd.grasp.grasp_fingers import PlacedFinger
from slipd.grasp.motion_answers import NotKnownError
from slipd.types.arrays import Array

MEMORY_READINGS = 8
"""The load is a mean over about so many looks, 0.3 s: timing errors between fingers and arm cancel over a swing."""


LEAST_SHARED_N, LEAST_SPIN_NM = 0.2, 0.002
"""A smaller tangential force, or spin, of both pads together does not show how they share it."""
LEAST_DISSIPATED = 1e-9
"""A spin on a single taxel meets no friction: as little instead, so that quotients stay finite."""


class KnownContact(NamedTuple):
    """What limits a contact.

    Attributes:
        distribution: Shares of the normal force on the taxels.
        half_pitch_m: Half the distance between taxels, m.
        mu: Low bound of static friction.
        spin_scale: How many times as much friction a spin uses.
        noise: Of the force sensor.
        looks: Looks in the mean load, which has less noise.
    """

    distribution: LoadDistribution
    half_pitch_m: float
    mu: float
    spin_scale: float
    noise: WrenchUncertainty
    looks: int


class CarriedLoad(NamedTuple):
    """What a pad carries, and where.

    Attributes:
        tangential_n: Size of its tangential force, N.
        spin_nm: Spin about its contact centroid, along its own normal, N·m.
        centre_m: Contact centroid in the gripper frame, shape (3,), m.
    """

    tangential_n: float
    spin_nm: float
    centre_m: Array


class PadLoad:
    """Mean load of one pad, and what limits it.

    Args:
        placed: The finger, and the place of its pad.

    Attributes:
        finger: The finger.
        place: Pose of its pad.
        normal_n: Normal force, N: the mean, or the newest where that is less.
    """

    def __init__(self, placed: PlacedFinger) -> None:
        (self.finger, self.place), self.normal_n = placed, math.nan
        self._turn = np.ascontiguousarray(self.place.rotation.T)
        self._mean = np.zeros(6)

    def held_wrench(self) -> Sequence[float] | None:
        """Return the newest wrench of the finger; None where it is not trusted, or the finger holds nothing firmly."""
        state = self.finger.state
        firm = state.contact is not None and state.contact.valid and state.verdict.level != "slipping"
        return state.wrench if firm and is_trusted(state.verdict) else None

    def update(self, wrench: Sequence[float], looks: int) -> None:
        """Let a reading count for 1 of ``looks`` in the mean."""
        self._mean = self._mean + (np.array(wrench) - self._mean) / looks
        self.normal_n = min(-float(self._mean[2]), -wrench[2])

    def contact(self, t_ns: int, looks: int) -> KnownContact:
        """Return what limits the contact at ``t_ns``, with so many looks in the mean.

        Raises:
            NotKnownError: Something of it is not known.
        """
        finger, state, name = self.finger, self.finger.state, f"finger {self.finger.name}"
        force, pad, contact, friction = finger.force, finger.config.pad, state.contact, state.friction
        if force is None:
            raise NotKnownError(f"{name} has no force sensor")
        if contact is None or not is_trusted(state.verdict):
            raise NotKnownError(f"{name}: {', '.join(state.verdict.reasons) or state.verdict.level}")
        if not contact.valid:
            raise NotKnownError(f"{name} touches nothing")
        if state.verdict.level == "slipping":
            raise NotKnownError(f"{name} slips")
        if force.gravity.state(t_ns) == "unknown_orientation":
            raise NotKnownError(f"{name}: its own weight is not known (weight_unknown)")
        if state.load_distribution is None or pad is None or math.isnan(contact.spin_nm):
            raise NotKnownError(f"{name}: the torque that its contact can carry is not known (rotation_unobserved)")
        if friction is None or not friction.mu:
            raise NotKnownError(f"{name}: no friction is known (no_mu)")
        if looks == 0:
            raise NotKnownError(f"{name}: its load is not known yet")
        low = friction.mu if friction.mu_low is None else min(friction.mu, friction.mu_low)
        return KnownContact(state.load_distribution, 0.5 * pad.pitch_m, low, friction.spin_scale, force.noise, looks)

    def carried(self, width_m: float | None) -> CarriedLoad:
        """Return what the pad carries in the mean, at a width between the pads."""
        fx, fy, spin, cx, cy = self._load()
        centre = self.place.nearest_m(width_m) + self.place.rotation @ np.array((cx, cy, 0.0))
        return CarriedLoad(math.hypot(fx, fy), spin, centre)

    def held(
        self, contact: KnownContact, mass_kg: Array, com_m: Array, com_error_m: Array, share: float, spin_share: float
    ) -> HeldPad:
        """Return the pad for `slipd.fusion.held_pad`.

        Args:
            contact: What limits it.
            mass_kg: Least and largest mass of the object, shape (2,).
            com_m: Its centre of mass from the point between both contacts, in the gripper frame, shape (3,).
            com_error_m: How far each component may be off, shape (3,).
            share: Share of the tangential force that this pad carries now.
            spin_share: Likewise of the spin.
        """
        fx, fy, spin, cx, cy = self._load()
        distribution, outline, noise = contact.distribution, contact.distribution.outline, contact.noise
        net = twist_net(distribution.x, distribution.y, distribution.shares, cx, cy)
        at_origin = np.hypot(net[0] + net[2] * cy, net[1] - net[2] * cx)
        noisy = np.hypot(at_origin * noise.force_std_n, net[2] * noise.torque_std_nm) * (Z / math.sqrt(contact.looks))
        return HeldPad(
            self._turn, self._turn @ com_m, np.abs(self._turn) @ com_error_m, np.array((fx, fy, spin)), self.normal_n,
            np.sort((0.5, share)), np.sort((0.5, spin_share)), mass_kg, contact.mu, contact.spin_scale,
            np.vstack((net[:3], noisy)) / (NET_SHARE * contact.mu * np.maximum(net[3], LEAST_DISSIPATED)),
            tipping_edges(outline.x, outline.y, cx, cy, contact.half_pitch_m),
        )  # fmt: skip

    def _load(self) -> tuple[float, float, float, float, float]:
        """Return tangential force (2), spin about the contact centroid, and this centroid (2), of the mean."""
        fx, fy, fz, mx, my, mz = self._mean.tolist()
        cx, cy = -my / fz, mx / fz
        return fx, fy, mz - (cx * fy - cy * fx), cx, cy


def shares_of(first: CarriedLoad, second: CarriedLoad) -> tuple[float, float]:
    """Return the share of tangential force and spin on the first pad; a half where the load does not show it.

    The pads face each other, so one twist of the object has opposite signs on both.
    """
    tangential, one, other = first.tangential_n + second.tangential_n, first.spin_nm, -second.spin_nm
    share = first.tangential_n / tangential if tangential > LEAST_SHARED_N else 0.5
    spins = one * other > 0.0 and abs(one + other) > LEAST_SPIN_NM
    return share, one / (one + other) if spins else 0.5
