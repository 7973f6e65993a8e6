"""Score slipd on trials whose samples are labelled, from published sets that lie on your disk.

    PYTHONPATH=tests/support:benchmarks python -m realdata.labelled arq FILE.h5 EXPERIMENT …
    PYTHONPATH=tests/support:benchmarks python -m realdata.labelled papillarray FILE.csv …

Printed are, for each set of levels, over all trials: labelled slips that a report names by 50 ms after their begin and
at all, the share of labelled slip time that is reported, and the share of the other time in which the level is reported
although no slip is labelled. ``--config FILE`` replaces the shipped config.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from project import CONFIG
from realdata.runs import LEVELS
from realdata.score import AHEAD_S, NEAR_S, overlap_s
from realdata.truth import Span, spans_where

from slipd.errors import SlipdError
from slipd.recording.reader import EventGaps, open_recording
from slipd.recording.replay import replay
from slipd.tools.evaluation.config_run import level_spans
from slipd.tools.recordings.imported_run import START_NS
from slipd.tools.recordings.taxels_import import TaxelTrial, import_taxels, read_arq, read_papillarray


def score_trial(trial: TaxelTrial, config_text: str) -> dict[str, np.ndarray]:
    """Return by set of levels: slips, those reported by 50 ms, those reported at all; slip time, reported; other time,
    reported; shape (7,), s.
    """
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "trial.mcap"
        import_taxels(trial, path, config_text)
        reported = [span for spans in level_spans(replay(open_recording(path)), EventGaps()).values() for span in spans]
    slips = spans_where(trial.time_s, trial.slips)
    slip_s = sum(slip.seconds for slip in slips)
    other_s = float(trial.time_s[-1]) - slip_s
    found = {}
    for name, levels in LEVELS.items():
        begin_s = START_NS * 1e-9
        reports = [
            Span(span.begin_s - begin_s, min(span.end_s - begin_s, float(trial.time_s[-1])))
            for span in reported
            if span.level in levels
        ]
        soon = sum(_named(slip.begin_s - AHEAD_S, slip.begin_s + NEAR_S, reports) for slip in slips)
        ever = sum(_named(slip.begin_s - AHEAD_S, slip.end_s, reports) for slip in slips)
        right_s = sum(overlap_s(slip, report) for slip in slips for report in reports)
        wrong_s = sum(report.seconds for report in reports) - right_s
        found[name] = np.array([len(slips), soon, ever, slip_s, right_s, other_s, wrong_s])
    return found


def _named(begin_s: float, end_s: float, reports: list[Span]) -> bool:
    return any(report.begin_s <= end_s and report.end_s >= begin_s for report in reports)


def main(argv: list[str] | None = None) -> int:
    """Score all trials and print the figures; return 1 if one cannot be read, else 0."""
    parser = argparse.ArgumentParser(prog="python -m realdata.labelled", description="Score slipd on labelled trials.")
    parser.add_argument("set", choices=["arq", "papillarray"])
    parser.add_argument("words", nargs="+", metavar="FILE", help="arq: a file and its experiments; else: files")
    parser.add_argument("--config", type=Path, metavar="FILE", help="default: the shipped config of the set")
    options = parser.parse_args(argv)
    first, *rest = options.words
    reads: list[Callable[[], TaxelTrial]] = [partial(read_papillarray, Path(word)) for word in options.words]
    if options.set == "arq":
        reads = [partial(read_arq, Path(first), experiment) for experiment in rest]
    name = {"arq": "trial_arq.toml", "papillarray": "trial_papillarray.toml"}[options.set]
    text = (options.config or CONFIG / name).read_text(encoding="utf-8")
    try:
        scores = [score_trial(read(), text) for read in reads]
    except SlipdError as error:
        print(f"realdata.labelled: {error}", file=sys.stderr)
        return 1
    for levels in LEVELS:
        slips, soon, ever, slip_s, right_s, other_s, wrong_s = sum((score[levels] for score in scores), np.zeros(7))
        print(
            f"{levels}: {soon:.0f} of {slips:.0f} slips by {1e3 * NEAR_S:.0f} ms, {ever:.0f} at all; "
            f"{right_s:.2f} of {slip_s:.2f} s of slip; {wrong_s:.2f} of {other_s:.2f} s without one"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
