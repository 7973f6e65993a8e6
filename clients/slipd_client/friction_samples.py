"""What several pulls say about friction: which agree, their median and spread, and the lines of the config."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

from slipd_client.friction_pull import PullSample

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
