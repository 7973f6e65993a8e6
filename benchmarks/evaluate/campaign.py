"""Every run that the report is made of, and the results by what they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from evaluate.families import EVALUATION, FAMILIES, draw
from evaluate.running import FACTORS, Result, Task, Variant, run_all
from evaluate.score import RunScore
from evaluate.summary import Summary, summarise
from evaluate.user_errors import ERRORS

FORESEEN = ("ramp", "pour", "torsion", "combined", "loosen", "edge", "few taxels", "far pole", "partial slip")
"""Families whose slips come slowly enough to be warned of."""

CREEPING = ("creep", "flat creep")
SLIPPING_FAMILIES = (*FORESEEN, *CREEPING, "sudden weight", "wet patch", "second slip")
HOLDING = tuple(name for name in FAMILIES if name not in SLIPPING_FAMILIES)
QUIET = ("hold", "shake", "vibrate", "collide")
"""Families in which "slipping" must never be reported."""

STICKY = 0.86
"""Above this μ_d / μ_s the fall of the load is small, and the figures asked for are wider."""

ERROR_FAMILIES = ("hold", "shake", "ramp", "combined", "torsion", "loosen")
FIXED = "mu_spread = 0.0"
"""Line of the config with which no μ is learned."""

MAIN = (*(Variant(factor) for factor in FACTORS), Variant(None))
ERRONEOUS = tuple(Variant(1.0, error=name) for name in ERRORS)
UNLEARNED = tuple(Variant(factor, finger_lines=FIXED) for factor in (0.8, 1.0, 1.2))


@dataclass
class Campaign:
    """Results of the report's runs.

    Attributes:
        results: All of them.
        seeds: Grasps of each family.
    """

    results: list[Result]
    seeds: int

    def scores(
        self, families: Iterable[str], *variants: Variant, where: Callable[[Result], bool] = lambda _: True
    ) -> list[RunScore]:
        """Return the scores of some families with some configs."""
        names, wanted = set(families), set(variants)
        return [one.score for one in self.results if one.family in names and one.variant in wanted and where(one)]

    def summary(
        self, families: Iterable[str], *variants: Variant, where: Callable[[Result], bool] = lambda _: True
    ) -> Summary:
        """Return their figures."""
        return summarise(self.scores(families, *variants, where=where))


def tasks(seeds: int, first: int = EVALUATION.start) -> list[Task]:
    """Return every run: seed by seed, so that the first ones are of all families."""
    return [Task(family, seed, _variants(family)) for seed in range(first, first + seeds) for family in FAMILIES]


def _variants(family: str) -> tuple[Variant, ...]:
    extra = ERRONEOUS if family in ERROR_FAMILIES else ()
    return (*MAIN, *extra, *(UNLEARNED if family in SLIPPING_FAMILIES else ()))


def run_campaign(seeds: int, workers: int, told: Callable[[int, int], bool]) -> Campaign:
    """Run everything, seed by seed.

    Args:
        seeds: Most grasps of each family.
        workers: Processes.
        told: Hears how many seeds are done, and of how many; returns whether to go on.
    """
    results: list[Result] = []
    for done in range(seeds):
        results += run_all(tasks(1, EVALUATION.start + done), workers)
        if not told(done + 1, seeds):
            break
    return Campaign(sorted(results, key=lambda one: (one.family, one.seed)), done + 1)


@cache
def ratio(family: str, seed: int) -> float:
    """Return μ_d / μ_s of a grasp."""
    friction = draw(family, seed).friction
    return friction.mu_d / friction.mu_s


def is_sticky(result: Result) -> bool:
    """Return whether the load of a grasp hardly falls when it slides."""
    return ratio(result.family, result.seed) > STICKY


def factor_name(variant: Variant) -> str:
    """Return how a table calls the μ of a config."""
    return "none" if variant.factor is None else f"{variant.factor:.1f}"


def by_variant(campaign: Campaign, families: Sequence[str], get: Callable[[Summary], float]) -> list[float]:
    """Return one figure of some families for every config of `MAIN`."""
    return [get(campaign.summary(families, variant)) for variant in MAIN]
