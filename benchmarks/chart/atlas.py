"""The failure atlas: every contact that makes methods fail, asked of every method; a cell is its error or failure."""

from __future__ import annotations

import math
import signal
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from bench.tables import Table
from chart.failures import GROUPS, ROWS
from chart.methods import METHODS, Method, ask, verdict
from chart.reference import exact_limit
from chart.row import Row

RIGHT, WRONG = 1e-12, 1e-6
"""Of the contact's own torque: below the first a cell says ✓, above the second it says on which side it errs."""

FACTOR = 1.05
"""From here on an overstated limit is told as a factor."""

TIME_LIMIT_S, QUICK_TIME_LIMIT_S = 5.0, 0.5
"""Processor time; the slowest that come to an end take some tens of milliseconds."""

QUICK_ROWS = 1
"""Of each group."""

OURS = "slipd"

READING = """\
Each row is a contact, each column a method. A cell shows the result of the method for the torque limit: the largest
spin torque that friction carries in addition to the tangential force. The true limits are closed forms, or solved to
25 digits.

- ✓: correct to 1e-12 of the contact's own torque, μ Σ F |r − centroid|, or correctly reports that there is no limit.
- 3e-8: error in the same unit; errors up to 1e-6 affect no verdict.
- −0.3: understates the limit by this much: false alarms. *slides*: classifies a contact that holds as sliding.
- **Bold is unsafe**: a sliding contact is classified as safe. **+0.03**: overstates the limit by this much; **×5.7**:
  by this factor; **∞**: finds no limit; **holds**: classifies a contact as safe that slides at any torque; **number**:
  returns a limit although the data have none, without an error.
- *none*: no answer. *late*: not finished in time. *ValueError* and similar: raised. The caller notices these.

For a method that is a model (one radius, one torque for the whole contact), the cell is the error of the model. For the
bounds of one pass, the cell is their lower bound; between their bounds the verdict is open.

For a fair reading: on ordinary contacts the general solvers are as accurate as slipd. They differ in the other groups,
and in time, which this page does not show. The contacts were chosen because they are hard, and those found by search
because they are hard for one method. slipd was improved until it passed every row; the other methods are as published.
Invalid data are passed to each method unchanged; a caller who checks them first avoids most failures of that group.
Only slipd and, to its tolerance, Clarabel report how accurate their own answer is."""


class _TooSlowError(Exception):
    """A method that took longer than the limit."""


def run(quick: bool) -> str:
    """The page ``build/measured/failure_atlas.md``, without its header; ``quick``: few rows and no reference."""
    limit_s = QUICK_TIME_LIMIT_S if quick else TIME_LIMIT_S
    for method in METHODS:
        ask(method, ROWS[0].scene)  # compiles, and fills tables, before any time is taken
    tables, shown = [], []
    for group, all_rows in GROUPS.items():
        rows = all_rows[:QUICK_ROWS] if quick else all_rows
        if not rows:
            continue
        table = Table(group, ["contact", *(method.short for method in METHODS)])
        for row in rows:
            cells = [cell(method, row, limit_s) for method in METHODS]
            shown.append((row, cells))
            table.rows.append([row.name, *cells])
        table.notes += _reasons(rows)
        tables.append(table)
    checked = [] if quick else [_checked()]
    text = [READING, *checked, _ours(shown)]
    parts = [_summary(shown).markdown(), *(table.markdown() for table in tables), _legend()]
    return "\n\n".join(text) + "\n" + "\n".join(parts)


def cell(method: Method, row: Row, limit_s: float = TIME_LIMIT_S) -> str:
    """What one method makes of one contact."""
    with warnings.catch_warnings(), _at_most(limit_s):
        warnings.simplefilter("ignore")  # methods divide by zero on the way
        if row.kind == "translating" and math.isnan(row.limit_nm):
            return {True: "**holds**", False: "✓", None: _failure(method, row)}[verdict(method, row.scene, 0.0)]
        found, failure = ask(method, row.scene)
    if row.kind == "none":
        return "✓" if failure == "no answer" else _told(failure) if failure else _nonsense(found)
    if row.kind == "translating" and found == -math.inf:
        return "✓"  # R = μ: sliding begins, whatever the torque
    return _told(failure) if failure else _error(found, row)


def _error(found: float, row: Row) -> str:
    if math.isinf(found):
        return "**∞**" if found > 0.0 else "*slides*"
    error = (found - row.limit_nm) / row.scale_nm
    if abs(error) <= RIGHT:
        return "✓"
    if abs(error) <= WRONG:
        return f"{abs(error):.0e}"
    size = f"{abs(error):.1e}" if abs(error) < 1e-2 or abs(error) >= 1e3 else f"{abs(error):.2g}"
    if error < 0.0:
        return f"−{size}"
    if row.limit_nm > 0.0 and found >= FACTOR * row.limit_nm:
        times = found / row.limit_nm
        return f"**×{times:.1e}**" if times >= 1e3 else f"**×{times:.3g}**"
    return f"**+{size}**"


def _nonsense(found: float) -> str:
    return "*slides*" if found == -math.inf else "**∞**" if found == math.inf else "**number**"


def _failure(method: Method, row: Row) -> str:
    return _told(ask(method, row.scene)[1] or "no answer")


def _told(failure: str) -> str:
    if failure == _TooSlowError.__name__:
        return "*late*"
    return "*none*" if failure == "no answer" else f"*{failure}*"


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """Raises inside whatever runs longer (in the main thread; compiled code is waited for)."""

    def late(number: int, frame: FrameType | None) -> None:
        raise _TooSlowError

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def _sort(text: str) -> str:
    """The column of the summary that a cell counts in."""
    if text.startswith("**"):
        return "unsafe"
    if text.startswith("−") or text == "*slides*":
        return "false alarm"
    return "right" if text == "✓" or text[0].isdigit() else "failed"


def _summary(shown: list[tuple[Row, list[str]]]) -> Table:
    sorts = ("right", "failed", "false alarm", "unsafe")
    table = Table(f"In short: what {len(shown)} contacts make of each method", ["method", *sorts])
    for n, method in enumerate(METHODS):
        count = Counter(_sort(cells[n]) for _, cells in shown)
        table.rows.append([method.name, *(count[sort] for sort in sorts)])
    table.notes.append("right: within 1e-6 of the torque, or correctly no limit. failed: no answer, reported as such.")
    table.notes.append("The contacts were chosen to be hard: the shares are not those of ordinary use.")
    return table


def _ours(shown: list[tuple[Row, list[str]]]) -> str:
    """Where ours is not right to the last, and who is."""
    n = next(i for i, method in enumerate(METHODS) if method.short == OURS)
    others = [i for i, method in enumerate(METHODS) if method.short not in (OURS, "batch")]
    worse = []
    for row, cells in shown:
        if cells[n] != "✓":
            better = [METHODS[i].short for i in others if cells[i] == "✓"]
            worse.append(f"{row.name} ({cells[n]}; right: {', '.join(better) or 'none'})")
    return f"Contacts on which slipd is not right to 1e-12: {'; '.join(worse) or 'none'}."


def _checked() -> str:
    """How far the limits in the rows are from the reference, asked again."""
    rows = [row for row in ROWS if math.isfinite(row.limit_nm)]
    worst = max(abs(exact_limit(row.scene) - row.limit_nm) / (row.scale_nm + abs(row.limit_nm)) for row in rows)
    return f"The reference, asked again, is within {worst:.0e} of the {len(rows)} limits from which errors are taken."


def _reasons(rows: list[Row]) -> list[str]:
    """Why each is hard; neighbours with one reason share a line."""
    reasons: dict[str, list[str]] = {}
    for row in rows:
        reasons.setdefault(row.why, []).append(row.name)
    return [f"*{'*, *'.join(names)}*: {why}" for why, names in reasons.items()]


def _legend() -> str:
    lines = [f"- **{method.short}**: {method.name}{'. ' + method.about if method.about else '.'}" for method in METHODS]
    return "\n".join(["", "## Methods", "", *lines, ""])
