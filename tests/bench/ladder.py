"""Would a ladder pay: verdicts from the cheapest bound that settles them, exact utilisation only where none does?

No contact, which the daemon tells by itself; translation alone, which can settle only "unsafe"; the bounds of one pass,
where no threshold lies between them; exact. The ladder stands here and not in the daemon: it is put in the place of
its solver, run on the same events, and what it saves is told beside the most that any ladder could.
"""

from __future__ import annotations

import gc
import math
import statistics
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, TypeVar
from unittest.mock import patch

import numba
import numpy as np
from bench.replays import NEAR, SPREAD, Run, all_runs
from bench.tables import Cell, Table

from slipd.config import Config
from slipd.fusion import Utilisation, utilisation
from slipd.fusion.limit_kernels import KINDS, MAX_PASSES, Twist, solve_utilisation
from slipd.fusion.limit_surface import checked_pair, checked_taxels
from slipd.pipeline import engine as engine_module
from slipd.pipeline import finger
from slipd.pipeline.engine import Engine
from slipd.pipeline.events import Event, Output
from slipd.pipeline.finger import DECISION_GAP, ROTATION_SHARE, Finger, State
from slipd.pipeline.report import slip_body
from slipd.pipeline.warm_up import warm_up

ROUNDS, QUICK_ROUNDS = 7, 1
WORTH = 5.0
"""A ladder that saves less of the processor time goes, %."""

COUNTED, QUICK_COUNTED = 2000, 100
"""Decisions of a run whose passes are counted."""

LEAST_READINGS = 2000
"""A shorter run is replayed again within a round."""

TRANSLATION, ONE_PASS, EXACT = range(3)
RUNGS = ("translation", "one pass", "exact")
HEAD = ("run", "readings", "without contact", "decisions", *RUNGS, "levels differ", "reasons differ")
PASSES_HEAD = ("run", "counted", "mean", "median", "p99", "mean unstarted", "median unstarted", "p99 unstarted")
COST_HEAD = ("run", "µs a reading", "saved %", "least", "most")

VARIANTS = ("as it is", "the same again", "ladder", "one pass for all", "no solver")
AS_IT_IS, AGAIN, LADDER, ONE_PASS_ONLY, NO_SOLVER = VARIANTS
TURN = 200
"""Events, some 10 ms of work: what else the machine does falls on all variants alike."""

RUNGS_TOLD = (
    "Without contact: readings that need no friction limit, %. A rung: decisions in contact that it settles, %.",
    "Settled is the level, with its hysteresis and what a slip needs to be told. Reasons are then from bounds.",
    f"The loads of the walks use {NEAR:g} ± {SPREAD:g} of the friction; caution is at 0.70, warning at 0.85.",
)
PASSES_TOLD = f"To a gap of {DECISION_GAP:g}; as in the daemon, from the twist of the reading before, and unstarted."
COST_TOLD = (
    "The engine alone on the same events, without pace, recording and sockets. The same again: no difference at all.",
    "Ladder: what is published is exact. One pass for all: the most that bounds of one pass could save.",
    "No solver: the share of all utilisation, and the most that anything in its place could save.",
)

NO_START = (math.nan, math.nan, math.nan)

Solver = Callable[..., Utilisation]
Chosen = TypeVar("Chosen", bound=Solver)
Body = Callable[[Finger, int], dict[str, Any]]
Told = tuple[str, tuple[str, ...]]


@cache
def _kernel() -> Callable[..., Any]:
    """The whole ladder, compiled as the solver is; it starts again where one pass does not do."""

    @numba.njit(error_model="numpy")
    def climb(x, y, loads, mu, fx, fy, m, ax, ay, start, gap, unsafe, levels, turning):
        total = 0.0
        for load in loads:
            total += load
        translation = math.hypot(fx, fy) / (mu * total)
        if translation >= unsafe:
            return 0, (2, translation, translation, math.inf, math.nan, math.nan, fx, fy, 0.0)
        found = solve_utilisation(x, y, loads, mu, fx, fy, m, ax, ay, start, gap, 1)
        lower, upper = found[2], found[3]
        settled = lower * turning >= translation or upper * turning < translation
        for level in levels:
            settled = settled and (lower >= level or upper < level)
        if settled:
            return 1, found
        return 2, solve_utilisation(x, y, loads, mu, fx, fy, m, ax, ay, start, gap, MAX_PASSES)

    return climb


class Ladder:
    """Takes the place of `slipd.fusion.utilisation` in a finger.

    Whether a load is most of all spin, and whether a fall may be a slip, are thresholds of the verdict, too.

    Args:
        settings: The config of the run.

    Attributes:
        rungs: How often each has settled a verdict.
        newest: The one that settled the last.
    """

    def __init__(self, settings: Config) -> None:
        levels = settings.levels
        armed = {finger.slip.armed_at for finger in settings.finger.values()}
        reached = {levels.caution, levels.warning}
        self._thresholds = np.array(sorted(reached | {level - levels.hysteresis for level in reached} | armed))
        self._unsafe = levels.warning
        self._climb = _kernel()
        self.rungs: Counter[int] = Counter()
        self.newest = EXACT

    def __call__(self, x, y, loads, mu, tangential, spin, about, *, start=None, gap=DECISION_GAP):
        xs, ys, fs = checked_taxels(x, y, loads, mu)
        f, a = checked_pair("tangential", tangential), checked_pair("about", about)
        self.newest, found = self._climb(
            xs, ys, fs, mu, f[0], f[1], float(spin), a[0], a[1], start or NO_START, gap, self._unsafe, self._thresholds,
            ROTATION_SHARE,
        )  # fmt: skip
        self.rungs[self.newest] += 1
        kind, value, lower, upper, px, py, vx, vy, om = found
        pole = None if math.isnan(px) else np.array((px, py))
        return Utilisation(value, lower, upper, pole, KINDS[kind], (vx, vy, om))

    def slip_body(self, of: Finger, t_ns: int) -> dict[str, Any]:
        """What is published is exact: people and the grip policy need the pole and the limits."""
        state = of.state
        if self.newest != EXACT and state.utilisation is not None and state.loads is not None and state.contact:
            state.utilisation = utilisation(
                state.x, state.y, state.loads.loads, of.config.mu, state.contact.tangential_n,
                state.contact.spin_nm, state.contact.centroid_m, start=state.utilisation.twist, gap=DECISION_GAP,
            )  # fmt: skip
        return slip_body(of, t_ns)


class Witness(Engine):
    """An engine that keeps the verdict on every reading, not only on those that are published."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.told: list[Told] = []

    def _publish_state(self, of: Finger, state: State, out: list[Output]) -> None:
        self.told.append((state.verdict.level, state.verdict.reasons))
        super()._publish_state(of, state, out)


@dataclass
class Solved:
    """Every call of the solver in a run, with its answer: what is asked, and what costs nothing to say again."""

    calls: list[tuple[tuple[Any, ...], Twist | None]] = field(default_factory=list)
    answers: list[Utilisation] = field(default_factory=list)

    def __call__(self, *arguments: Any, start: Twist | None, gap: float) -> Utilisation:
        found = utilisation(*arguments, start=start, gap=gap)
        self.calls.append((arguments, start))
        self.answers.append(found)
        return found

    def again(self) -> Solver:
        """Gives the same answers in turn."""
        answers = iter(self.answers)
        return lambda *_, **__: next(answers)


def run(*, quick: bool = False) -> Iterator[Table]:
    """Measures."""
    warm_up()
    rounds = QUICK_ROUNDS if quick else ROUNDS
    rungs, passes = Table("Ladder: what settles a verdict", HEAD), Table("Ladder: passes of a decision", PASSES_HEAD)
    cost = Table("Ladder: processor time of a replay", COST_HEAD)
    for one in all_runs(quick=quick):
        solved = Solved()
        plain, _ = witnessed(one, solved)
        told, ladder = witnessed(one, Ladder(one.settings))
        rungs.rows.append((one.name, *_shares(plain, told, ladder)))
        passes.rows.append((one.name, *_passes(solved, QUICK_COUNTED if quick else COUNTED)))
        cost.rows += [(f"{one.name}: {name}", *cells) for name, cells in _costs(one, solved, rounds, len(plain))]
    rungs.notes += RUNGS_TOLD
    passes.notes.append(PASSES_TOLD)
    cost.notes += [*COST_TOLD, f"{rounds} rounds, in which all take turns every {TURN} events.", _judgement(cost)]
    yield rungs
    yield passes
    yield cost


def witnessed(one: Run, solver: Chosen) -> tuple[list[Told], Chosen]:
    """The verdict on every reading of a run with a solver in place, and the solver."""
    engine = one.engine(Witness)
    with patch.object(finger, "utilisation", solver):
        for t_ns, event in one.events:
            engine.handle(event, t_ns)
    return engine.told, solver


def _shares(plain: list[Told], told: list[Told], ladder: Ladder) -> list[Cell]:
    decisions = max(1, ladder.rungs.total())
    free = sum(level == "no_contact" for level, _ in plain)
    pairs = list(zip(plain, told, strict=True))
    return [
        len(plain),
        100.0 * free / len(plain),
        decisions,
        *(100.0 * ladder.rungs[rung] / decisions for rung in (TRANSLATION, ONE_PASS, EXACT)),
        sum(a[0] != b[0] for a, b in pairs),
        sum(a[0] == b[0] and a[1] != b[1] for a, b in pairs),
    ]


def _passes(solved: Solved, most: int) -> list[Cell]:
    """Median, 99th percentile and mean of the passes, started from the reading before and from nothing."""
    chosen = solved.calls[:: max(1, len(solved.calls) // most)]
    counted = [[_count(arguments, start) for arguments, start in chosen], [_count(a, None) for a, _ in chosen]]
    return [len(chosen), *(cell for n in counted for cell in (float(np.mean(n)), *np.percentile(n, (50, 99)).tolist()))]


def _count(arguments: tuple[Any, ...], start: Twist | None) -> int:
    """The least passes with which the answer is the one of any number of them."""

    def bounds(passes: int) -> tuple[float, float, float]:
        found = utilisation(*arguments, start=start, gap=DECISION_GAP, passes=passes)
        return found.value, found.lower, found.upper

    whole = bounds(MAX_PASSES)
    return next((passes for passes in range(1, MAX_PASSES) if bounds(passes) == whole), MAX_PASSES)


def _costs(one: Run, solved: Solved, rounds: int, readings: int) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Of every variant: median time of a reading, µs; median, least and most of what it saves, %."""
    repeats = -(-LEAST_READINGS // readings) if rounds > 1 else 1
    took_s: dict[str, list[float]] = {name: [] for name in VARIANTS}
    for _ in range(rounds):
        replays = [_replayed_s(one, solved) for _ in range(repeats)]
        for name, times in took_s.items():
            times.append(sum(replay[name] for replay in replays))
    for name, times in took_s.items():
        saved = [100.0 * (1.0 - b / a) for a, b in zip(took_s[AS_IT_IS], times, strict=True)]
        each_us = 1e6 * statistics.median(times) / (readings * repeats)
        yield name, (each_us, statistics.median(saved), min(saved), max(saved))


def _replayed_s(one: Run, solved: Solved) -> dict[str, float]:
    """Processor time of the whole run by variant, s: all take turns every few events, and the first turn goes round."""
    engines = {name: one.engine() for name in VARIANTS}
    places = _places(one, solved)
    took_s, turn = dict.fromkeys(VARIANTS, 0.0), deque(VARIANTS)
    gc.collect()
    gc.disable()
    try:
        for begin in range(0, len(one.events), TURN):
            events = one.events[begin : begin + TURN]
            for name in turn:
                with _in_place(*places[name]):
                    took_s[name] += _handled_s(engines[name], events)
            turn.rotate()
    finally:
        gc.enable()
    return took_s


def _places(one: Run, solved: Solved) -> dict[str, tuple[Solver, Body]]:
    ladder = Ladder(one.settings)
    return {
        AS_IT_IS: (utilisation, slip_body),
        AGAIN: (utilisation, slip_body),
        LADDER: (ladder, ladder.slip_body),
        ONE_PASS_ONLY: (partial(utilisation, passes=1), slip_body),
        NO_SOLVER: (solved.again(), slip_body),
    }


@contextmanager
def _in_place(solver: Solver, body: Body) -> Iterator[None]:
    with patch.object(finger, "utilisation", solver), patch.object(engine_module, "slip_body", body):
        yield


def _handled_s(engine: Engine, events: list[tuple[int, Event]]) -> float:
    begin_s = time.process_time()
    for t_ns, event in events:
        engine.handle(event, t_ns)
    return time.process_time() - begin_s


def _judgement(cost: Table) -> str:
    """Whether the ladder is worth its place."""
    saved = [float(row[2]) for row in cost.rows if str(row[0]).endswith(LADDER)]
    least, most = min(saved), max(saved)
    outcome = "it stays out" if most < WORTH else "IT SHOULD STAND IN THE DAEMON"
    return f"A ladder must save {WORTH:g} %; this one saves {least:.1f} to {most:.1f} %: {outcome}."
