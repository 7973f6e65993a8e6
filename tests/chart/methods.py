"""The methods that a user could pick for the friction limit: one registry, asked alike by the chart and the atlas."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from chart.rivals import models, ours
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
        exact: It claims the limit of the taxels, not of a simpler contact.
        time_s: Its own clock, where a call is not one decision (a batch): time per decision, s.
    """

    name: str
    short: str
    limit: Callable[[Scene], float]
    about: str = ""
    safe: Callable[[Scene, float], bool | None] | None = None
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


METHODS: tuple[Method, ...] = (
    Method("power-law circular patch", "power law", models.power_law),
    Method("separate translation and torsion", "separate", models.separate),
    Method("ellipsoid, felt radius", "felt ellipsoid", models.felt_ellipsoid),
    Method("ellipsoid", "ellipsoid", models.ellipsoid),
    Method("translation alone", "translation", models.translation),
    Method("bounds of one pass", "bounds", ours.bounds_limit, safe=ours.bounds_safe),
    Method("slipd", "slipd", ours.limit, safe=ours.safe, exact=True),
    Method("slipd, batch", "batch", ours.batch_limit, exact=True, time_s=ours.batch_seconds),
)
