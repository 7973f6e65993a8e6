"""Benefit of the scan-time correction of taxels, over the rate at which the load changes.

Taxel k is sampled ``k`` dwells after the first. While the force rises, the last taxels feel more of it than the first:
the image is tilted along the scan. The force sensor knows by how much, so each reading can be scaled by the force at
the common instant over the force at its own. Each contact is asked three times with the same noise: as scanned, so
scaled, and as if all taxels had been sampled at once, and each answer is held against the contact itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from bench.tables import Table
from numpy.typing import NDArray

from slipd.fusion import grey_loads, matched_loads, tipping_margin, torque_limit, utilisation
from slipd.tools.sim.stickslip.pressed_patch import ELECTRODE_SAMPLES
from slipd.tools.sim.true_contact import Pad, Patch
from slipd.types.arrays import Array

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure


PAD = Pad()
NORMAL_N, MU = 10.0, 0.5
RATIO, SPIN = 0.5, 0.6  # tangential force over friction; spin over the contact's limit beside it
RATES_N_PER_S = (1.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
SCANS_S = {"0.1 ms": 1e-4, "PVDF, 128 × 20 µs": 2.56e-3, "16 ms": 1.6e-2, "33 ms": 3.3e-2}
LEAST_N = 0.3  # where less presses, the ratio of two forces is noise
FORCE_PERIOD_S, FORCE_NOISE_N = 1e-3, 0.05
GAIN_NOISE, TAXEL_NOISE_N, CENTROID_NOISE_M = 0.05, 0.005, 1e-4
THRESHOLD_N = 0.015  # 3 σ of a taxel
CONTACTS, QUICK_CONTACTS = 200, 6
WAYS = ("as scanned", "one instant", "sampled at once")
RULES = ("grey", "matched")
QUANTITIES = ("utilisation", "torque limit", "tipping margin", "centroid of the image")
UNITS = ("%", "%", "mm", "mm")


@dataclass(frozen=True, slots=True, eq=False)
class Skew:
    """What each way errs by.

    Attributes:
        errors: Sizes of the errors, shape (scans, rates, contacts), by quantity, way and rule. Utilisation and limit:
            % of the true one; tipping margin and centroid: mm. NaN where there is no answer.
        grows: Contacts whose lengths grow with the force, shape (contacts,).
    """

    errors: dict[tuple[str, str, str], Array]
    grows: NDArray[np.bool_]

    def draw(self, figure: SubFigure) -> None:
        """Fills a SubFigure of about 3 : 1: a panel a quantity."""
        _draw(self, figure)

    def tables(self) -> list[Table]:
        """Errors over the change of force within a scan."""
        return [_by_change(self), _by_scan(self)]


def common_time(pressure: Array, taken_s: Array, force: tuple[Array, Array], at_s: float) -> Array:
    """Scales each taxel from its own instant to a common one.

    Args:
        pressure: Shape (n,).
        taken_s: When each was sampled, shape (n,), s.
        force: Times, rising, s, and normal forces, N.
        at_s: The common instant, s.

    Returns:
        Shape (n,); a taxel is left as it is where the force then or at ``at_s`` was not seen or below ``LEAST_N``.
    """
    normal = np.interp(taken_s, *force, left=0.0, right=0.0)
    wanted = float(np.interp(at_s, *force, left=0.0, right=0.0))
    if wanted < LEAST_N:
        return pressure
    scale = np.ones_like(pressure)
    np.divide(wanted, normal, out=scale, where=normal >= LEAST_N)
    return np.asarray(pressure * scale)


def run(quick: bool) -> Skew:
    """Asks about ``CONTACTS`` contacts at each scan time and rate, or about a few."""
    count = QUICK_CONTACTS if quick else CONTACTS
    size = (len(SCANS_S), len(RATES_N_PER_S), count)
    errors = {(q, w, r): np.full(size, np.nan) for q in QUANTITIES for w in WAYS for r in RULES}
    scans, grows = list(SCANS_S.values()), np.zeros(count, dtype=bool)
    for k in range(count):
        rng = np.random.default_rng(k)
        scene = _Scene(rng, grows=k % 2 == 1)
        grows[k] = k % 2 == 1
        for s, scan_s in enumerate(scans):
            for r, rate in enumerate(RATES_N_PER_S):
                sign = 1.0 if rng.random() < 0.5 else -1.0
                for key, error in scene.errors(scan_s, sign * rate, np.random.default_rng((k, s, r))).items():
                    errors[key][s, r, k] = error
    return Skew(errors, grows)


class _Scene:
    """A contact under a load, and what is true of it at the instant that is asked about."""

    def __init__(self, rng: np.random.Generator, *, grows: bool) -> None:
        centre = (float(rng.uniform(-5e-3, 5e-3)), float(rng.uniform(-3e-3, 3e-3)))
        half = (float(rng.uniform(6e-3, 18e-3)), float(rng.uniform(4e-3, 9e-3)))
        self.patch = Patch(half[0], half[1], float(rng.choice((2.0, 4.0))), centre)
        self.growth = 1.0 / 3.0 if grows else 0.0  # of lengths with the force: a sphere, a flat punch
        x, y, shares = self.patch.cells(5e-4)
        loads, self.centre = NORMAL_N * shares, np.array(centre)
        turn = rng.uniform(0.0, 2.0 * math.pi)
        self.force = RATIO * MU * NORMAL_N * np.array((math.cos(turn), math.sin(turn)))
        self.limit = torque_limit(x, y, loads, MU, self.force, self.centre).torque_nm
        self.spin = SPIN * self.limit
        self.used = utilisation(x, y, loads, MU, self.force, self.spin, self.centre).value
        self.reading = float(PAD.shares(self.patch).sum() / self.patch.pressure(*PAD.centres()).sum())
        self.margin = tipping_margin(x, y, self.centre)

    def image(self, normal: Array) -> Array:
        """What each taxel reads when the normal force is ``normal`` at its instant, shape (taxels,), N."""
        x, y = PAD.centres()
        at = (np.arange(ELECTRODE_SAMPLES) - (ELECTRODE_SAMPLES - 1) / 2) / ELECTRODE_SAMPLES * PAD.electrode_m
        dx, dy = (grid.ravel() for grid in np.meshgrid(at, at))
        size = np.maximum(normal / NORMAL_N, 1e-3) ** self.growth
        u = (x[:, None] + dx - self.centre[0]) / size[:, None] + self.centre[0]
        v = (y[:, None] + dy - self.centre[1]) / size[:, None] + self.centre[1]
        mean = self.patch.pressure(u, v).mean(axis=1)
        return np.asarray(mean * self.reading * normal / size**2)

    def errors(self, scan_s: float, rate: float, rng: np.random.Generator) -> dict[tuple[str, str, str], float]:
        """Of every quantity, way and rule, for a force that changes at ``rate`` up to ``NORMAL_N`` at the end."""
        taken = np.linspace(-scan_s, 0.0, PAD.rows * PAD.cols)
        times = np.arange(-math.ceil(scan_s / FORCE_PERIOD_S) - 1, 2) * FORCE_PERIOD_S
        force = np.maximum(NORMAL_N + rate * times, 0.0) + rng.normal(0.0, FORCE_NOISE_N, times.size)
        gain = rng.normal(1.0, GAIN_NOISE, taken.size)
        noise = rng.normal(0.0, TAXEL_NOISE_N, taken.size)
        scanned = self.image(np.maximum(NORMAL_N + rate * taken, 0.0)) * gain + noise
        at_once = self.image(np.full(taken.size, NORMAL_N)) * gain + noise
        images = (scanned, common_time(scanned, taken, (times, force), 0.0), at_once)
        centroid = self.centre + rng.normal(0.0, CENTROID_NOISE_M, 2)
        normal_n = NORMAL_N + float(rng.normal(0.0, FORCE_NOISE_N))
        found = {}
        for way, image in zip(WAYS, images, strict=True):
            active = image > THRESHOLD_N
            if active.any():
                found |= self._answers(way, image, active, normal_n, centroid)
        return found

    def _answers(
        self, way: str, image: Array, active: NDArray[np.bool_], normal_n: float, centroid: Array
    ) -> dict[tuple[str, str, str], float]:
        x, y = (axis[active] for axis in PAD.centres())
        p = image[active]
        seen = np.array((p @ x, p @ y)) / p.sum()
        lever = centroid - self.centre
        spin = self.spin - float(lever[0] * self.force[1] - lever[1] * self.force[0])
        limit = self.limit - (self.spin - spin)
        found = {}
        for rule in RULES:
            shared = matched_loads(x, y, p, normal_n, centroid) if rule == "matched" else grey_loads(p, normal_n)
            used = utilisation(x, y, shared.loads, MU, self.force, spin, centroid).value
            told = torque_limit(x, y, shared.loads, MU, self.force, centroid).torque_nm
            sizes = (
                100.0 * abs(used / self.used - 1.0),
                100.0 * abs(told - limit) / self.limit,
                1e3 * abs(tipping_margin(x, y, centroid) - self.margin),
                1e3 * float(np.hypot(*(seen - self.centre))),
            )
            found |= {(quantity, way, rule): size for quantity, size in zip(QUANTITIES, sizes, strict=True)}
        return found


def changes() -> Array:
    """Change of the force within a scan over the force, shape (scans, rates)."""
    return np.outer(list(SCANS_S.values()), RATES_N_PER_S) / NORMAL_N


def _cells(errors: Array) -> str:
    known = errors[~np.isnan(errors)]
    return f"{_quantile(known, 0.5):.2f} / {_quantile(known, 0.95):.1f}" if known.size else "–"


PAYS = 0.9  # correcting pays where it takes a tenth off the error
BINS = (0.0, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0, math.inf)


def _by_change(found: Skew) -> Table:
    spans = list(pairwise(BINS))
    table = Table(
        "Taxels at their own instants: |error| median / p95 over the change of force within a scan, |df/dt| T / f",
        ["quantity", "loads", "contacts", "taxels", *(f"{a:g} to {b:g}" for a, b in spans)],
    )
    change = changes()
    for quantity, unit in zip(QUANTITIES, UNITS, strict=True):
        for rule in RULES if unit == "%" else RULES[:1]:
            for kind, some in (("of one size", ~found.grows), ("growing", found.grows)):
                for way in WAYS:
                    errors = found.errors[quantity, way, rule][:, :, some]
                    cells = [_cells(errors[(change >= a) & (change < b)]) for a, b in spans]
                    name = rule if unit == "%" else "any"
                    table.rows.append((f"{quantity}, {unit}", name, kind, way, *cells))
    table.notes += [
        *(_verdict(found, rule) for rule in RULES),
        "Of one size: the pressure keeps its shape, so scaling undoes the skew wholly, but for the noise of the force."
        " Growing: lengths with the cube root of the force; the first taxels then show a smaller contact, which no"
        " scaling mends.",
        f"Force {NORMAL_N:g} N at the end of the scan, rising or falling; noise: force {FORCE_NOISE_N:g} N each"
        f" {1e3 * FORCE_PERIOD_S:g} ms, gain of each taxel {100 * GAIN_NOISE:g} %, each taxel {1e3 * TAXEL_NOISE_N:g}"
        f" mN, centroid {1e3 * CENTROID_NOISE_M:g} mm. Sampled at once: what no correction can surpass.",
    ]
    return table


def _verdict(found: Skew, rule: str) -> str:
    """Up to which change correcting brings nothing: the error's median and 95th percentile gain less than a tenth."""
    change, last = changes(), 0.0
    for a, b in pairwise(BINS):
        some = (change >= a) & (change < b)
        before, after = (found.errors["utilisation", way, rule][some] for way in WAYS[:2])
        gains = [np.nanquantile(after, q, method="inverted_cdf") < PAYS * np.nanquantile(
            before, q, method="inverted_cdf") for q in (0.5, 0.95)]  # fmt: skip
        if any(gains):
            break
        last = b
    return (
        f"{rule.capitalize()} loads, all contacts: up to a change of {last:g} of the force within a scan, bringing the"
        f" taxels to one instant makes neither median nor p95 of the utilisation's error smaller by a tenth."
    )


def _by_scan(found: Skew) -> Table:
    table = Table(
        f"Error of the utilisation, %, median / p95, matched loads, at {NORMAL_N:g} N: as scanned → one instant",
        ["scan", *(f"{rate:g} N/s" for rate in RATES_N_PER_S)],
    )
    before, after = (found.errors["utilisation", way, "matched"] for way in WAYS[:2])
    for s, scan in enumerate(SCANS_S):
        cells = [f"{_cells(before[s, r])} → {_cells(after[s, r])}" for r in range(len(RATES_N_PER_S))]
        table.rows.append((scan, *cells))
    table.notes.append("inf: the scan began before the contact, so its image has few taxels or none.")
    return table


def _draw(found: Skew, figure: SubFigure) -> None:
    """A panel a quantity and rule: median and p95 over the change of force within a scan, of the three ways."""
    panels = figure.subplots(
        1, 4, gridspec_kw={"left": 0.06, "right": 0.98, "top": 0.82, "bottom": 0.16, "wspace": 0.28}
    )
    asked = [
        ("utilisation", "matched"),
        ("utilisation", "grey"),
        ("torque limit", "matched"),
        ("tipping margin", "grey"),
    ]
    change = changes().ravel()
    order = np.argsort(change, kind="stable")
    for axes, (quantity, rule) in zip(panels, asked, strict=True):
        for way, colour in zip(WAYS, ("#D55E00", "#0072B2", "#999999"), strict=True):
            errors = found.errors[quantity, way, rule].reshape(change.size, -1)
            for q, style in ((0.5, "-"), (0.95, ":")):
                line = [_quantile(row, q) for row in errors[order]]
                axes.plot(change[order], line, style, color=colour, lw=1.6, label=way if q == 0.5 else None)
        unit = UNITS[QUANTITIES.index(quantity)]
        axes.set(xscale="log", yscale="log", xlabel="|df/dt| · scan time / force", ylabel=f"error, {unit}")
        loads = f", {rule} loads" if unit == "%" else ""
        axes.set_title(f"{quantity}{loads}", loc="left", fontweight="bold")
        axes.set_xlim(1e-3, 1.0)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper right", ncols=3, frameon=False)
    title = "Taxels brought to one instant: error by the change of force in a scan (dots: p95)"
    figure.suptitle(title, x=0.06, ha="left", fontweight="bold")


def _quantile(values: Array, q: float) -> float:
    known = values[~np.isnan(values)]
    return float(np.quantile(known, q, method="inverted_cdf")) if known.size else math.nan
