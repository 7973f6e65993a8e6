"""A million contacts of every family: is each answer certified, how tightly, and does the truth lie within?

Failures are counted and named by seed, never raised away. On a share of the scenes an independent solution to 25 digits
(:mod:`chart.reference`) is asked as well.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
from bench.tables import Table
from chart.reference import exact_limit, exact_utilisation
from chart.scenes import FAMILIES, Scene, draw
from numpy.typing import NDArray

from slipd.fusion import torque_limit, utilisation

SCENES, CHECKED = 1_000_000, 2_100
QUICK_SCENES, QUICK_CHECKED = 1_500, 15
CHUNK = 1_500
"""Scenes handed to a process at a time: a second or so."""

VERGE = 1e-14
"""Where 1 − ρ is smaller, the force alone is at its limit to all but rounding, and the honest bound is wider."""

CLOSE = 1e-9
"""Where 1 − ρ is computed exactly, for doubles tell nothing of 1e-14 there."""

WORST_GAP, MEDIAN_GAP = 1e-9, 1e-12
"""Wanted, of the contact's own torque, and of the utilisation."""

NAMED = 3
"""Seeds named in each family where something is to be seen."""

LONGEST_NAMES = 12


@dataclass(slots=True, repr=False)
class Answers:
    """What became of one question in the scenes of some seeds.

    Attributes:
        seeds: Shape (n,).
        gap: upper − lower, relative; inf where the answer is not certified.
        sound: Everything that is due is there and in order.
        verge: 1 − ρ is below VERGE.
        free: No finite answer is due: beyond the friction circle, or no grip holds it.
        checked: The reference was asked.
        inside: It lies within the bounds.
        error: |answer − reference|, relative.
    """

    seeds: NDArray[np.int64]
    gap: NDArray[np.float64]
    sound: NDArray[np.bool_]
    verge: NDArray[np.bool_]
    free: NDArray[np.bool_]
    checked: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    error: NDArray[np.float64]

    @classmethod
    def of(cls, seeds: Iterable[int]) -> Answers:
        numbers = np.array(list(seeds), np.int64)
        flags = [np.zeros(numbers.size, np.bool_) for _ in range(5)]
        return cls(numbers, np.zeros(numbers.size), *flags[:4], flags[4], np.zeros(numbers.size))

    @classmethod
    def joined(cls, parts: list[Answers]) -> Answers:
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__))

    def where(self, mask: NDArray[np.bool_]) -> Answers:
        return Answers(*(getattr(self, name)[mask] for name in self.__slots__))


@dataclass(slots=True, repr=False)
class Findings:
    """Both questions of the same scenes, and why single answers are not sound."""

    limit: Answers
    use: Answers
    reasons: dict[str, list[int]] = field(default_factory=dict)


def measure(seeds: Iterable[int], every: int) -> Findings:
    """Asks ours of the scenes of these seeds, and the reference of one round of the families in ``every``."""
    seeds = list(seeds)
    found = Findings(Answers.of(seeds), Answers.of(seeds))
    for n, seed in enumerate(seeds):
        scene = draw(seed)
        room = room_left(scene)
        check = (seed // len(FAMILIES)) % every == 0
        found.limit.verge[n] = found.use.verge[n] = room < VERGE
        limit = _limit(found, n, scene, room, check=check)
        _use(found, n, scene, limit, check=check)
    return found


def room_left(scene: Scene) -> float:
    """1 − ρ, exact where it is small."""
    fx, fy = scene.tangential.tolist()
    rough = 1.0 - math.hypot(fx, fy) / (scene.mu * math.fsum(scene.loads))
    if abs(rough) > CLOSE:
        return rough
    grip = Fraction(scene.mu) * sum(map(Fraction, scene.loads.tolist()))
    square = (Fraction(fx) ** 2 + Fraction(fy) ** 2) / grip**2
    return float((1 - square) / 2)  # (1 + ρ) / 2 = 1 − 1e-9


def _limit(found: Findings, n: int, scene: Scene, room: float, *, check: bool) -> float:
    """The torque limit of sense +1, of −1 in every other round; the contact's torque where there is none."""
    sense = 1 if found.limit.seeds[n] // len(FAMILIES) % 2 == 0 else -1
    answer = torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about, sense)
    scale = unit(scene)
    value, lower, upper = answer.torque_nm, answer.lower_nm, answer.upper_nm
    if room < 0.0:
        found.limit.free[n] = True
        reason = "" if math.isnan(value) or room > -VERGE else "a limit beyond the friction circle"
    else:
        reason = _disorder(value, lower, upper)
    gap = (upper - lower) / scale
    _note(found, found.limit, n, "torque limit: ", reason, 0.0 if room < 0.0 else gap)
    if check and room >= 0.0:
        exact = exact_limit(replace(scene, tangential=sense * scene.tangential))
        found.limit.checked[n], found.limit.inside[n] = True, lower <= exact <= upper
        found.limit.error[n] = abs(value - exact) / scale if math.isfinite(value) else math.inf
    return value if math.isfinite(value) else scale


def _use(found: Findings, n: int, scene: Scene, limit: float, *, check: bool) -> None:
    """Of a spin in either sense, within and beyond the limit."""
    seed = int(found.use.seeds[n])
    spin = np.random.default_rng((seed, 1)).uniform(-1.5, 1.5) * (abs(limit) or unit(scene))
    answer = utilisation(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, spin, scene.about)
    value, lower, upper = answer.value, answer.lower, answer.upper
    if np.ptp(scene.x) == 0.0 == np.ptp(scene.y):  # no grip holds a spin in one place
        found.use.free[n] = True
        reason = _disorder(value, lower, upper)
        gap = 0.0
    else:
        reason = _disorder(value, lower, upper) or ("" if math.isfinite(upper) else "no upper bound")
        gap = (upper - lower) / value if value else 0.0
    _note(found, found.use, n, "utilisation: ", reason, gap)
    if check:
        exact = exact_utilisation(scene, spin)
        found.use.checked[n], found.use.inside[n] = True, lower <= exact <= upper
        found.use.error[n] = 0.0 if value == exact else abs(value / exact - 1.0)


def unit(scene: Scene) -> float:
    """What torques are compared with: the contact's own; for a contact in one place, its grip times its reach."""
    if scene.torque_scale_nm > 0.0:
        return scene.torque_scale_nm
    return scene.mu * float(scene.loads.sum()) * float(np.hypot(scene.x[0], scene.y[0]))


def _disorder(value: float, lower: float, upper: float) -> str:
    """What is wrong with an answer's form; nothing, if nothing is."""
    if math.isnan(value):
        return "NaN where a number is due"
    if math.isnan(lower) or math.isnan(upper):
        return "a bound is missing"
    if lower > upper:
        return "lower bound above the upper"
    return "" if lower <= value <= upper else "the answer outside its bounds"


def _note(found: Findings, answers: Answers, n: int, question: str, reason: str, gap: float) -> None:
    answers.sound[n] = not reason
    answers.gap[n] = math.inf if reason else gap
    if reason:
        found.reasons.setdefault(question + reason, []).append(int(answers.seeds[n]))


def run(scenes: int = SCENES, checked: int = CHECKED, processes: int | None = None) -> Iterator[Table]:
    """Measures ``scenes`` scenes, at least ``checked`` of them against the reference, and tells of each question."""
    began_s = time.monotonic()
    found = _all(scenes, max(scenes // checked, 1), processes)
    took_min = (time.monotonic() - began_s) / 60.0
    told = f"Seeds 0 to {scenes - 1} of benchmarks/chart/scenes.py; {took_min:.1f} min."
    limit = _table("Torque limit certified", found.limit, "of the contact's own torque μ Σ F |r − centroid|")
    use = _table("Utilisation certified", found.use, "of the utilisation; spins from −1.5 to 1.5 of the limit")
    for table, answers, question in ((limit, found.limit, "torque limit"), (use, found.use, "utilisation")):
        table.notes += [told, *_seeds(found, answers, question)]
        yield table


def _all(scenes: int, every: int, processes: int | None) -> Findings:
    chunks = [(range(begin, min(begin + CHUNK, scenes)), every) for begin in range(0, scenes, CHUNK)]
    ignored = signal.SIGINT, signal.SIG_IGN  # an interrupt ends the pool from the parent
    with multiprocessing.get_context("spawn").Pool(processes, signal.signal, ignored) as pool:
        parts = pool.starmap(measure, chunks, chunksize=1)
    found = Findings(Answers.joined([part.limit for part in parts]), Answers.joined([part.use for part in parts]))
    for part in parts:
        for reason, seeds in part.reasons.items():
            found.reasons.setdefault(reason, []).extend(seeds)
    return found


def _table(title: str, answers: Answers, measure_of: str) -> Table:
    head = ("family", "scenes", "uncertified", "gap median", "gap p99", "gap worst", "at the verge", "their worst gap",
            "checked", "outside", "worst error")  # fmt: skip
    table = Table(f"{title}: {answers.seeds.size} scenes", head)
    family = answers.seeds % len(FAMILIES)
    for number, name in enumerate(FAMILIES):
        table.rows.append((name, *_row(answers.where(family == number))))
    table.rows.append(("all", *_row(answers)))
    median, _, worst = _gaps(answers.where(~answers.verge & ~answers.free))
    missed = int((answers.checked & ~answers.inside).sum())
    uncertified = int((~answers.sound).sum())
    reached = uncertified == missed == 0 and worst <= WORST_GAP and median <= MEDIAN_GAP
    table.notes += [
        f"Gap and error: {measure_of}. At the verge: 1 − ρ below {VERGE:g}. Checked: against mpmath, to 25 digits.",
        f"Wanted but at the verge: 0 uncertified, 0 outside, gaps at most {WORST_GAP:g}, {MEDIAN_GAP:g} in the median; "
        f"found {uncertified}, {missed}, {worst:.1e} and {median:.1e}: {'reached' if reached else 'NOT REACHED'}.",
    ]
    return table


def _row(answers: Answers) -> tuple[int | str, ...]:
    gaps = _gaps(answers.where(~answers.verge & ~answers.free))
    verge = answers.where(answers.verge & ~answers.free)
    outside = int((answers.checked & ~answers.inside).sum())
    return (
        answers.seeds.size,
        int((~answers.sound).sum()),
        *(f"{gap:.1e}" for gap in gaps),
        verge.seeds.size,
        f"{_gaps(verge)[2]:.1e}",
        int(answers.checked.sum()),
        outside,
        f"{answers.error.max(initial=0.0):.1e}",
    )


def _gaps(answers: Answers) -> tuple[float, float, float]:
    """Median, p99, worst of those that are certified at all."""
    gap = answers.gap[answers.sound]
    if not gap.size:
        return 0.0, 0.0, 0.0
    return float(np.median(gap)), float(np.percentile(gap, 99)), float(gap.max())


def _seeds(found: Findings, answers: Answers, question: str) -> list[str]:
    """Where to look."""
    notes = [
        f"{reason.removeprefix(question + ': ').capitalize()}: {len(seeds)} scenes, seeds {_listed(seeds)}."
        for reason, seeds in found.reasons.items()
        if reason.startswith(question)
    ]
    outside = answers.seeds[answers.checked & ~answers.inside].tolist()
    if outside:
        notes.append(f"The reference lies outside the bounds: seeds {_listed(outside)}.")
    wide = answers.where(answers.sound & ~answers.verge & ~answers.free & (answers.gap > WORST_GAP))
    wide_families = wide.seeds % len(FAMILIES)
    for number, name in enumerate(FAMILIES):
        own = wide.where(wide_families == number)
        if own.seeds.size:
            worst = own.seeds[np.argsort(-own.gap)][:NAMED].tolist()
            notes.append(f"{name}: {own.seeds.size} gaps above {WORST_GAP:g}, the widest at seeds {_listed(worst)}.")
    return notes


def _listed(seeds: list[int]) -> str:
    return ", ".join(map(str, seeds[:LONGEST_NAMES])) + (" …" if len(seeds) > LONGEST_NAMES else "")
