"""Import and replay the runs of pushes in the tree, and score what slipd reports."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from project import CONFIG, DATA
from realdata.score import Course, Score, oracle, score, tremor
from realdata.truth import PUSHED_N, Motion, Span, motion

from slipd.recording.reader import EventGaps, open_recording
from slipd.recording.replay import replay
from slipd.tools.evaluation.config_run import LevelSpan, level_spans
from slipd.tools.recordings.imported_run import START_NS
from slipd.tools.recordings.pushes_import import LIFTED_NS, Pushes, import_pushes, read_pushes

RUNS = DATA / "pushes" / "runs"
MASS_KG = 0.15
FINGER = "support"
START_S = (START_NS + LIFTED_NS) * 1e-9
LEVELS = {"slipping": {"slipping"}, "warning or slipping": {"warning", "slipping"}}


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What slipd reported on one run.

    Attributes:
        name: Its name.
        motion: What the object did.
        scores: By set of levels, and the oracle's.
        at_onset: Utilisation at each onset.
        learned: μ in use at the end, over the median friction that the slides required.
        evidence: How often each kind of evidence was named in spans of "slipping".
    """

    name: str
    motion: Motion
    scores: dict[str, Score]
    at_onset: list[float]
    learned: float
    evidence: dict[str, int]


def measure(folder: Path = RUNS, names: Iterable[str] = (), config_text: str | None = None) -> list[Run]:
    """Import, replay and score the runs that ``runs.csv`` of a folder names, or some of them.

    Raises:
        SlipdError: A run cannot be imported or replayed.
    """
    chosen, text = set(names), config_text or (CONFIG / "pushes.toml").read_text(encoding="utf-8")
    with (folder / "runs.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if not chosen or row["run"] in chosen]
    return [_measure(folder, row, text) for row in rows]


def _measure(folder: Path, row: dict[str, str], text: str) -> Run:
    source = folder / row.get("file", f"{row['run']}.npz")
    clear_s = float(row["clear_begin_s"]), float(row["clear_end_s"])
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "run.mcap"
        import_pushes(source, path, text, MASS_KG, clear_s)
        messages = list(replay(open_recording(path)))
    pushes = read_pushes(source)
    moved, course = motion(pushes), _course(messages)
    pressed = [_is_pressed(pushes, rest, clear_s) for rest in moved.rests]
    spans = level_spans(messages, EventGaps())[FINGER]
    scores = {name: score(moved, _reports(spans, levels), pressed) for name, levels in LEVELS.items()}
    for name, signal in (("load", course.required), ("tremor of the load", tremor(course))):
        scores[f"oracle: best limit on the {name}"] = oracle(moved, course.time_s, signal, pressed)
    onsets = [float(np.interp(slide.begin_s, course.time_s, course.utilisation)) for slide in moved.slides]
    sliding = np.any([(course.time_s > s.begin_s) & (course.time_s < s.end_s) for s in moved.slides], axis=0)
    learned = float(course.mu[-1] / np.median(course.required[sliding]))
    evidence: dict[str, int] = {}
    for span in spans:
        for kind in span.evidence if span.level == "slipping" else ():
            evidence[kind] = evidence.get(kind, 0) + 1
    return Run(row["run"], moved, scores, onsets, learned, evidence)


def _reports(spans: list[LevelSpan], levels: set[str]) -> list[Span]:
    return [Span(span.begin_s - START_S, span.end_s - START_S) for span in spans if span.level in levels]


def _course(messages: list[tuple[str, dict[str, Any]]]) -> Course:
    bodies = [body for topic, body in messages if topic == f"slip.{FINGER}"]
    columns = [
        [np.nan if body[key] is None else float(body[key]) for body in bodies]
        for key in ("timestamp", "utilisation", "required_friction", "mu")
    ]
    time_s, used, required, mu = np.array(columns)
    known = np.isfinite(used) & np.isfinite(required)
    return Course(time_s[known] - START_S, used[known], required[known], mu[known])


def _is_pressed(pushes: Pushes, rest: Span, clear_s: tuple[float, float]) -> bool:
    time_s, force = pushes.wrench[:, 0], pushes.wrench[:, 1:3]
    zero = force[(time_s >= clear_s[0]) & (time_s <= clear_s[1])].mean(axis=0)
    during = force[(time_s >= rest.begin_s) & (time_s <= rest.end_s)]
    return bool(np.hypot(*(during.mean(axis=0) - zero)) > PUSHED_N)
