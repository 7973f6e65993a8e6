"""The motions that a gripper was commanded: where the fingers may be going, and whether they ignore it."""

from __future__ import annotations

import math

from slipd.types.samples import GripperSample

LONGEST_BEGIN_NS, BEGIN_PERIODS = 1_000_000_000, 3.0
"""A motion that no reading has shown within this time, or three of the gripper's periods, has ended, or never began."""

ARRIVED_M = 5e-4
"""Fingers this close to their goal have arrived, m; a motion that takes them no farther cannot be seen."""

FAR = 0.25
"""Share of the range of widths from which fingers that stay where they were have ignored a motion: closer to the goal,
their own stop may hold them."""


class CommandedMotion:
    """Follows the fingers from a command to the end of its motion.

    Args:
        rate_hz: Rate of the gripper's readings.

    Attributes:
        moving: Whether the fingers move, as far as is known.
        sent_ns: When the newest motion was commanded.
        goals_m: Narrowest and widest goal of the motions that may be under way, m; None: there are none, or it is not
            known.
    """

    def __init__(self, rate_hz: float) -> None:
        self._longest_begin_ns = max(LONGEST_BEGIN_NS, round(BEGIN_PERIODS * 1e9 / rate_hz))
        self.goals_m: tuple[float, float] | None = None
        self._goal_m = 0.0  # of the newest motion
        # _shown: a reading has shown the newest motion, or explained why the fingers stay
        # _from_m, _from_ns: place and time at which the oldest motion that no reading has shown began; None: not known,
        # or the fingers may stay there
        self.moving = self._shown = False
        self.sent_ns = self._from_ns = 0
        self._from_m: float | None = None

    def begin(self, goal_m: float, from_m: float | None, slowest_mps: float, t_ns: int) -> None:
        """Record a command.

        Args:
            goal_m: Where it sends the fingers, m.
            from_m: Where they are, m; None if not known.
            slowest_mps: Speed that the motion has at least, m/s.
            t_ns: Time of the command.
        """
        if self.goals_m is None or self._shown or self._from_m is None:
            is_visible = slowest_mps * self._longest_begin_ns * 1e-9 > 2.0 * ARRIVED_M
            self._from_m, self._from_ns = from_m if is_visible else None, t_ns
        narrowest_m, widest_m = self.goals_m or (goal_m, goal_m)
        self._goal_m, self.goals_m = goal_m, (min(narrowest_m, goal_m), max(widest_m, goal_m))
        self.moving, self._shown, self.sent_ns = True, False, t_ns

    def excuse(self) -> None:
        """Allow that the fingers stay where they are: they were halted, or the next reading may be an old one."""
        self._from_m = None

    def forget(self) -> None:
        """Forget the goals: an activation replaces the motions, or others may move the gripper from here on."""
        self.goals_m = None

    def update(self, sample: GripperSample, width_m: float | None, range_m: tuple[float, float]) -> bool:
        """Update with a reading, which may be older than the newest command.

        Args:
            sample: The reading.
            width_m: Its width, m; None if not known.
            range_m: Smallest and largest width of the gripper, m.

        Returns:
            Whether the fingers are still where they were, far from the goal, and the gripper reports nothing that
            explains it.
        """
        self.moving = sample.moving or (self.moving and sample.t_ns <= self.sent_ns)
        self._shown = self._shown or sample.moving or bool(sample.fault) or not sample.active
        if self.goals_m is None or sample.moving or sample.t_ns <= self.sent_ns:
            return False
        arrived = width_m is not None and math.isclose(width_m, self._goal_m, abs_tol=ARRIVED_M)
        if arrived or self._shown or sample.t_ns - self.sent_ns > self._longest_begin_ns:
            self.goals_m = None
        if self._shown or self._from_m is None or width_m is None or sample.object != "none":
            return False
        stays = math.isclose(width_m, self._from_m, abs_tol=ARRIVED_M)
        far = abs(width_m - self._goal_m) > FAR * (range_m[1] - range_m[0])
        return stays and far and sample.t_ns - self._from_ns > self._longest_begin_ns
