"""Draw the levels of every run over time as one SVG picture: a block for each recording, in it a strip for each config.

The height of a strip is the severity of the level, and its colour the level itself. Below the strips of a recording are
the times at which the simulated object slid. The picture needs no library and no font.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from slipd.tools.evaluation.config_run import RECORDED, ConfigRun
from slipd.tools.evaluation.evaluate import Evaluation
from slipd.tools.evaluation.run_figures import BY_SEVERITY, differences, worst_spans

COLOURS = {
    "no_contact": "#d9d9d9",
    "stable": "#7fbf7b",
    "unknown": "#b39ddb",
    "caution": "#fdd835",
    "warning": "#fb8c00",
    "slipping": "#c62828",
}
"""Colour of each level; the heights tell them apart without colours."""

WIDTH, LEFT, RIGHT = 1200, 220, 20
"""Width of the picture, and of what is beside the strips, px."""

STRIP, GAP, MARK, TITLE, AXIS, LEGEND = 36, 8, 6, 26, 24, 34
"""Heights of the parts, px."""

MOST_TICKS = 12
"""Most steps of the time axis."""

MOST_LETTERS = 30
"""Longest name beside a strip."""

TRUE_SLIP, DIFFERENT = "#000000", "#1565c0"


def picture(evaluations: Sequence[Evaluation]) -> str:
    """Return the picture as SVG."""
    y = LEGEND
    parts: list[str] = list(_legend())
    for one in evaluations:
        block, height = _block(one, y)
        parts += block
        y += height
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{y + GAP}" '
            f'viewBox="0 0 {WIDTH} {y + GAP}" font-family="sans-serif" font-size="12" shape-rendering="crispEdges">',
            f'<rect width="{WIDTH}" height="{y + GAP}" fill="#ffffff"/>',
            *parts,
            "</svg>\n",
        ]
    )


def _legend() -> Iterator[str]:
    marks = [(level, COLOURS[level]) for level in BY_SEVERITY]
    marks += [(f"another level than {RECORDED}", DIFFERENT), ("the simulated object slides", TRUE_SLIP)]
    x = GAP
    for text, colour in marks:
        yield f'<rect x="{x}" y="10" width="12" height="12" fill="{colour}"/>'
        yield _text(x + 16, 20, text)
        x += 36 + 7 * len(text)


def _block(one: Evaluation, y: int) -> tuple[list[str], int]:
    """Return what is drawn of one recording, from ``y`` on, and its height."""
    runs = {name: run for name, run in one.runs.items() if isinstance(run, ConfigRun)}
    length_s = max([run.end_s for run in runs.values()], default=0.0) or 1.0
    px_per_s = (WIDTH - LEFT - RIGHT) / length_s
    parts = [_text(GAP, y + 16, one.name, bold=True)]
    at = y + TITLE
    recorded = runs.get(RECORDED)
    for name, run in one.runs.items():
        parts.append(_text(GAP, at + STRIP - 12, _short(name)))
        if isinstance(run, str):
            parts.append(_text(LEFT, at + STRIP - 12, "no run"))
        else:
            parts += _strip(run, at, px_per_s)
            if recorded is not None and run is not recorded:
                found = differences(worst_spans(recorded.spans), worst_spans(run.spans))
                parts += _marks([(begin_s, end_s) for begin_s, end_s, _, _ in found], at + STRIP, px_per_s, DIFFERENT)
        at += STRIP + GAP
    if one.truth is not None:
        parts += _marks(one.truth.sliding, at, px_per_s, TRUE_SLIP)
        at += MARK + 2
    if runs:
        parts += _axis(length_s, at, px_per_s)
    return parts, at + AXIS - y


def _short(name: str) -> str:
    """Return the end of a name that fits beside a strip."""
    return name if len(name) <= MOST_LETTERS else f"…{name[1 - MOST_LETTERS :]}"


def _strip(run: ConfigRun, y: int, px_per_s: float) -> Iterator[str]:
    for span in worst_spans(run.spans):
        if span.seconds > 0.0:
            height = STRIP * (BY_SEVERITY.index(span.level) + 1) / len(BY_SEVERITY)
            words = ", ".join((*span.reasons, *span.evidence)) or "no reasons"
            hover = f"{span.begin_s:.3f}…{span.end_s:.3f} s: {span.level} ({words})"
            yield (
                f'<rect x="{LEFT + span.begin_s * px_per_s:.2f}" y="{y + STRIP - height:.1f}" '
                f'width="{span.seconds * px_per_s:.2f}" height="{height:.1f}" fill="{COLOURS[span.level]}">'
                f"<title>{escape(hover)}</title></rect>"
            )


def _marks(found: Sequence[tuple[float, float]], y: int, px_per_s: float, colour: str) -> Iterator[str]:
    """Yield a line for each interval; a short one stays visible."""
    for begin_s, end_s in found:
        width = max((end_s - begin_s) * px_per_s, 1.0)
        yield f'<rect x="{LEFT + begin_s * px_per_s:.2f}" y="{y}" width="{width:.2f}" height="{MARK}" fill="{colour}"/>'


def _axis(length_s: float, y: int, px_per_s: float) -> Iterator[str]:
    steps_s = (digit * 10.0**power for power in range(-3, 9) for digit in (1, 2, 5))
    step_s = next(step_s for step_s in steps_s if step_s >= length_s / MOST_TICKS)
    for tick in range(int(length_s / step_s + 1e-9) + 1):
        x = LEFT + tick * step_s * px_per_s
        yield f'<line x1="{x:.2f}" y1="{y}" x2="{x:.2f}" y2="{y + 4}" stroke="#555555"/>'
        yield _text(x, y + 16, f"{tick * step_s:g} s", middle=True)


def _text(x: float, y: float, text: str, *, bold: bool = False, middle: bool = False) -> str:
    style = (' font-weight="bold"' if bold else "") + (' text-anchor="middle"' if middle else "")
    return f'<text x="{x:.2f}" y="{y:.1f}"{style}>{escape(text)}</text>'
