"""The fingers of a grasp: where their pads are, what they weigh, and the load that both carry together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from slipd.config import Grasp, PadPlace
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.trust import is_trusted
from slipd.fusion.grasp import PadPose, external_wrench
from slipd.signals.gravity import gravity_at
from slipd.types.arrays import Array, cross_matrix, rotation_matrix
from slipd.types.samples import ArmSample

MOST_SKEW_NS = 15_000_000
"""The newest readings of both fingers are no further apart."""
LEAST_NOISE_N, LEAST_NOISE_NM = 0.005, 5e-5
"""Least noise of a sensor, even if its config states less."""


class Place:
    """Pose of a pad at each width, from ``[grasp.pads.X]``.

    Attributes:
        rotation: Maps pad coordinates to gripper coordinates, shape (3, 3).
    """

    def __init__(self, config: PadPlace) -> None:
        self.rotation = rotation_matrix(config.quat_xyzw)
        rows = np.array(config.positions)
        self._widths_m, self._positions_m = rows[:, 0], rows[:, 1:]

    def pose(self, width_m: float | None) -> PadPose:
        """Return the pose; without a position where the width is unknown or outside the configured positions."""
        widths = self._widths_m
        if width_m is None or not widths[0] <= width_m <= widths[-1]:
            return PadPose(self.rotation, None)
        return PadPose(self.rotation, self.nearest_m(width_m))

    def nearest_m(self, width_m: float | None) -> Array:
        """Return the position, shape (3,), m; the nearest configured one beyond them, the middle one where unknown."""
        widths = self._widths_m
        at_m = (widths[0] + widths[-1]) / 2.0 if width_m is None else width_m
        return np.array([np.interp(at_m, widths, along) for along in self._positions_m.T])


class PlacedFinger(NamedTuple):
    """One finger of the grasp, and where its pad is."""

    finger: Finger
    place: Place


def place_fingers(grasp: Grasp, fingers: Mapping[str, Finger]) -> list[PlacedFinger]:
    """Return the two fingers that ``[grasp]`` names, out of all fingers by name."""
    return [PlacedFinger(fingers[name], Place(place)) for name, place in grasp.pads.items()]


class WeighedFinger:
    """One finger of the grasp with a force sensor, whose own weight is known at each width.

    Args:
        finger: The finger.
        place: Pose of its pad.
        force: Its force sensor.
        com_m: Centre of mass beyond the sensor, in the pad frame, m.

    Attributes:
        finger: As given.
        place: As given.
        force: As given.
        noise_n: Standard deviation of the noise of each force component, N.
    """

    def __init__(self, finger: Finger, place: Place, force: ForceChannel, com_m: Sequence[float]) -> None:
        self.finger, self.place, self.force = finger, place, force
        self.noise_n = max(force.noise.force_std_n, LEAST_NOISE_N)
        self._noise_nm = max(force.noise.torque_std_nm, LEAST_NOISE_NM)
        self._com_m: Array = place.rotation @ com_m
        self._width_m: float | None = None
        self._centre_m: list[float] = (place.nearest_m(None) + self._com_m).tolist()

    def noise(self, place_m: Array) -> Array:
        """Return the covariance of the noise of force and torque about the origin, shape (6, 6)."""
        lever, force = cross_matrix(place_m), self.noise_n**2
        torque = force * lever @ lever.T + self._noise_nm**2 * np.eye(3)
        return np.block([[force * np.eye(3), force * lever.T], [force * lever, torque]])

    def weight_n(self) -> Array:
        """Return the weight of the finger that is subtracted from its readings, in the gripper frame, shape (3,), N."""
        weight = self.force.gravity.correction
        return np.zeros(3) if weight is None else self.place.rotation @ weight[:3]

    def holds_firmly(self, t_ns: int) -> bool:
        """Return whether the finger touches and does not slip, and its readings are without its own weight."""
        weighed = self.force.gravity.state(t_ns) != "unknown_orientation"
        return weighed and self.finger.in_contact and self.finger.level != "slipping"

    def contact_m(self, centre_m: Array) -> Array:
        """Return the contact centroid on a pad with this centre, in the gripper frame, shape (3,), m; NaN: unknown."""
        contact = self.finger.state.contact
        cx, cy = (math.nan, math.nan) if contact is None else (contact.cx_m, contact.cy_m)
        at_m: Array = centre_m + self.place.rotation @ (cx, cy, 0.0)
        return at_m

    def gravity(self, t_ns: int) -> Array | None:
        """Return the apparent gravity that is known of the finger, in the gripper frame, shape (3,), m/s²."""
        gravity = self.force.gravity.gravity(t_ns)
        return None if gravity is None else self.place.rotation @ gravity

    def gravity_under(self, motion: ArmSample, width_m: float | None) -> list[float]:
        """Return the apparent gravity at the centre of mass under a motion of the arm, in the pad frame, m/s²."""
        if width_m != self._width_m:
            self._width_m = width_m
            self._centre_m = (self.place.nearest_m(width_m) + self._com_m).tolist()
        velocity, acceleration = motion.angular_velocity_radps, motion.angular_acceleration_radps2
        at_com = gravity_at(self._centre_m, motion.gravity_mps2, velocity, acceleration)
        in_pad: list[float] = (at_com @ self.place.rotation).tolist()
        return in_pad

    def set_motion(self, gravity_mps2: list[float], velocity_radps: Sequence[float], t_ns: int, fresh_ns: int) -> None:
        """Set the apparent gravity of the finger, in the pad frame, and the angular velocity of the gripper."""
        turn_radps = float(self.place.rotation[:, 2] @ velocity_radps)
        self.force.set_motion(gravity_mps2, turn_radps, t_ns, fresh_ns)


def weighed_fingers(placed: Sequence[PlacedFinger]) -> list[WeighedFinger]:
    """Return those fingers of the grasp that have a force sensor."""
    return [
        WeighedFinger(finger, place, finger.force, finger.config.wrench.com_m)
        for finger, place in placed
        if finger.force is not None and finger.config.wrench is not None
    ]


class Geometry(NamedTuple):
    """What follows from the width between the pads.

    Attributes:
        width_m: The width, m; None where it is not known.
        poses: Poses of the pads.
        centres_m: Their centres in the gripper frame, each of shape (3,), m.
        noise: Covariance of the noise of force and torque of both fingers together, shape (6, 6).
        lever_m: Distance of the pads from the origin, m.
    """

    width_m: float | None
    poses: list[PadPose]
    centres_m: list[Array]
    noise: Array
    lever_m: float


class LoadReading(NamedTuple):
    """The load on both fingers at a time, in the gripper frame.

    Attributes:
        t_ns: When it was.
        whole_n: Force with the weight of the fingers, shape (3,), N.
        own: Force and torque without it, shape (6,); None where it is not known, or nothing is held firmly.
        grip_n: Mean normal force, N.
        middle_m: Point between both contacts, shape (3,), m; NaN where a pad touches nothing.
        geometry: Of the pads.
    """

    t_ns: int
    whole_n: Array
    own: Array | None
    grip_n: float
    middle_m: Array
    geometry: Geometry


class LoadReader:
    """Reads the load on both fingers of the grasp.

    Args:
        fingers: Both, each with a force sensor.
    """

    def __init__(self, fingers: Sequence[WeighedFinger]) -> None:
        self._fingers = fingers
        self._geometry: Geometry | None = None

    def read(self, width_m: float | None, t_ns: int) -> LoadReading | None:
        """Return the load of the newest readings; None where they are not trusted, or do not belong together.

        Args:
            width_m: Width between the pads, m; None where it is not known.
            t_ns: Now.
        """
        fingers = self._fingers
        states = [one.finger.state for one in fingers]
        times_ns = [state.t_ns for state in states]
        wrenches = [found for state in states if is_trusted(state.verdict) and (found := state.wrench) is not None]
        if len(wrenches) < len(states) or max(times_ns) - min(times_ns) > MOST_SKEW_NS:
            return None
        if self._geometry is None or self._geometry.width_m != width_m:
            self._geometry = self._find_geometry(width_m)
        carried = external_wrench(wrenches, self._geometry.poses)
        firm = all(one.holds_firmly(t_ns) for one in fingers)
        torque_nm = np.full(3, math.nan) if carried.torque_nm is None else carried.torque_nm
        contacts_m = [one.contact_m(at_m) for one, at_m in zip(fingers, self._geometry.centres_m, strict=True)]
        return LoadReading(
            t_ns=sum(times_ns) // len(times_ns),
            whole_n=sum((one.weight_n() for one in fingers), carried.force_n),
            own=np.concatenate((carried.force_n, torque_nm)) if firm else None,
            grip_n=max(-sum(wrench[2] for wrench in wrenches) / len(wrenches), 0.0),
            middle_m=0.5 * contacts_m[0] + 0.5 * contacts_m[1],
            geometry=self._geometry,
        )

    def _find_geometry(self, width_m: float | None) -> Geometry:
        places_m = [one.place.nearest_m(width_m) for one in self._fingers]
        return Geometry(
            width_m,
            [one.place.pose(width_m) for one in self._fingers],
            places_m,
            np.sum([one.noise(place_m) for one, place_m in zip(self._fingers, places_m, strict=True)], axis=0),
            max(float(np.linalg.norm(place_m)) for place_m in places_m),
        )
