"""Evidence "external" that the object moves: another process reports where it is, or how fast it moves.

Such a process may follow the object by a camera. The first poses of a hold are the reference, and their scatter is the
noise. A camera errs with the pose of the arm too, which no scatter shows, so the config states the least error of a
position. A speed comes with its own error.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.motion.evidence import LASTS_NS, REFERENCE, Evidence, f_surprise
from slipd.types.arrays import Array
from slipd.types.samples import ObjectSample
from slipd_client.quaternions import conjugate, product, rotation_vector

REACH_M = 0.05
"""An error of the position is one of the direction at this distance, m: half the size of an object."""
KNOWN = 1e6
"""Degrees of freedom of an error that is stated."""


class OutsideMotion:
    """Finds motion of the object in what another process reports of it.

    False alarms: with errors no larger than stated and measured, a surprise above s comes in less than exp(−s) of the
    looks. Each reading is a look.

    Args:
        std_m: Least standard deviation of a position, m.
        rate_hz: Rate of the readings, 1/s.
    """

    def __init__(self, std_m: float, rate_hz: float) -> None:
        self._std_m = std_m
        self.looks_per_hour = 3600.0 * rate_hz
        self._begin(None)

    def _begin(self, t_ns: int | None) -> None:
        """Begin a hold; None: nothing is held."""
        self._since_ns = t_ns
        self._first: list[Array] = []
        self._turn: tuple[float, ...] | None = None  # orientation of the first pose
        self._mean: Array = np.empty(0)
        self._variance, self._freedom = np.empty(0), KNOWN
        self._before = 0.0

    def update(self, t_ns: int, reading: ObjectSample, *, held: bool) -> Evidence | None:
        """Update with a reading; return evidence where the object moves.

        Args:
            t_ns: Time of the reading, CLOCK_MONOTONIC.
            reading: The reading.
            held: An object is held.
        """
        if not held:
            self._begin(None)
            return None
        if self._since_ns is None:
            self._begin(t_ns)
        if t_ns - (self._since_ns or t_ns) < LASTS_NS:
            return None
        found = [
            surprise for surprise in (_speed_surprise(reading), self._pose_surprise(reading)) if surprise is not None
        ]
        if not found:
            return None
        surprise = max(found) - math.log(len(found))
        lasts, self._before = min(surprise, self._before), surprise  # a single wrong reading does not count
        return Evidence("external", t_ns, lasts) if lasts > 0.0 else None

    def confirm(self) -> None:
        """Take the newest evidence as true: the pose of now is the one from which a further motion is measured."""
        self._begin(self._since_ns)

    def _pose_surprise(self, reading: ObjectSample) -> float | None:
        """Return the surprise of the displacement from the reference; None without a reference."""
        if reading.xyz_m is None:
            return None
        pose = self._pose(reading.xyz_m, reading.quat_xyzw)
        if self._first and len(pose) != len(self._first[0]):  # the orientation came or went
            self._begin(self._since_ns)
            pose = self._pose(reading.xyz_m, reading.quat_xyzw)
        if len(self._first) < REFERENCE:
            self._first.append(pose)
            if len(self._first) == REFERENCE:
                self._measure()
            return None
        away = pose - self._mean
        return f_surprise(float((away * away / self._variance).mean()), len(pose), self._freedom)

    def _measure(self) -> None:
        """Take the first poses as the reference: what is stated and what is measured of their error add up."""
        poses = np.array(self._first)
        measured, stated = poses.var(axis=0, ddof=1), self._std_m**2
        self._mean = poses.mean(axis=0)
        self._variance = measured * (1.0 + 1.0 / REFERENCE) + stated
        most = max(float(measured.max()), 1e-6 * stated)
        self._freedom = min((REFERENCE - 1) * ((most + stated) / most) ** 2, KNOWN)  # Welch and Satterthwaite

    def _pose(self, xyz_m: tuple[float, ...], quat_xyzw: tuple[float, ...] | None) -> Array:
        """Return position and, where it is known, orientation times ``REACH_M``, from that of the first."""
        if quat_xyzw is None:
            return np.array(xyz_m)
        if self._turn is None or not self._first:
            self._turn = quat_xyzw
        turn = rotation_vector(product(conjugate(self._turn), quat_xyzw))
        return np.array((*xyz_m, *(REACH_M * angle for angle in turn)))


def _speed_surprise(reading: ObjectSample) -> float | None:
    """Return the surprise of the stated speed; None where the speed or its error is not stated."""
    if reading.speed_mps is None or not reading.speed_std_mps:
        return None
    return f_surprise((max(reading.speed_mps, 0.0) / reading.speed_std_mps) ** 2, 1, KNOWN)
