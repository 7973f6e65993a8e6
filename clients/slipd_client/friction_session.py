"""Leads through the pulls of a friction measurement. Knows no terminal, socket or clock: verdicts in, lines out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Optional

from slipd_client.elapsed_time import ElapsedTime
from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_pull import NO_CONTACT, PullRejected, PullSample, PullWatch
from slipd_client.friction_samples import agreeing, disagreement
from slipd_client.messages import slip_topic
from slipd_client.messages.schema.topics import Slip

OBSTACLE_S = 3.0
"""An obstacle that lasts for so long without a break does not vanish by itself, s."""

GRIP_IT = "Grip a sample of the object, for example with: slipctl grip close 10"

MOST_PULLS = 4
"""Pulls for each sample that is wanted: beyond it the samples do not agree, and something else is wrong."""

MOST_REJECTED = 8
"""Pulls in a row that do not count: beyond it a person would pull for ever."""

LONGEST = 3.0
"""Times the patience without a sample: where disturbances come again and again, it ends with their reason."""


class FrictionSession:
    """Asks for pulls until enough of them agree.

    Args:
        fingers: Names of the fingers to measure.
        samples: Samples that must agree.
        patience_s: How long to wait for a grip, and for each pull, s.
        say: Takes each line for the person.
        grip_it: What is said while nothing presses on the pads.
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
        self._watches = {finger: PullWatch() for finger in fingers}
        self._samples: dict[str, list[PullSample]] = {finger: [] for finger in fingers}
        self._asked = ""
        self._time = ElapsedTime()
        self._since_s = self._sample_s = self._blocked_s = 0.0
        self._rejected = dict.fromkeys(fingers, 0)
        self._disturbed = ""

    @property
    def topics(self) -> list[str]:
        """Topics whose messages it needs."""
        return [slip_topic(finger) for finger in self._watches]

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
        """Continue after a FrictionNotMeasured whose cause is removed; samples that do not agree are dropped."""
        self._asked = ""
        self._since_s = self._sample_s = self._time.passed_s
        self._blocked_s, self._rejected, self._disturbed = 0.0, dict.fromkeys(self._rejected, 0), ""
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
        if isinstance(found, PullRejected):
            self._reject(finger, f"{finger}: not counted, {found.reason}")
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
            why = "; ".join(f"finger {finger}: {each}" for finger, each in obstacles.items()) or "it did not slip"
            raise FrictionNotMeasured(f"nothing more was measured for {self._patience_s:g} s: {why}")
