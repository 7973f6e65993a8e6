"""The tables and the text of ``build/measured/speed_accuracy.md``: every figure in it comes from the run."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from bench.tables import Table
from chart.rivals import paper
from chart.scaling import Scaling
from chart.scores import CALLS, LONGEST_S, NEAREST_SPIN, WRONG_TOLD, Question, Score

ORDINARY = ("ordinary", "off centre", "few taxels")
FLOOR = 1e-16
"""Errors below are those of the last digit."""


class Report:
    """The scores of one run, and what is to be said of them."""

    def __init__(self, asked: Sequence[Question], found: Sequence[Score]) -> None:
        self.families = np.array([question.scene.family for question in asked])
        self.scores = list(found)
        self.ordinary = np.isin(self.families, ORDINARY)
        self._named = {score.method.short: score for score in found}

    def of(self, short: str) -> Score:
        """The score of the method of that short name."""
        return self._named[short]

    def tables(self, scaling: Scaling) -> list[Table]:
        """All scenes; the ordinary ones; by family; cost against taxels."""
        everything = np.ones(self.families.size, dtype=bool)
        return [
            self._table(f"All families: {self.families.size} contacts", everything),
            self._table(f"Ordinary contacts alone: {int(self.ordinary.sum())}", self.ordinary),
            self._by_family(),
            _cost(scaling),
        ]

    def text(self, solver_s: float) -> str:
        """What the picture shows, what failed, and where slipd is not the best choice."""
        return "\n\n".join((_READING.strip(), self._failures(), self._not_best(solver_s), self._methods()))

    def _table(self, title: str, some: np.ndarray) -> Table:
        head = ("method", "time p50 µs", "p99 µs", "error p50", "p99", "worst", f"wrong > {WRONG_TOLD} %",
                "no answer %", "called safe, slides %", "false alarm %", "no verdict %")  # fmt: skip
        table = Table(title, head)
        for score in (score.of(some) for score in self.scores):
            times = (1e6 * float(np.quantile(score.seconds, q)) for q in (0.5, 0.99))
            errors = (shown(score.quantile(q)) for q in (0.5, 0.99, 1.0))
            shares = (score.wrong, score.no_answer, score.unsafe, score.alarm, score.silent)
            table.rows.append((score.method.name, *times, *errors, *(_percent(share) for share in shares)))
        table.notes.append("Errors are relative to μ Σ F |r − centroid|, over contacts with an answer.")
        table.notes.append("Shares are of all contacts; half of the judged spins are safe.")
        return table

    def _by_family(self) -> Table:
        table = Table(
            f"Where they fail: wrong by more than {WRONG_TOLD} or no answer, % of each family",
            ("family", *(score.method.short for score in self.scores if score.method.exact)),
        )
        for family in dict.fromkeys(self.families):
            some = self.families == family
            bad = [(s.wrong | s.no_answer)[some] for s in self.scores if s.method.exact]
            table.rows.append((str(family), *(_percent(share) for share in bad)))
        table.notes.append("Only methods that compute the limit of the taxels; the models are wrong nearly everywhere.")
        return table

    def _failures(self) -> str:
        lines = ["## What failed", ""]
        for score in self.scores:
            bad = score.wrong | score.no_answer
            if not score.method.exact or not bad.any():
                continue
            families, counts = np.unique(self.families[bad], return_counts=True)
            most = ", ".join(str(families[k]) for k in np.argsort(-counts)[:3])
            ways = (("no answer", score.no_answer), ("wrong", score.wrong))
            told = [f"{way} on {_percent(share)} %" for way, share in ways if share.any()]
            raised = sorted(set(score.failure) - {"", "no answer"})
            if raised:
                told.append(f"raised {', '.join(raised)}")
            lines.append(f"- {score.method.name}: {', '.join(told)}; most often: {most}.")
        good = [s.method.name for s in self.scores if s.method.exact and not (s.wrong | s.no_answer).any()]
        if good:
            lines.append(f"- Right to {WRONG_TOLD} on every contact: {', '.join(good)}.")
        printed, right = self.of("(6) printed"), self.of("(6) corrected")
        lines.append(
            f"- (6) as printed mistakes a torque about the pole for one about C: it calls {_percent(printed.unsafe)} % "
            f"of all contacts safe although they slide; with the torque moved to C, {_percent(right.unsafe)} %."
        )
        return "\n".join(lines)

    def _not_best(self, solver_s: float) -> str:
        """Each sentence holds whichever way the figures fall."""
        ours, batch, cheap = (self.of(short).of(self.ordinary) for short in ("slipd", "batch", "ellipsoid"))
        felt, law = (self.of(short).of(self.ordinary) for short in ("felt ellipsoid", "power law"))
        lines = ["## Where slipd is not the best choice", ""]
        lines.append(
            f"- Speed alone: {self._cheaper()}. On ordinary contacts the ellipsoid takes {_us(cheap)} µs in NumPy, "
            f"slipd {_us(ours)} µs by the public call and {_us(batch)} µs in a batch. "
            f"But the error of the ellipsoid is {shown(cheap.quantile(0.5))} in the median and "
            f"{shown(cheap.quantile(0.99))} at p99, and it calls {_percent(cheap.unsafe)} % of the contacts safe "
            "although they slide."
        )
        lines.append(
            "- With a radius measured beforehand by turning the object, the error of the ellipsoid is "
            f"{shown(felt.quantile(0.5))} and that of the circular patch {shown(law.quantile(0.5))} (medians, ordinary "
            "contacts). Without a tactile image there is nothing better; slipd needs the image. The model errors below "
            "show whether an image is good enough to make a difference."
        )
        lines += [self._equals(short) for short in ("Clarabel", "BFGS", "hybr") if short in self._named]
        lines.append(
            "- Translation alone is sufficient if no torque acts about C; it ignores torque. "
            "For a conic program that contains more than this limit, use a conic solver"
            + (f" (Clarabel without its set-up: {1e6 * solver_s:.0f} µs)." if math.isfinite(solver_s) else ".")
        )
        return "\n".join(lines)

    def _cheaper(self) -> str:
        limit = np.median(self.of("slipd").seconds)
        faster = [
            s.method.name for s in self.scores if s.method.group != "ours" and float(np.median(s.seconds)) < limit
        ]
        return f"faster than the public call: {', '.join(faster)}" if faster else "nothing here is faster"

    def _equals(self, short: str) -> str:
        score = self.of(short).of(self.ordinary)
        good = ~(score.wrong | score.no_answer)
        times = float(np.median(score.seconds) / np.median(self.of("slipd").of(self.ordinary).seconds))
        return (
            f"- {score.method.name} is right to {WRONG_TOLD} on {_percent(good)} % of the ordinary contacts (median "
            f"error {shown(score.quantile(0.5))}), as slipd is, in {times:.0f} times its time and without bounds."
        )

    def _methods(self) -> str:
        lines = ["## The methods", ""]
        lines += [f"- **{score.method.name}**: {score.method.about}." for score in self.scores]
        lines.append("")
        lines.append(
            "The general solvers, Weiszfeld's and the paper's search get the contact without units (lengths over its "
            "spread, forces over μ f_n) and start at C. The paper's search ends at a residue of "
            f"{shown(paper.TOLERANCE)} or after {paper.MOST_STEPS} steps; its rates and tolerance are the best of "
            'those tried, as is Clarabel\'s tolerance. A solver that reports no success counts as "no answer". The '
            "other methods are NumPy and SciPy as a user would write them; slipd is compiled. A felt radius is the one "
            "that a rotation of the object without tangential force would measure; its measurement is not "
            "part of the times."
        )
        return "\n".join(lines)


def shown(error: float) -> str:
    """An error as a cell."""
    if math.isnan(error):
        return "–"
    if math.isinf(error) or error == 0.0:
        return "∞" if error else "0"
    return f"{error:.0e}".replace("e+00", "").replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def _cost(scaling: Scaling) -> Table:
    table = Table("Cost against taxels, µs", ("taxels", *scaling.seconds))
    for k, count in enumerate(scaling.taxels):
        cells = (1e6 * seconds[k] for seconds in scaling.seconds.values())
        table.rows.append((str(count), *("–" if math.isnan(cell) else float(cell) for cell in cells)))
    slopes = [f"{short} {slope:.2f}" for short in scaling.seconds if math.isfinite(slope := scaling.slope(short))]
    if slopes:  # the quick run has one large contact
        table.notes.append(
            f"Exponent of the cost in the taxels, fitted over the large contacts (1 is linear): {', '.join(slopes)}."
        )
    return table


def _percent(share: np.ndarray) -> str:
    """With digits enough to tell one scene from none."""
    part = 100.0 * float(np.mean(share))
    return "0" if part == 0.0 else f"{part:.2g}" if part < 1.0 else f"{part:.1f}"


def _us(score: Score) -> str:
    return f"{1e6 * float(np.median(score.seconds)):.1f}"


_READING = f"""
![Time against error, failures, verdicts, cost against taxels, error of the models](speed_accuracy.png)

The cost and the error of computing how much spin torque a contact can still hold. Every method solves the same
contacts in the same run, contact after contact, so that other load on the machine affects all alike. An independent
computation, which shares no code with slipd, gives the true answers to 25 digits.

- **Top left**: time of one decision against the error of the limit, relative to the contact's own torque. The mark is
  the median, the line extends to the 99th percentile; no answer counts as the worst. Left and low is good; the bottom
  is correct to the last digit.
- **Top right**: share of contacts with a correct limit, with an error above {WRONG_TOLD}, and without an answer.
- **Middle**: wrong verdicts, false alarms to the left, sliding contacts classified as safe to the right; and the cost
  over the number of taxels. Dotted: cost proportional to taxels.
- **Bottom**: the error of image and model against the continuous contact, which no solver can remove.

Times are the best of {CALLS} calls, or of as many as fit in {LONGEST_S * 1e3:.0f} ms. The spins that get a verdict lie
between {shown(NEAREST_SPIN)} and 1 of the contact's own torque from the limit, or in the middle of the safe range if
that is nearer: verdicts far from the limit would flatter every method.
"""
