"""What the readings of a gripper show: faults, and the motions that it was commanded.

Faults are those that it reports, wrong echoes and forces, lost commands and lost activations; of a motion, where the
fingers may be going, and whether they ignore it.
"""

from __future__ import annotations

import math

from slipd.types.samples import GripperSample

ECHO_READINGS = 3
"""Wrong echoes in a row that count as a mismatch: a reading that crosses a command still echoes the previous one."""

FORCE_NS, FORCE_FACTOR, FORCE_N = 200_000_000, 3.0, 5.0
"""A gripper that holds cannot exert so much more than it was ever sent in this grip, for so long: an impact is shorter,
and a motor current shows the force only roughly."""

ACTIVATION_NS = 1_000_000_000
"""After this time without an inactive reading an activation was immediate, or never happened."""

COMMAND_LOST = "command_lost"
LINK_LOST = "link_lost"
NO_ANSWER = "no_answer"
ECHO_MISMATCH = "echo_mismatch"
FORCE_MISMATCH = "force_mismatch"
MOTION_IGNORED = "motion_ignored"
ACTIVATION_LOST = "activation_lost"


class GripperFaultDetector:
    """Reports each fault once, when it begins; a fault that was reported again and again could not be acknowledged."""

    def __init__(self) -> None:
        self._fault = ""
        self._wrong_echoes = 0
        self._most_n = 0.0  # sent in this grip
        self._strong_ns = 0  # since when every reading has reported far more; 0: the last one has not
        self._active = False
        self._activation = ""  # "requested", then "under way" from the first inactive reading to the next active one
        self._requested_ns = 0

    def forget(self) -> None:
        """Forget the activation state: the gripper does not answer, so a later reading decides whether it is active."""
        self._active, self._activation = False, ""

    def activate(self, t_ns: int) -> None:
        """Record a requested activation: until it is done, the gripper is inactive and its reports do not count."""
        self._activation, self._requested_ns = "requested", t_ns

    def acknowledge(self) -> None:
        """Record an acknowledgement: an echo or a force that is still wrong is reported again.

        A lost command and a fault of the gripper itself are not reported again. They last until a later command or
        activation, which must be possible.
        """
        self._wrong_echoes = self._strong_ns = 0

    def update(self, sample: GripperSample, sent_n: float | None) -> str:
        """Update with a reading; return the fault that begins with it, or "".

        Args:
            sample: The reading.
            sent_n: Force that the grip in force was sent last, N; None without a grip.
        """
        if self._activation == "requested" and not sample.active:
            self._activation, self._fault = "under way", ""
        elif sample.active and (self._activation == "under way" or sample.t_ns - self._requested_ns > ACTIVATION_NS):
            self._activation = ""
        self._wrong_echoes = self._wrong_echoes + 1 if sample.echo_ok is False else 0
        self._most_n = 0.0 if sent_n is None else max(self._most_n, sent_n)
        holds = sent_n is not None and sample.object.startswith("contact") and not sample.moving
        strong = holds and (sample.force_n or 0.0) > FORCE_FACTOR * self._most_n + FORCE_N
        self._strong_ns = (self._strong_ns or sample.t_ns) if strong else 0
        began = "" if self._activation == "under way" else self._begun(sample)
        self._fault, self._active = sample.fault, sample.active
        return began

    def _begun(self, sample: GripperSample) -> str:
        if sample.fault and sample.fault != self._fault:
            return sample.fault
        if self._wrong_echoes == ECHO_READINGS:
            return ECHO_MISMATCH
        if self._active and not sample.active:
            return ACTIVATION_LOST
        return FORCE_MISMATCH if self._strong_ns and sample.t_ns - self._strong_ns >= FORCE_NS else ""


LONGEST_BEGIN_NS, BEGIN_PERIODS = 1_000_000_000, 3.0
"""A motion that no reading has shown within this time, or three of the gripper's periods, has ended, or never began."""

ARRIVED_M = 5e-4
"""Fingers this close to their goal have arrived, m; a motion that takes them no farther cannot be seen."""

STILL_NS = 3_000_000_000
"""Fingers that stay where they are for so long do not move, whatever the gripper reports: none is so slow."""

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
        still_ns: Since when the gripper reports that the fingers move, while they stay where they are.
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
        self.sent_ns = self._from_ns = self.still_ns = 0
        self._still_m = math.nan
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
        if not (sample.moving and width_m is not None and math.isclose(width_m, self._still_m, abs_tol=ARRIVED_M)):
            self._still_m, self.still_ns = math.nan if width_m is None else width_m, sample.t_ns
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
