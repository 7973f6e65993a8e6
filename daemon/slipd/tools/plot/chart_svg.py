"""Draw a chart as SVG, without a library: colours by class, so that a page decides between dark and light."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from slipd.tools.plot.binned_track import Held, Range, Window
from slipd.tools.plot.chart import DARK_SPANS, SPAN_COLOURS, Curve, Panel, StripGroup, stretches, ticks
from slipd.types.arrays import Array

WIDTH, LEFT, RIGHT = 1180, 150, 16
"""Width of the chart, and of what is beside the curves, px."""

TITLE, PANEL, STRIP, GAP, AXIS = 22, 110, 20, 14, 26
"""Heights of the parts, px."""

LETTER = 6.2
"""Width of a letter, px, on average; a text that may not fit is left out."""

MOST_LETTERS = 24
"""Longest name beside a strip."""

TAXEL = 12
"""Side of a taxel in a snapshot, px."""


def chart_svg(parts: Sequence[Panel | StripGroup], window: Window) -> str:
    """Return the chart."""
    body: list[str] = []
    y = 0.0
    for part in parts:
        height = PANEL if isinstance(part, Panel) else STRIP * len(part.strips)
        body.append(_text("title", LEFT, y + TITLE - 7, part.title))
        body += _legend(part, y) if isinstance(part, Panel) else _note(part, y)
        body += _panel(part, y + TITLE, window) if isinstance(part, Panel) else _strips(part, y + TITLE, window)
        y += TITLE + height + GAP
    body += _time_axis(y, window)
    return "\n".join(
        [
            f'<svg class="chart" viewBox="0 0 {WIDTH} {y + AXIS:g}" role="img" aria-label="course of the run">',
            *body,
            "</svg>",
        ]
    )


def _text(kind: str, x: float, y: float, text: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{escape(text)}</text>'


def _x(t_s: float, window: Window) -> float:
    share = (t_s - window.begin_s) / (window.end_s - window.begin_s)
    return LEFT + (WIDTH - LEFT - RIGHT) * min(max(share, 0.0), 1.0)


def _legend(panel: Panel, y: float) -> Iterator[str]:
    x = LEFT + 12 + LETTER * 1.25 * len(panel.title)
    for curve in panel.curves:
        sample = "v-4h18v8h-18z" if curve.kind == "band" else "h18"
        yield f'<path class="{curve.kind} {curve.colour}" d="M{x:.0f} {y + 11:g}{sample}"/>'
        yield _text("small", x + 23, y + 15, curve.name)
        x += 40 + LETTER * len(curve.name)


def _note(group: StripGroup, y: float) -> Iterator[str]:
    if group.note:
        x = LEFT + 12 + LETTER * 1.25 * len(group.title)
        shown = textwrap.shorten(group.note, int((WIDTH - RIGHT - x) / LETTER), placeholder=" …")
        yield f"<g>{_text('small', x, y + 15, shown)}<title>{escape(group.note)}</title></g>"


def _panel(panel: Panel, y: float, window: Window) -> Iterator[str]:
    least, most = panel.span
    px = PANEL / (most - least)

    def height_of(value: float) -> float:
        return y + PANEL - (min(value, most) - least) * px

    yield f'<rect class="ground" x="{LEFT}" y="{y:g}" width="{WIDTH - LEFT - RIGHT}" height="{PANEL}"/>'
    for tick in ticks(least, most, 6):
        at = height_of(tick)
        yield f'<path class="grid" d="M{LEFT} {at:.1f}H{WIDTH - RIGHT}"/>'
        yield _text("small end", LEFT - 6, at + 4, f"{tick:g}")
    for limit, name in panel.limits:
        yield f'<path class="limit" d="M{LEFT} {height_of(limit):.1f}H{WIDTH - RIGHT}"/>'
        yield _text("small end", WIDTH - RIGHT - 4, height_of(limit) - 3, name)
    for curve in panel.curves:
        yield from _curve(curve, window, height_of)


def _curve(curve: Curve, window: Window, height_of: Callable[[float], float]) -> Iterator[str]:
    outline = _area if curve.kind == "band" else _line
    paths = "".join(
        outline(
            [(_x(at.begin_s, window), height_of(at.value[0]), height_of(at.value[1])) for at in _until_end(stretch)]
        )
        for stretch in stretches(curve.points)
    )
    if paths:
        yield f'<path class="{curve.kind} {curve.colour}" d="{paths}"/>'


def _until_end(stretch: list[Held[Range]]) -> list[Held[Range]]:
    """Return the points with the end of the last one, so that a value that stays is drawn as long as it holds."""
    last = stretch[-1]
    return [*stretch, Held(last.end_s, last.end_s, last.value)]


def _area(points: Sequence[tuple[float, float, float]]) -> str:
    """Return the outline of what lies between two values; each point has x and the heights of both."""
    there = "L".join(f"{x:.1f} {high:.1f}" for x, _, high in _corners(points))
    back = "L".join(f"{x:.1f} {low:.1f}" for x, low, _ in reversed(_corners(points)))
    return f"M{there}L{back}Z"


def _line(points: Sequence[tuple[float, float, float]]) -> str:
    """Return a line through least and largest value of each point."""
    path: list[str] = []
    for x, low, high in _corners(points):
        path.append(f"{x:.1f} {low:.1f}")
        if f"{low:.1f}" != f"{high:.1f}":
            path.append(f"{x:.1f} {high:.1f}")
    return f"M{'L'.join(path)}"


def _corners(points: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Leave out points whose values are those of both neighbours, as drawn."""
    drawn = [(round(low, 1), round(high, 1)) for _, low, high in points]
    inner = (at for at in range(1, len(points) - 1) if not drawn[at - 1] == drawn[at] == drawn[at + 1])
    return [points[0], *(points[at] for at in inner), points[-1]]


def _strips(group: StripGroup, y: float, window: Window) -> Iterator[str]:
    for row, (whole, spans) in enumerate(group.strips.items()):
        top = y + STRIP * row
        name = whole if len(whole) <= MOST_LETTERS else f"{whole[: MOST_LETTERS - 1]}…"
        yield f"<g>{_text('small end', LEFT - 6, top + 13, name)}<title>{escape(whole)}</title></g>"
        yield f'<rect class="ground" x="{LEFT}" y="{top:g}" width="{WIDTH - LEFT - RIGHT}" height="{STRIP - 3}"/>'
        for span in spans:
            begin, end = _x(span.begin_s, window), _x(span.end_s, window)
            hover = f"{span.begin_s:.3f} to {span.end_s:.3f} s: {span.whole}"
            yield (
                f'<rect x="{begin:.1f}" y="{top:g}" width="{max(end - begin, 0.7):.1f}" height="{STRIP - 3}" '
                f'fill="{SPAN_COLOURS[span.colour]}"><title>{escape(hover)}</title></rect>'
            )
            if text := span.text_for((end - begin - 6) / LETTER):
                ink = "light" if span.colour in DARK_SPANS else "dark"
                yield _text(f"small {ink}", begin + 4, top + 13, text)


def _time_axis(y: float, window: Window) -> Iterator[str]:
    for tick in ticks(*window, 12):
        x = _x(tick, window)
        yield f'<path class="tick" d="M{x:.1f} {y - GAP:g}v5"/>'
        yield _text("small middle", x, y + 6, f"{tick:g} s")


def snapshot_svg(image: Mapping[str, Any], verdict: Mapping[str, Any]) -> str:
    """Return the image of a pad with the contact centroid (+) and the pole (o), X to the right and Y up.

    A load is a square that is the more opaque, the larger it is.

    Args:
        image: A message ``tactile`` with an image.
        verdict: The message ``slip`` with centroid and pole; where they are missing, none is drawn.
    """
    loads = _picture(image)
    rows, cols = loads.shape
    width, height = cols * TAXEL, rows * TAXEL
    size = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    parts = [f'<svg class="pad" {size} role="img" aria-label="image of the pad"><rect class="rest" {_FULL}/>']
    for (row, col), load in np.ndenumerate(loads / (loads.max() or 1.0)):
        if load > 0.0:
            place = f'x="{col * TAXEL}" y="{row * TAXEL}" width="{TAXEL}" height="{TAXEL}"'
            parts.append(f'<rect class="load" {place} fill-opacity="{load:.2f}"/>')
    for mark, point_m in ((_CROSS, verdict.get("centroid_m")), (_CIRCLE, verdict.get("pole_m"))):
        if point_m is not None:
            x, y = width / 2 + TAXEL * point_m[0] / image["pitch_m"], height / 2 - TAXEL * point_m[1] / image["pitch_m"]
            parts += [mark.format(x=x, y=y)] if 0.0 <= x < width and 0.0 <= y < height else []
    return "".join([*parts, "</svg>"])


def _picture(image: Mapping[str, Any]) -> Array:
    """Return the loads in the pad's frame, shape (taxels along Y, from above; taxels along X)."""
    scan = np.reshape(image["loads_n"], (image["rows"], image["cols"]))
    down, across = image.get("rows_along", "+y"), image.get("cols_along", "+x")
    if down.endswith("x"):
        scan, down, across = scan.T, across, down
    if across.startswith("-"):
        scan = scan[:, ::-1]
    return scan if down.startswith("-") else scan[::-1]


_FULL = 'width="100%" height="100%"'
_CROSS = '<path class="mark" d="M{x:.1f} {y:.1f}m-6 0h12m-6 -6v12"/>'
_CIRCLE = '<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="5"/>'
