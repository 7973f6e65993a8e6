"""The picture of the model error: small multiples by shape, so that the eye finds where the cheap model is enough."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from chart.continuous import SHAPES
from chart.model_error import CHEAP, EXACT, LIMITS, MODELS, OWN, RANDOM, RATIOS, largest_ratio_enough, quantile
from numpy.typing import NDArray

if TYPE_CHECKING:
    from chart.model_error import ModelError
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

COARSE = 8  # taxels; images of fewer have a row of their own, for there the image is what errs
TOPS = (30.0, 90.0)  # of the two rows' axes, %
READ = 2.0  # end of the axis of readings; an interval that goes on ends in an arrow
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#AA4499", "#666666"
STYLES = (
    (EXACT, BLUE, 2.4, "-"),
    (CHEAP, ORANGE, 2.4, "-"),
    (("grey", "exact"), GREEN, 1.3, "-"),
    (("binary", "exact"), PURPLE, 1.3, "-"),
    (OWN, "black", 1.3, ":"),
)


def draw(found: ModelError, figure: Figure | SubFigure) -> None:
    """Fills the figure: |error| against ρ for images of many and of few taxels, and what is read at the limit."""
    grid = {"height_ratios": (3.0, 3.0, 1.3), "hspace": 0.42, "wspace": 0.12}
    edges = {"left": 0.06, "right": 0.99, "top": 0.79, "bottom": 0.05}
    axes = figure.subplots(3, len(SHAPES), gridspec_kw=grid | edges)
    many = found.taxels >= COARSE
    rows = (many, (found.taxels > 0) & ~many)
    for s, shape in enumerate(SHAPES):
        for axis, some, top in zip(axes[:2, s], rows, TOPS, strict=True):
            _errors(axis, {key: found.errors[key][s][some[s]] for key, *_ in STYLES}, top)
        _readings(axes[2, s], {model: found.readings["matched", model][s][:, RANDOM] for model in MODELS})
        if s == 0:
            _names(axes[0, s], {key: found.errors[key][s][many[s]] for key, *_ in STYLES})
        axes[0, s].set_title(shape, fontsize=13, fontweight="bold", loc="left", pad=6)
        for axis in axes[:, s]:
            axis.tick_params(labelsize=9, length=3, color=GREY)
            axis.spines[["top", "right"]].set_visible(False)
            if s:
                axis.tick_params(axis="y", labelleft=False, length=0)
    _title(figure)
    enough = [largest_ratio_enough(found.errors[CHEAP][some], found.errors[EXACT][some]) for some in rows]
    titles = (
        f"Images of {COARSE} taxels and more: the ellipsoid is enough {_until(enough[0])}",
        f"Images of fewer than {COARSE} taxels (mind the scale): the ellipsoid is enough {_until(enough[1])}",
        "Utilisation read at the very limit, where 1 is right and less calls a sliding contact safe: median and middle"
        " 90 %, matched loads, ρ even over the friction circle",
    )
    for axis, text, lift in zip(axes[:, 0], titles, (0.036, 0.014, 0.010), strict=True):
        figure.text(0.012, axis.get_position().y1 + lift, text, fontsize=11.5, va="bottom")


def _until(ratio: float) -> str:
    if ratio < 0.0:
        return "at no ρ"
    return "at every ρ" if ratio == RATIOS[-1] else f"up to ρ = {ratio:g}"


def _errors(axis: Axes, errors: dict[tuple[str, str], NDArray[np.float64]], top: float) -> None:
    """Medians; up to the 95th percentile for the two models that the choice is between."""
    for key, colour, width, style in STYLES:
        sizes = 100.0 * np.abs(errors[key])
        middle, high = ([quantile(sizes[:, k], q) for k in range(len(RATIOS))] for q in (0.5, 0.95))
        axis.plot(RATIOS, middle, style, color=colour, lw=width, zorder=3 if width > 2.0 else 2)
        if width > 2.0:
            axis.plot(RATIOS, high, color=colour, lw=0.9, alpha=0.8)
            axis.fill_between(RATIOS, middle, high, color=colour, alpha=0.12, lw=0.0)
    axis.set(xlim=(0.0, 1.0), ylim=(0.0, top), xticks=(0.0, 0.5, 1.0), xticklabels=("0", "ρ = 0.5", "1"))
    axis.set_yticks(np.linspace(0.0, top, 4), [f"{tick:g} %" for tick in np.linspace(0.0, top, 4)])
    axis.grid(axis="y", lw=0.4, color="#dddddd")
    axis.text(0.98, 0.97, f"{len(errors[EXACT])} contacts", transform=axis.transAxes, ha="right", va="top",
              fontsize=9, color=GREY)  # fmt: skip


def _names(axis: Axes, errors: dict[tuple[str, str], NDArray[np.float64]]) -> None:
    """Writes what they are at the curves themselves, where they lie apart."""
    at = (
        (CHEAP, 0.7, "ellipsoid", ORANGE),
        (("binary", "exact"), 0.0, "binary", PURPLE),
    )
    for key, ratio, name, colour in at:
        k = RATIOS.index(ratio)
        height = 100.0 * quantile(np.abs(errors[key][:, k]), 0.5)
        axis.annotate(name, (ratio, height), (3, 4), textcoords="offset points", color=colour, fontsize=9,
                      ha="right" if ratio > 0.5 else "left", fontweight="bold")  # fmt: skip


def _readings(axis: Axes, readings: dict[str, NDArray[np.float64]]) -> None:
    """The middle 90 % of what each model reads where the truth is 1."""
    for row, (model, colour) in enumerate(zip(MODELS, (BLUE, ORANGE, GREY), strict=True)):
        low, middle, high = (quantile(readings[model], q) for q in LIMITS)
        axis.plot((low, min(high, READ)), (-row, -row), color=colour, lw=6.0, alpha=0.35, solid_capstyle="butt")
        if high > READ:
            axis.plot(READ, -row, ">", color=colour, ms=5.0, clip_on=False)
        axis.plot(middle, -row, "o", color=colour, ms=5.0)
    axis.axvline(1.0, color="black", lw=0.8, zorder=0)
    axis.set(xlim=(0.0, READ), ylim=(-2.6, 0.6), xticks=(0.0, 1.0, 2.0), yticks=(0, -1, -2), yticklabels=MODELS)
    axis.spines["left"].set_visible(False)


def _title(figure: Figure | SubFigure) -> None:
    """Title, what is drawn, and the key in the colours of the curves."""
    figure.text(0.012, 0.98, "What the image and the model cost, against the contact itself", fontsize=17,
                fontweight="bold", va="top")  # fmt: skip
    told = (
        "Error of the torque limit, % of the contact's own torque; 8 × 16 taxels, 3.2 mm pitch, 1.5 mm electrodes,"
        " 5 % gain noise, 0.1 mm centroid error. Thick: median; shade: up to the 95th percentile."
    )
    figure.text(0.012, 0.939, told, fontsize=10.5, va="top", color="#333333")
    words = (
        (BLUE, "━ exact, matched loads: the image's cost"),
        (ORANGE, "━ ellipsoid, matched loads: image and model"),
        ("black", "┅ ellipsoid, no image: the model's cost"),
        (GREEN, "━ exact, grey loads"),
        (PURPLE, "━ exact, binary loads"),
    )
    for at, (colour, text) in zip((0.012, 0.237, 0.488, 0.707, 0.836), words, strict=True):
        figure.text(at, 0.907, text, color=colour, fontsize=10.5, fontweight="bold", va="top")
