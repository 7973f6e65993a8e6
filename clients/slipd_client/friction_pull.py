"""Finds pulls in the verdicts on one finger: an object in the grip is pulled until it slips.

The coefficient of static friction is the largest required friction before the slip, that of dynamic friction the level
at which it stays while the object slides. Knows no clock, socket or terminal: messages in, samples out.
"""

from __future__ import annotations

import itertools
import operator
import statistics
from collections import deque
from typing import Literal, NamedTuple, Union

from slipd_client.messages.names import SlipLevel
from slipd_client.messages.topics import Slip

STEADY_S = 0.3
"""A grip is ready when it was trusted and at rest for so long."""

LEAST_HZ = 40.0
"""Verdicts at a lower rate do not show the peak before a slip: a pull within a second needs some 40."""

ON_TIME = 0.9
"""Least share of LEAST_HZ that is counted at a rest: at that rate itself a few verdicts may come too late to count."""

BEFORE_S = 0.5
"""Longest time from the peak of the load to the verdict that shows the slip."""

SLIDE_S = 0.4
"""A slide is over when the required friction made no new peak for so long."""

CONFIRMED = 0.8
"""Least share of a peak that a reading beside it has: a pull takes longer than one reading, a disturbance may not."""

SETTLE_S = 0.02
"""From the peak to the plateau: the load falls within milliseconds, and verdicts come some milliseconds apart."""

LEAST_PLATEAU = 8
"""Readings from which the plateau follows."""

FLAT = 0.2
"""Largest spread of the plateau, between its quartiles and relative to its median."""

PULLED = 2.0
"""Load, as a multiple of that at rest, from which on a pull counts: one that ends below is not reported."""

LET_GO = 0.7
"""Share of the peak below which the pull has ended."""

QUICK_S = 0.15
"""Shortest pull from half of the peak to the peak: a jerk overshoots what static friction carries."""

SUDDEN = 0.15
"""Largest relative change of the squeeze around the peak."""
SUDDEN_S = 0.05
"""Time on either side of the peak for that."""

STRAIGHT = 0.8
"""Least share of the tangential force in the required friction: a turn depends on how the pressure is distributed."""

NOISY = 0.05
"""Largest relative standard deviation of the friction ratio."""

NO_CONTACT = "nothing touches the pad"

KEPT_S = 15.0
"""Readings are kept for so long: the slowest pull takes some seconds."""

GAP_S = 4.0 / LEAST_HZ
"""Between verdicts further apart than this an object may have slipped and stuck again unseen, however often they come
otherwise; at the lowest rate two may be missing."""

NOISE_STD = 3.0
"""Standard deviations of the friction ratio within which nobody pulls."""

NOT_A_FAULT = frozenset(
    {"translation", "rotation", "tipping", "slip_detected", "no_mu", "unsupportable", "rotation_unobserved"}
)
"""Reasons of a verdict with correct readings."""

Phase = Literal["grip", "pull", "slide", "release"]


class PullSample(NamedTuple):
    """Friction by one pull.

    Attributes:
        mu_s: Coefficient of static friction.
        mu_d: Coefficient of dynamic friction; None where it did not slide evenly.
        normal_n: Normal force at the slip.
    """

    mu_s: float
    mu_d: float | None
    normal_n: float


class _Reading(NamedTuple):
    t_s: float
    required: float
    ratio: float
    ratio_std: float
    normal_n: float


_required = operator.attrgetter("required")


class PullWatch:
    """Follows one finger from a grip at rest through a pull to the slip, and again.

    Attributes:
        phase: What it waits for: "grip" (a grip at rest), "pull" (the slip), "slide" (the end of the slide), "release"
            (the end of the pull).
        obstacle: Why the grip is not ready, NO_CONTACT where nothing is gripped; "" where nothing is wrong.
        normal_n: Normal force of the newest verdict; None where it is not known.
    """

    def __init__(self) -> None:
        self.phase: Phase = "grip"
        self.obstacle = NO_CONTACT
        self.normal_n: float | None = None
        self._readings: deque[_Reading] = deque()
        self._since_s = self._count = 0.0
        self._slow = ""
        self._onset_s = self._pulled_at = self._let_go_at = 0.0

    def add(self, slip: Slip) -> Union[PullSample, str, None]:
        """Add a verdict; return what a pull that ended with it gives: a sample, or why it gives none and what to do."""
        t_s = slip.t_ns * 1e-9
        self.normal_n = slip.normal_n
        obstacle = _obstacle(slip)
        if obstacle:
            return self._stop(obstacle)
        judged = self._stop_at_gap(t_s)
        self._keep(t_s, slip)
        self.obstacle = ""
        moves = slip.level == SlipLevel.SLIPPING or bool(slip.evidence)
        if self.phase == "grip":
            self._wait_for_rest(t_s, moves=moves)
        elif self.phase == "pull" and moves:
            self.phase, self._onset_s = "slide", t_s
        elif self.phase == "slide":
            peak = self._peak()
            if not moves or t_s - peak.t_s > SLIDE_S:
                self.phase, self._let_go_at = "release", LET_GO * peak.required
                return self._judge(peak)
        elif self.phase == "release" and not moves and self._readings[-1].required < self._let_go_at:
            self._begin()
        return judged

    def _begin(self) -> None:
        self.phase, self._since_s, self._count = "grip", 0.0, 0
        self._readings.clear()

    def _keep(self, t_s: float, slip: Slip) -> None:
        std = slip.friction_ratio_std or 0.0
        self._readings.append(
            _Reading(t_s, slip.required_friction or 0.0, slip.friction_ratio or 0.0, std, slip.normal_n or 0.0)
        )
        while self._readings[0].t_s < t_s - KEPT_S:
            self._readings.popleft()

    def _wait_for_rest(self, t_s: float, *, moves: bool) -> None:
        """Begin with the pull when nothing moved for a while, and verdicts come often enough."""
        self.obstacle = "the object moves in the grip" if moves else self._slow
        if moves or not self._since_s:
            self._since_s, self._count = t_s, 0
            return
        self._count += 1
        if t_s - self._since_s < STEADY_S:
            return
        rate_hz = self._count / (t_s - self._since_s)
        if rate_hz < ON_TIME * LEAST_HZ:
            self._slow = (
                f"its verdicts come at {rate_hz:.0f} Hz, and at least {LEAST_HZ:g} are needed: raise slip_hz in "
                "[rates], or the rate of the sensor where that is lower; on a busy machine, end other programs"
            )
            self._since_s, self._count = t_s, 0
            return
        self.phase, self.obstacle, self._slow = "pull", "", ""
        rest = min((each for each in self._readings if each.t_s >= self._since_s), key=_required)
        self._pulled_at = PULLED * rest.required + NOISE_STD * rest.ratio_std

    def _stop_at_gap(self, t_s: float) -> Union[PullSample, str, None]:
        """End the pull where verdicts are missing before ``t_s``."""
        gap_s = t_s - self._readings[-1].t_s if self._readings else 0.0
        if self.phase not in ("pull", "slide") or gap_s <= GAP_S:
            return None
        return self._stop(
            f"its verdicts were missing for {gap_s:.2f} s, as on a busy machine: pull again; where this happens often, "
            f"end other programs, or lower slip_hz in [rates] (to {LEAST_HZ:g} at least)"
        )

    def _stop(self, obstacle: str) -> Union[PullSample, str, None]:
        """End the pull at a verdict that cannot be used, or at a missing one.

        An object may slip unseen meanwhile. The next pull begins once the load has fallen below ``LET_GO``.
        """
        phase, self.obstacle = self.phase, obstacle
        judged: Union[PullSample, str, None] = None
        let_go_at = self._let_go_at
        if phase == "slide":
            peak = self._peak()
            judged, let_go_at = self._judge(peak), LET_GO * peak.required
        elif phase == "pull":
            let_go_at = self._pulled_at
            if self._readings[-1].required > let_go_at:
                judged = f"before it slipped: {obstacle}"
        if phase == "grip" or obstacle == NO_CONTACT:
            self._begin()
        else:
            self.phase, self._let_go_at = "release", let_go_at
        return judged

    def _peak(self) -> _Reading:
        """Return the reading with the largest required friction around the slip that one beside it confirms."""
        near = [reading for reading in self._readings if reading.t_s >= self._onset_s - BEFORE_S]
        pairs = [sorted(pair, key=_required) for pair in itertools.pairwise(near)]
        confirmed = [greater for less, greater in pairs if less.required >= CONFIRMED * greater.required]
        return max(confirmed or near, key=_required)

    def _judge(self, peak: _Reading) -> Union[PullSample, str]:
        """Return the sample of the pull that ended, or the reason why it gives none."""
        before = [reading for reading in self._readings if reading.t_s <= peak.t_s]
        around = [reading.normal_n for reading in self._readings if abs(reading.t_s - peak.t_s) <= SUDDEN_S]
        half = next((reading for reading in reversed(before) if reading.required <= 0.5 * peak.required), None)
        if peak.ratio_std > NOISY * peak.ratio:
            return f"{peak.normal_n:.1f} N is too light for the noise of the sensor: squeeze harder"
        if max(around) - min(around) > SUDDEN * peak.normal_n:
            return f"the squeeze changed from {min(around):.1f} to {max(around):.1f} N at the slip: pull along the pads"
        if half is not None and peak.t_s - half.t_s < QUICK_S:
            return f"the pull grew within {(peak.t_s - half.t_s) * 1e3:.0f} ms: pull more slowly"
        if peak.ratio < STRAIGHT * peak.required:
            return "the object was turned rather than pulled: pull in line with the middle of the pads"
        return PullSample(peak.required, self._plateau(peak), peak.normal_n)

    def _plateau(self, peak: _Reading) -> float | None:
        after = sorted(
            reading.required
            for reading in self._readings
            if reading.t_s >= peak.t_s + SETTLE_S and reading.required > 0.5 * peak.required
        )
        if len(after) < LEAST_PLATEAU:
            return None
        first, middle, last = statistics.quantiles(after, n=4)
        return min(middle, peak.required) if last - first <= FLAT * middle else None


def _obstacle(slip: Slip) -> str:
    """Return why a verdict cannot be used to measure friction; "" where it can."""
    faults = [reason for reason in slip.reasons if reason not in NOT_A_FAULT]
    if slip.level == SlipLevel.NO_CONTACT:
        return NO_CONTACT
    if faults:
        return f"its readings are not trusted ({', '.join(faults)}): see slipctl status"
    if slip.normal_n is None:
        return "its force is not known: see slipctl status"
    if slip.spin_nm is None:
        return "its sensor measures no torque, so that the load on the contact is not known"
    if slip.required_friction is None:
        return "slipd does not know the friction that the load requires: it needs an image of the pad"
    return ""
