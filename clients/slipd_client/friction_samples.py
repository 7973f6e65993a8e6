"""What several pulls say about friction: which agree, their median and spread, and the lines of the config."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

from slipd_client.friction_pull import PullSample

AGREE = 1.25
"""Largest ratio of two samples of one material: beyond it, something was different."""

ONE_SIGMA = {2: 1.84, 3: 1.32, 4: 1.20, 5: 1.14, 6: 1.11, 7: 1.09, 8: 1.08, 9: 1.07}
"""Student's t at one standard deviation (84.1 %), by the number of samples: few of them show too small a spread."""

MOST_SAMPLES = max(ONE_SIGMA)


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


def spread(group: Sequence[PullSample]) -> float | None:
    """Return the relative standard deviation to expect of the next grasp; None where one sample alone shows none."""
    values = [sample.mu_s for sample in group]
    if len(values) < 2:
        return None
    count = min(len(values), MOST_SAMPLES)
    wide = ONE_SIGMA[count] * math.sqrt(1.0 + 1.0 / count)
    return wide * statistics.stdev(values) / statistics.median(values)


def median_of(group: Sequence[PullSample]) -> PullSample:
    """Return the medians of a group; its dynamic friction by the samples that have one."""
    dynamic = [sample.mu_d for sample in group if sample.mu_d is not None]
    return PullSample(
        statistics.median(sample.mu_s for sample in group),
        statistics.median(dynamic) if dynamic else None,
        statistics.median(sample.normal_n for sample in group),
    )


def config_lines(finger: str, group: Sequence[PullSample]) -> list[str]:
    """Return the lines for the config of a finger, TOML."""
    found, wide = median_of(group), spread(group)
    pulls = "1 pull" if len(group) == 1 else f"{len(group)} pulls, {group[0].mu_s:.3f} to {group[-1].mu_s:.3f}"
    lines = [f"[finger.{finger}]", f"mu = {found.mu_s:.3f}  # {pulls}, with {found.normal_n:.1f} N on each pad"]
    if wide is not None:
        lines.append(f"mu_spread = {max(wide, 0.001):.3f}")
    return lines
