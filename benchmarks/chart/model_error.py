"""Errors that no solver can remove: of the image, the load rule and the contact model, against the continuous contact.

A contact with a pressure at every point is read by the pad (8 × 16 electrodes of 1.5 mm at 3.2 mm, 5 % gain noise, a
centroid wrong by 0.1 mm). Each load rule and each model makes a torque limit of that, and the continuous contact has
the true one. Where the image's own error is the larger, an exact model of it brings nothing, and the report says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from bench.tables import Table
from chart.continuous import SHAPES, image
from numpy.typing import NDArray

from slipd.fusion import binary_loads, grey_loads, matched_loads, torque_limit, utilisation
from slipd.types.arrays import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

Key = tuple[str, str]  # load rule and model, or load rule and stage

MU, NORMAL_N = 0.5, 10.0  # nothing depends on them: every error is a share of the contact's own torque
GAIN_NOISE, CENTROID_NOISE_M = 0.05, 1e-4  # σ of each taxel's gain, and of each axis of the centroid
RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99)  # ρ; one more is drawn over the circle's area
RANDOM = len(RATIOS)
LIMITS = (0.05, 0.5, 0.95)
SHOWN = (0.0, 0.3, 0.5, 0.7, 0.9, 0.99)
CONTACTS, QUICK_CONTACTS = 150, 4  # of each shape
PASSES = 20  # bring the bounds of the continuous contact within 1e-8 of its torque; what is left is rounding
RULES = ("grey", "binary", "matched")
MODELS = ("exact", "ellipsoid", "translation")
EXACT, CHEAP, OWN = ("matched", "exact"), ("matched", "ellipsoid"), ("continuous", "ellipsoid")
STAGES = ("sampling alone", "and gain noise", "and centroid error")
SIZES = ((1, 3), (4, 7), (8, 15), (16, 128))  # taxels in contact
ENOUGH = 1.25  # a model is enough while neither the median nor the 95th percentile of the error grows by a quarter


@dataclass(frozen=True, slots=True, eq=False)
class ModelError:
    """Errors and readings of every contact; first axis the shapes in the order of ``SHAPES``, second the contacts.

    Attributes:
        errors: By rule and model, shape (shapes, contacts, ratios): limit less the true one, both about the measured
            centroid, as a share of the contact's own torque; > 0 overstates. Rule "continuous": the model on the true
            pressure. NaN where no electrode is touched.
        readings: By rule and model, likewise: the utilisation read where the truth is 1.
        stages: By rule and stage of noise, shape (shapes, contacts): errors of the exact model at the last ratio.
        taxels: Taxels in contact, shape (shapes, contacts).
    """

    errors: dict[Key, Array]
    readings: dict[Key, Array]
    stages: dict[Key, Array]
    taxels: NDArray[np.int64]

    def draw(self, figure: Figure | SubFigure) -> None:
        """Fills a Figure or SubFigure of about 2 : 1 (1600 × 850): a column a shape, three rows."""
        from chart.model_error_panel import draw  # needs matplotlib, which the figures do not

        draw(self, figure)

    def tables(self) -> list[Table]:
        """By size with the statement of what is enough, by shape, the readings at the limit, and where errors arise."""
        return [_by_size(self), _by_shape(self), _at_the_limit(self), _by_stage(self)]


def run(quick: bool) -> ModelError:
    """Asks every rule and model about ``CONTACTS`` contacts of each shape, or about a few."""
    count = QUICK_CONTACTS if quick else CONTACTS
    keys = [(rule, model) for rule in RULES for model in MODELS]
    size = (len(SHAPES), count)
    found = ModelError(
        {key: np.full((*size, RANDOM + 1), np.nan) for key in [*keys, OWN]},
        {key: np.full((*size, RANDOM + 1), np.nan) for key in keys},
        {(rule, stage): np.full(size, np.nan) for rule in RULES for stage in STAGES},
        np.zeros(size, dtype=np.int64),
    )
    for at in np.ndindex(size):
        _ask(found, at)
    return found


def _ask(found: ModelError, at: tuple[int, ...]) -> None:
    """Fills in contact ``at``."""
    rng = np.random.default_rng(at)
    patch = list(SHAPES.values())[at[0]](rng)
    px, py, share = patch.points()
    whole = _Pressed(px, py, NORMAL_N * share)
    x, y, clean = image(patch)
    x, y, clean = (a[clean > 0.0] for a in (x, y, clean))
    found.taxels[at] = x.size
    noisy = clean * rng.normal(1.0, GAIN_NOISE, x.size).clip(0.5)
    centre = whole.centre()
    measured = centre + rng.normal(0.0, CENTROID_NOISE_M, 2)
    rules = _loads(x, y, noisy, measured) if x.size else {}
    ratios = np.append(RATIOS, math.sqrt(rng.random()))
    angles = rng.uniform(0.0, 2.0 * math.pi, ratios.size)
    forces = MU * NORMAL_N * ratios[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    own = whole.arm(centre)
    true = np.array([whole.limit(force, centre) for force in forces])
    found.errors[OWN][at] = np.sqrt(1.0 - ratios**2) - true / own
    felt = [limit - moment(measured - centre, force) for limit, force in zip(true.tolist(), forces, strict=True)]
    for rule, pressed in rules.items():
        for k, (ratio, force) in enumerate(zip(ratios.tolist(), forces, strict=True)):
            answers = _answers(pressed, ratio, force, felt[k], measured)
            for model, (limit, reads) in zip(MODELS, answers, strict=True):
                found.errors[rule, model][(*at, k)] = (limit - felt[k]) / own
                found.readings[rule, model][(*at, k)] = reads
    for stage, pressure, about in zip(STAGES, (clean, noisy, noisy), (centre, centre, measured), strict=True):
        for rule, pressed in (_loads(x, y, pressure, about) if rules else {}).items():
            error = pressed.limit(forces[-1], about) - true[-1] + moment(about - centre, forces[-1])
            found.stages[rule, stage][at] = error / own


def moment(arm: Array, force: Array) -> float:
    """arm × force, N·m: by so much a torque is smaller when taken about a point that lies further on by ``arm``."""
    return float(arm[0] * force[1] - arm[1] * force[0])


def _answers(pressed: _Pressed, ratio: float, force: Array, true: float, about: Array) -> list[tuple[float, float]]:
    """Limit and reading of the true limit, of each of ``MODELS``."""
    arm = pressed.arm(about)
    used = utilisation(pressed.x, pressed.y, pressed.loads, MU, force, true, about).value
    return [
        (pressed.limit(force, about), used),
        (arm * math.sqrt(1.0 - ratio * ratio), math.hypot(ratio, true / arm) if arm > 0.0 else math.inf),
        (math.inf, ratio),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Pressed:
    """Points and the loads on them, Σ = NORMAL_N: of the contact itself or of its image."""

    x: Array
    y: Array
    loads: Array

    def centre(self) -> Array:
        return np.array((self.loads @ self.x, self.loads @ self.y)) / NORMAL_N

    def arm(self, about: Array) -> float:
        """μ Σ F |r − about| for the normal force, N·m: the contact's own torque, and the ellipsoid's."""
        return MU * float(self.loads @ np.hypot(self.x - about[0], self.y - about[1]))

    def limit(self, force: Array, about: Array) -> float:
        return torque_limit(self.x, self.y, self.loads, MU, force, about, passes=PASSES).torque_nm


def _loads(x: Array, y: Array, pressure: Array, centroid: Array) -> dict[str, _Pressed]:
    found = (
        grey_loads(pressure, NORMAL_N),
        binary_loads(x, y, NORMAL_N, centroid),
        matched_loads(x, y, pressure, NORMAL_N, centroid),
    )
    return {rule: _Pressed(x, y, shared.loads) for rule, shared in zip(RULES, found, strict=True)}


def quantile(values: Array, q: float) -> float:
    """A value that occurs, so that an infinite one stays one; NaN of none. NaNs are left out."""
    known = values[~np.isnan(values)]
    return float(np.quantile(known, q, method="inverted_cdf")) if known.size else math.nan


def _percent(errors: Array) -> str:
    """Median / 95th percentile of the size of the errors, %."""
    middle, high = (100.0 * quantile(np.abs(errors), q) for q in (0.5, 0.95))
    return "–" if math.isnan(middle) else "∞" if math.isinf(middle) else f"{middle:.1f} / {high:.0f}"


def _sized(found: ModelError, least: int, most: int) -> NDArray[np.bool_]:
    """Contacts with so many taxels, shape (shapes, contacts)."""
    return np.asarray((found.taxels >= least) & (found.taxels <= most))


def largest_ratio_enough(model: Array, exact: Array) -> float:
    """The largest ρ of ``RATIOS`` up to which a model's errors stay within ``ENOUGH`` of the exact model's.

    Args:
        model: Errors, shape (contacts, ratios).
        exact: Likewise.

    Returns:
        −1 where it is not enough at any.
    """
    last = -1.0
    for k, ratio in enumerate(RATIOS):
        pairs = [(quantile(np.abs(model[:, k]), q), quantile(np.abs(exact[:, k]), q)) for q in (0.5, 0.95)]
        if not all(cheap <= ENOUGH * dear for cheap, dear in pairs):
            break
        last = ratio
    return last


def _enough(last: float) -> str:
    return "never" if last < 0.0 else "always" if last == RATIOS[-1] else f"up to {last:g}"


def _name(size: tuple[int, int]) -> str:
    return f"{size[0]} or more" if size[1] == SIZES[-1][1] else f"{size[0]} to {size[1]}"


def _by_size(found: ModelError) -> Table:
    heads = [
        "taxels in contact",
        "contacts",
        "model",
        *(f"ρ = {ratio:g}" for ratio in SHOWN),
        "random ρ",
        "enough at ρ",
    ]
    table = Table(
        "Model error by size of the image, matched loads: |error| median / p95, % of the contact's torque", heads
    )
    columns = [*(RATIOS.index(ratio) for ratio in SHOWN), RANDOM]
    said = []
    for size in SIZES:
        some = _sized(found, *size)
        exact, cheap, own = (found.errors[key][some] for key in (EXACT, CHEAP, OWN))
        last = largest_ratio_enough(cheap, exact)
        for name, errors, enough in (
            ("exact: the image's own error", exact, ""),
            ("ellipsoid", cheap, _enough(last)),
            ("ellipsoid without image: its own error", own, ""),
        ):
            table.rows.append((_name(size), len(errors), name, *(_percent(errors[:, k]) for k in columns), enough))
        said.append(f"{_name(size)} taxels: {_enough(last)}")
    table.notes += [
        f"Enough: neither median nor p95 of the error exceeds {ENOUGH:g} times that of the exact model on the same"
        f" image, for every ρ up to the one given. The ellipsoid is enough for {'; '.join(said)}."
        " There the image errs more than the model, and the exact model brings nothing.",
        "Translation alone sets no limit to the torque at any ρ: its error is infinite, and it is never enough.",
        f"{(found.taxels == 0).sum()} of {found.taxels.size} contacts touch no electrode; they count nowhere else.",
        "Limits are taken about the measured centroid, as the measured spin is; random ρ: even over the circle.",
        "Half sizes 2 to 12 mm, even in their logarithm (rings from 4, lines to 20): another mix of sizes shifts every"
        " figure over all sizes, not those by size.",
    ]
    return table


def _by_shape(found: ModelError) -> Table:
    ratios = (0.0, 0.5, 0.9, 0.99)
    heads = ["shape", "loads", "model", *(f"ρ = {ratio:g}" for ratio in ratios), "random ρ", "overstated, p95"]
    table = Table("Model error by shape, load rule and model, all sizes: |error| median / p95, %", heads)
    for s, shape in enumerate(SHAPES):
        for key in [OWN, *((r, m) for r in RULES for m in ("ellipsoid", "exact"))]:
            errors = found.errors[key][s]
            cells = [_percent(errors[:, k]) for k in (*map(RATIOS.index, ratios), RANDOM)]
            table.rows.append((shape, *key, *cells, _signed(errors[:, RANDOM])))
        table.rows.append((shape, "any", "translation", *["∞"] * 6))
    missing = [
        f"{shape} {100.0 * share:.0f} %" for shape, share in zip(SHAPES, (found.taxels == 0).mean(axis=1), strict=True)
    ]
    table.notes += [
        "Overstated: 95th percentile of the signed error at random ρ; an overstated limit calls sliding contacts safe.",
        f"Contacts that touch no electrode, in no figure here: {', '.join(missing)}.",
    ]
    return table


def _signed(errors: Array) -> str:
    high = quantile(errors, 0.95)
    return "–" if math.isnan(high) else f"{100.0 * high:+.0f}"


def _at_the_limit(found: ModelError) -> Table:
    heads = ["contacts", "model", "p5", "median", "p95", "grip for 95 %"]
    table = Table("What each model reads at the very limit (utilisation 1), matched loads, random ρ", heads)
    one = np.arange(len(SHAPES))[:, None]
    groups = {shape: (found.taxels > 0) & (one == s) for s, shape in enumerate(SHAPES)}
    groups |= {f"all, {_name(size)} taxels": _sized(found, *size) for size in SIZES}
    for name, some in groups.items():
        for model in MODELS:
            low, middle, high = (quantile(found.readings["matched", model][some][:, RANDOM], q) for q in LIMITS)
            table.rows.append((name, model, low, middle, high, 1.0 / low))
    table.notes += [
        "Grip for 95 %: 1/p5, the factor on the normal force with which a user of this model holds 95 % of such loads;"
        " 1 would be perfect.",
        "inf: the image is a point, which holds no torque; nan: no contact of this size was drawn.",
    ]
    return table


def _by_stage(found: ModelError) -> Table:
    table = Table(
        "Where the image's error arises: exact model, random ρ, |error| median / p95, %",
        ["taxels in contact", "errors so far", *RULES],
    )
    for size in SIZES:
        some = _sized(found, *size)
        for stage in STAGES:
            table.rows.append((_name(size), stage, *(_percent(found.stages[rule, stage][some]) for rule in RULES)))
    return table
