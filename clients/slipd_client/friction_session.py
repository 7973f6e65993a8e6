"""Leads through the pulls of a friction measurement. Knows no terminal, socket or clock: verdicts in, lines out."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from typing import Optional

from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_pull import NO_CONTACT, PullSample, PullWatch
from slipd_client.messages.topics import Slip

LONGEST_STEP_S = 0.5
"""Largest step that counts, s: in a longer gap, such as a stall of the machine, nothing is seen and nobody can act."""


class ElapsedTime:
    """Time that passed by the times of messages.

    Messages of different topics arrive out of order, and those of a stale stream are old. Time advances only with a
    message that is newer than all before it.

    Attributes:
        passed_s: Time since the first message, s, with every step cut to ``LONGEST_STEP_S``.
    """

    def __init__(self) -> None:
        self.passed_s = 0.0
        self._newest_s: Optional[float] = None

    def update(self, now_s: float) -> float:
        """Update with the time of a message, s of any clock; return ``passed_s``."""
        newest_s = self._newest_s
        if newest_s is None:
            self._newest_s = now_s
        elif now_s > newest_s:
            self._newest_s = now_s
            self.passed_s += min(now_s - newest_s, LONGEST_STEP_S)
        return self.passed_s


AGREE = 1.25
"""Largest ratio of two samples of one material: beyond it, something was different."""

SCATTER = 0.05
"""Relative standard deviation of static friction between pulls of one pair of materials, as it usually is."""

SCATTER_WEIGHT = 2
"""Degrees of freedom for which that counts: three pulls of the same spread count as much."""

ONE_SIGMA = {2: 1.321, 3: 1.197, 4: 1.142, 5: 1.111, 6: 1.091, 7: 1.077, 8: 1.067, 9: 1.059, 10: 1.053}
"""Student's t at one standard deviation (84.1 %), by the degrees of freedom."""

MOST_SAMPLES = max(ONE_SIGMA) - SCATTER_WEIGHT + 1


def agreeing(samples: Sequence[PullSample]) -> list[PullSample]:
    """Return the largest group of samples that agree, in the order of their coefficients; of two, the closer one."""
    ordered = sorted(samples)
    groups = [
        ordered[first:last]
        for first in range(len(ordered))
        for last in range(first + 1, len(ordered) + 1)
        if ordered[last - 1].mu_s <= AGREE * ordered[first].mu_s
    ]
    return max(groups, key=lambda group: (len(group), -group[-1].mu_s / group[0].mu_s), default=[])


def disagreement(sample: PullSample, group: Sequence[PullSample]) -> str:
    """Return why a sample is left out, for people; "" where it is one of the group."""
    if sample in group:
        return ""
    others = statistics.median(each.mu_s for each in group)
    return f"{sample.mu_s:.3f} is {abs(sample.mu_s / others - 1.0):.0%} from the others, {others:.3f}"


def spread(group: Sequence[PullSample]) -> float:
    """Return the relative standard deviation to expect of the next pull.

    A few pulls that agree by chance show too small a spread, so what is usual counts too.
    """
    values = [sample.mu_s for sample in group]
    middle, freedom = statistics.median(values), len(values) - 1 + SCATTER_WEIGHT
    squares = sum((value / middle - 1.0) ** 2 for value in values) + SCATTER_WEIGHT * SCATTER**2
    wide = ONE_SIGMA[min(freedom, max(ONE_SIGMA))] * math.sqrt(1.0 + 1.0 / len(values))
    return wide * math.sqrt(squares / freedom)


def median_of(group: Sequence[PullSample]) -> PullSample:
    """Return the medians of a group; its dynamic friction by the samples that have one."""
    dynamic = [sample.mu_d for sample in group if sample.mu_d is not None]
    return PullSample(
        statistics.median(sample.mu_s for sample in group),
        statistics.median(dynamic) if dynamic else None,
        statistics.median(sample.normal_n for sample in group),
    )


def low_estimate(group: Sequence[PullSample]) -> float:
    """Return the coefficient that the config wants: the median of the pulls less one deviation."""
    return median_of(group).mu_s * (1.0 - spread(group))


def config_lines(finger: str, group: Sequence[PullSample]) -> list[str]:
    """Return the lines for the config of a finger, TOML."""
    found, wide = median_of(group), spread(group)
    pulls = "1 pull" if len(group) == 1 else f"{len(group)} pulls, {group[0].mu_s:.3f} to {group[-1].mu_s:.3f}"
    return [
        f"[finger.{finger}]",
        f"mu = {low_estimate(group):.3f}  # low estimate of {pulls}, with {found.normal_n:.1f} N on each pad",
        f"mu_spread = {wide:.3f}  # relative standard deviation",
    ]


OBSTACLE_S = 3.0
"""An obstacle that lasts for so long without a break does not vanish by itself, s."""

GRIP_IT = "Grip a sample of the object, for example with: slipctl grip close 10"

NO_SLIP = "it did not slip, or noise hides it: squeeze harder"

MOST_PULLS = 4
"""Pulls for each sample that is wanted: beyond it the samples do not agree, and something else is wrong."""

MOST_REJECTED = 8
"""Pulls in a row that do not count: beyond it a person would pull for ever."""

LONGEST = 3.0
"""Multiple of the patience: a measurement without a sample for so long ends with the reason of the last disturbance."""


class FrictionSession:
    """Asks for pulls until enough of them agree.

    Args:
        fingers: Names of the fingers to measure.
        samples: Samples that must agree.
        patience_s: How long to wait for a grip, and for each pull, s.
        say: Takes each line for the person.
        grip_it: Line for the person while nothing presses on the pads.
    """

    def __init__(
        self,
        fingers: Sequence[str],
        samples: int,
        patience_s: float,
        say: Callable[[str], None],
        grip_it: str = GRIP_IT,
    ) -> None:
        self._wanted, self._patience_s, self._say_line, self._grip_it = samples, patience_s, say, grip_it
        self._samples: dict[str, list[PullSample]] = {finger: [] for finger in fingers}
        self._time = ElapsedTime()
        self._begin()

    def _begin(self) -> None:
        """Wait until every finger grips at rest; the time limit starts again."""
        self._watches = {finger: PullWatch() for finger in self._samples}
        self._since_s = self._sample_s = self._time.passed_s
        self._blocked_s, self._rejected = 0.0, dict.fromkeys(self._samples, 0)
        self._asked = self._disturbed = ""

    @property
    def done(self) -> bool:
        """Every finger has enough samples."""
        return all(len(agreeing(samples)) >= self._wanted for samples in self._samples.values())

    @property
    def counted(self) -> int:
        """Number of samples so far."""
        return sum(map(len, self._samples.values()))

    @property
    def results(self) -> dict[str, list[PullSample]]:
        """Samples that agree, of each finger that has enough."""
        groups = {finger: agreeing(samples) for finger, samples in self._samples.items()}
        return {finger: group for finger, group in groups.items() if len(group) >= self._wanted}

    def resume(self) -> None:
        """Continue after a FrictionNotMeasured whose cause is removed; samples that do not agree are dropped.

        What happened meanwhile was not followed, so every finger waits for a grip at rest first.
        """
        self._begin()
        for samples in self._samples.values():
            if len(samples) >= MOST_PULLS * self._wanted:
                group = agreeing(samples)
                first = (len(group) - self._wanted) // 2
                samples[:] = group[first : first + self._wanted] if first >= 0 else []

    def advance(self, slip: Optional[Slip], now_s: float) -> None:
        """Take the next verdict, None if none came, and say what to do next.

        Args:
            slip: The verdict.
            now_s: Time by any clock, or of any message, s; see `ElapsedTime`.

        Raises:
            FrictionNotMeasured: Nothing touched, nothing slipped, or the samples do not agree.
        """
        before_s = self._time.passed_s
        passed_s = self._time.update(now_s)
        if slip is not None and slip.finger in self._watches:
            self._add(slip, passed_s)
        if not self.done:
            self._ask(passed_s)
            self._check_patience(passed_s, passed_s - before_s)

    def _add(self, slip: Slip, now_s: float) -> None:
        finger, found = slip.finger, self._watches[slip.finger].add(slip)
        if found is None:
            return
        self._since_s = now_s
        if isinstance(found, str):
            self._reject(finger, f"{finger}: not counted, {found}")
            return
        self._sample_s, self._rejected[finger] = now_s, 0
        samples = self._samples[finger]
        samples.append(found)
        dynamic = "no even slide" if found.mu_d is None else f"{found.mu_d:.3f} while it slides"
        self._say_line(f"  {finger}: slips at {found.mu_s:.3f}, {dynamic}, {found.normal_n:.1f} N")
        for sample in samples:
            if why := disagreement(sample, agreeing(samples)):
                self._say_line(f"  {finger}: not counted, {why}")
        if len(samples) >= MOST_PULLS * self._wanted and not self.done:
            self._give_up(finger)

    def _give_up(self, finger: str) -> None:
        """Give up after too many samples of a finger."""
        samples = self._samples[finger]
        if len(agreeing(samples)) < self._wanted:
            seen = ", ".join(f"{sample.mu_s:.3f}" for sample in samples)
            raise FrictionNotMeasured(f"the samples of finger {finger} do not agree: {seen}")
        others = ", ".join(name for name in self._samples if name not in self.results)
        raise FrictionNotMeasured(
            f"{len(samples)} pulls slipped on finger {finger}, and too few on finger {others}: pull at the middle of "
            "the pads"
        )

    def _reject(self, finger: str, line: str) -> None:
        """Say why a pull does not count; give up after many in a row."""
        self._say_line(f"  {line}")
        self._disturbed = line
        self._rejected[finger] += 1
        if self._rejected[finger] >= MOST_REJECTED:
            raise FrictionNotMeasured(f"{MOST_REJECTED} pulls in a row gave nothing. The last, {line}")

    def _ask(self, now_s: float) -> None:
        """Say what to do next, once."""
        phases = {watch.phase for watch in self._watches.values()}
        if phases == {"pull"}:
            forces = ", ".join(f"{finger} {watch.normal_n:.1f} N" for finger, watch in self._watches.items())
            number = min(len(agreeing(samples)) for samples in self._samples.values()) + 1
            self._say(f"Pull slowly along the pads until it slips, {number} of {self._wanted} ({forces}).", now_s)
        elif all(watch.obstacle == NO_CONTACT for watch in self._watches.values()):
            self._say(self._grip_it, now_s)
        elif any(watch.phase == "release" and not watch.obstacle for watch in self._watches.values()):
            self._say("Let go of it.", now_s)

    def _say(self, text: str, now_s: float) -> None:
        what = text.partition("(")[0]
        if what != self._asked:
            self._asked, self._since_s = what, now_s
            self._say_line(text)

    def _check_patience(self, now_s: float, step_s: float) -> None:
        """Give up where nothing happens any more, or an obstacle was there at every step for OBSTACLE_S."""
        obstacles = {finger: watch.obstacle for finger, watch in self._watches.items() if watch.obstacle}
        real = {finger: why for finger, why in obstacles.items() if why != NO_CONTACT}
        self._blocked_s = self._blocked_s + step_s if real else 0.0
        if self._blocked_s > OBSTACLE_S:
            finger, why = next(iter(real.items()))
            raise FrictionNotMeasured(f"finger {finger}: {why}")
        if real:
            self._disturbed = "; ".join(f"finger {finger}: {why}" for finger, why in real.items())
        if now_s - self._sample_s > LONGEST * self._patience_s and self._disturbed:
            raise FrictionNotMeasured(
                f"no pull counted for {LONGEST * self._patience_s:g} s, because the readings were disturbed again and "
                f"again. The last time, {self._disturbed}"
            )
        if now_s - self._since_s > self._patience_s:
            why = "; ".join(f"finger {finger}: {each}" for finger, each in obstacles.items()) or NO_SLIP
            raise FrictionNotMeasured(f"nothing more was measured for {self._patience_s:g} s: {why}")
