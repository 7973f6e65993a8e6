"""Registry of the methods for the friction limit that the chart and the failure atlas compare."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from chart.rivals import general, models, ours, paper, weiszfeld
from chart.scenes import Scene


@dataclass(frozen=True, slots=True)
class Method:
    """A way to find the friction limit of a contact.

    Attributes:
        name: What the tables call it.
        short: A word for the head of a column.
        limit: Largest spin torque about ``scene.about`` of sense +1, N·m. NaN: it gave no answer; +inf: it sets no
            limit; −inf: it calls the contact sliding whatever the spin. An exception: it failed.
        about: What it is, in a sentence.
        safe: The verdict for a measured spin, None where it says nothing; without it, ``spin <= limit``.
        group: "ours", "paper", "solver" or "model": what the picture colours by.
        exact: It claims the limit of the taxels, not of a simpler contact.
        time_s: Its own clock, where a call is not one decision (a batch): time per decision, s.
    """

    name: str
    short: str
    limit: Callable[[Scene], float]
    about: str = ""
    safe: Callable[[Scene, float], bool | None] | None = None
    group: str = "solver"
    exact: bool = False
    time_s: Callable[[Scene], float] | None = None


def ask(method: Method, scene: Scene) -> tuple[float, str]:
    """The limit, N·m, and how the method failed: "" where it did not, "no answer", or the exception's name."""
    try:
        limit = float(method.limit(scene))
    except Exception as error:  # whatever a method raises is its failure, and is told
        return math.nan, type(error).__name__
    return limit, "no answer" if math.isnan(limit) else ""


def verdict(method: Method, scene: Scene, spin: float) -> bool | None:
    """Whether the method calls a contact with this spin safe; None where it says nothing or fails."""
    try:
        if method.safe is not None:
            return method.safe(scene, spin)
        limit = float(method.limit(scene))
    except Exception:  # it failed: it says nothing
        return None
    return None if math.isnan(limit) else spin <= limit


def find(short: str) -> Method:
    """The method of that short name; KeyError names those there are."""
    named = {method.short: method for method in METHODS}
    if short not in named:
        raise KeyError(f"{short!r} is none of {', '.join(named)}")
    return named[short]


def _cone() -> tuple[Method, ...]:
    """Clarabel comes with the extra ``chart``; without it there is one method less."""
    if find_spec("clarabel") is None:
        return ()
    from chart.rivals import cone

    told = "interior point on the second-order cone form, tolerance 1e-9, set-up of the problem included"
    return (Method("Clarabel", "Clarabel", cone.limit, told, exact=True),)


METHODS: tuple[Method, ...] = (
    Method(
        "paper, as printed",
        "(6) printed",
        paper.printed,
        "hinge test (7) taxel by taxel, search from C along the residue's normal, (6) as it stands",
        group="paper",
    ),
    Method(
        "paper, (6) corrected",
        "(6) corrected",
        paper.corrected,
        "the same, with the torque moved to C",
        group="paper",
        exact=True,
    ),
    Method("SciPy root hybr", "hybr", general.hybr, "Powell's hybrid on (5) from C", exact=True),
    Method("SciPy root lm", "lm", general.lm, "Levenberg–Marquardt on (5) from C", exact=True),
    Method("SciPy BFGS", "BFGS", general.bfgs, "on Φ from C with its gradient", exact=True),
    Method("SciPy trust-exact", "trust-exact", general.trust_exact, "on Φ from C with its Hessian", exact=True),
    Method(
        "Weiszfeld",
        "Weiszfeld",
        weiszfeld.limit,
        f"fixed point of Φ from C with the Vardi–Zhang step at taxels, {weiszfeld.MOST_SWEEPS} sweeps at most",
        exact=True,
    ),
    *_cone(),
    Method(
        "power-law patch",
        "power law",
        models.power_law,
        "limit surface of a circle with pressure (1 − (r/a)⁴)^¼, as in slipping_control, from a table; felt radius",
        group="model",
    ),
    Method(
        "separate tests",
        "separate",
        models.separate,
        "translation by (4), torsion by μ f_n times the felt radius, each as if the other were not there",
        group="model",
    ),
    Method(
        "felt ellipsoid",
        "felt ellipsoid",
        models.felt_ellipsoid,
        "|(f_t, m / r)| ≤ μ f_n with the felt radius r, as in the hold of Slip-Aware-Object-Manipulation",
        group="model",
    ),
    Method(
        "ellipsoid",
        "ellipsoid",
        models.ellipsoid,
        "m_max(0) √(1 − ρ²) with m_max(0) taken as μ Σ F |r − C|",
        group="model",
    ),
    Method("translation alone", "translation", models.translation, "(4): any spin is safe while R ≤ μ", group="model"),
    Method(
        "slipd, one pass",
        "bounds",
        ours.bounds_limit,
        "certified bounds of one pass; the limit is the lower bound, and between them there is no verdict",
        safe=ours.bounds_safe,
        group="ours",
    ),
    Method(
        "slipd", "slipd", ours.limit, "the public call with its result object", safe=ours.safe, group="ours", exact=True
    ),
    Method(
        "slipd, batch",
        "batch",
        ours.batch_limit,
        f"the batch form, time per frame among {ours.FRAMES}",
        safe=ours.batch_safe,
        group="ours",
        exact=True,
        time_s=ours.batch_seconds,
    ),
)
