"""The friction limit beside what a user could call instead, and beside the same algorithm in C, in one run.

Every round asks each of them of the same contacts in turn, so that what else the machine does meets all alike. Ratios
are of a round's times; the median and both ends of the rounds are told.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from bench.alternatives import FLAGS, NATIVE, InC, compiled_c, hybr, plain_hybr
from bench.tables import Table
from chart.scenes import COLS, MU, PITCH_M, ROWS, Scene, grid, ordinary, scene

from slipd.compile_kernels import warm_up
from slipd.fusion import TorqueLimit, torque_limit, torque_limits, utilisation, utilisations
from slipd.types.arrays import Array

ROUNDS, CASES, REPEATS, CALLS = 9, 256, 8, 5000
QUICK_ROUNDS, QUICK_CASES, QUICK_REPEATS, QUICK_CALLS = 2, 16, 1, 200
"""Repeats: of the fast ones in a round, so that each is timed for some milliseconds."""

SEED = 20
BEYOND = 1.2
"""Spins reach so many times the limit."""

WRONG = 1e-6
"""Of the contact's own torque: more is a wrong answer."""

FRAMES_OF_A_TURN = 2_000
"""The force of the moving scene turns once in so many frames: 2 s at 1000 readings/s."""

Times = dict[str, list[float]]
"""What was timed → µs for each contact, round by round."""

Call = Callable[[], dict[str, float]]


@dataclass(frozen=True, slots=True)
class Contacts:
    """The same contacts one by one, active taxels only, and as images for a batch, shapes (frames, taxels)."""

    name: str
    scenes: list[Scene]
    spins: list[float]
    x: Array
    y: Array
    loads: Array
    tangential: Array
    about: Array

    @classmethod
    def of(cls, name: str, scenes: list[Scene], rng: np.random.Generator) -> Contacts:
        x, y = grid()
        loads = np.zeros((len(scenes), x.size))
        for image, one in zip(loads, scenes, strict=True):
            col, row = np.rint(one.x / PITCH_M + (COLS - 1) / 2), np.rint(one.y / PITCH_M + (ROWS - 1) / 2)
            image[(row * COLS + col).astype(int)] = one.loads
        limits = [torque_limit(s.x, s.y, s.loads, s.mu, s.tangential, s.about).torque_nm for s in scenes]
        spins = (np.array(limits) * rng.uniform(-BEYOND, BEYOND, len(scenes))).tolist()
        tangential, about = np.array([s.tangential for s in scenes]), np.array([s.about for s in scenes])
        return cls(name, scenes, spins, x, y, loads, tangential, about)


def run(folder: Path, *, quick: bool = False) -> Iterator[Table]:
    """Measures; the figures first. The C program is built in ``folder``."""
    warm_up()
    rounds, cases = (QUICK_ROUNDS, QUICK_CASES) if quick else (ROUNDS, CASES)
    repeats = QUICK_REPEATS if quick else REPEATS
    ratios = Table("Friction limit: ratios", ("figure", "contacts", "median", "least", "most", "wanted", "reached"))
    times = Table("Friction limit: times, µs", ("call", "contacts", "median", "least", "most"))
    rng, in_c, with_clarabel = np.random.default_rng(SEED), compiled_c(folder), find_spec("clarabel") is not None
    for contacts in _sets(cases, rng):
        timed = _timed(_calls(contacts, repeats, in_c, with_clarabel=with_clarabel), rounds)
        ratios.rows += _figures(contacts.name, timed)
        times.rows += [(call, contacts.name, *_spread(took_us)) for call, took_us in timed.items()]
        ratios.notes.append(_told(contacts, in_c))
    ratios.notes += [
        f"{rounds} rounds of {cases} contacts each; a ratio is of the times of one round.",
        "hybr: SciPy's root on eq. (5) in NumPy and metres, from C; with Jacobian: and in the contact's own units.",
        "Clarabel: the cone form over pole and distances, in the contact's units; its solve alone, and with set-up.",
        "torque_limits and utilisations: one call on whole images, with their zeros; others get active taxels only.",
    ]
    ratios.notes += [f"C: cc {' '.join(FLAGS)}; for this processor: {' '.join(NATIVE)}, too."] if in_c else []
    ratios.notes += [] if in_c else ["C is not measured: no C compiler named cc is here."]
    ratios.notes += [] if with_clarabel else ["Clarabel is not measured: it is not installed (pip install '.[chart]')."]
    times.notes.append("For each contact; compiled before, as in the daemon.")
    yield ratios
    yield times
    yield _one_call(_full_image(rng), QUICK_CALLS if quick else CALLS)


def _sets(cases: int, rng: np.random.Generator) -> Iterator[Contacts]:
    yield Contacts.of("full image", [_full_image(rng) for _ in range(cases)], rng)
    yield Contacts.of("ordinary", [ordinary(rng) for _ in range(cases)], rng)


def _full_image(rng: np.random.Generator) -> Scene:
    """Every taxel loaded: a patch larger than the pad, gains with noise."""
    x, y = grid()
    u, v = (x - rng.uniform(-0.01, 0.01)) / 0.05, (y - rng.uniform(-0.005, 0.005)) / 0.03
    loads = (1.0 - u * u - v * v) * rng.normal(1.0, 0.05, x.size).clip(0.5)
    return scene("full image", rng, x, y, loads * rng.uniform(1.0, 40.0) / loads.sum(), math.sqrt(rng.random()))


def _moving(frames: int) -> list[tuple[Scene, float]]:
    """A full image whose force turns and whose spin sways."""
    x, y = grid()
    loads = 1.0 - (x / 0.05) ** 2 - (y / 0.03) ** 2
    found = []
    for frame in range(frames):
        phase = 2.0 * math.pi * frame / FRAMES_OF_A_TURN
        size = MU * loads.sum() * (0.5 + 0.3 * math.sin(3.0 * phase))
        force = size * np.array((math.cos(phase), math.sin(phase)))
        moved = loads * (1.0 + 20.0 * x * math.sin(phase))
        about = np.array((moved @ x, moved @ y)) / moved.sum()
        found.append((Scene("moving", x, y, moved, MU, force, about), 0.004 * loads.sum() * math.sin(2.0 * phase)))
    return found


def _timed(calls: list[Call], rounds: int) -> Times:
    for call in calls:
        call()
    timed: Times = {}
    for _ in range(rounds):
        for call in calls:
            for name, took_us in call().items():
                timed.setdefault(name, []).append(took_us)
    return timed


def _calls(contacts: Contacts, repeats: int, in_c: dict[str, InC], *, with_clarabel: bool) -> list[Call]:
    """Each runs all contacts and tells µs for one."""
    x, y = contacts.x, contacts.y
    loads, tangential, about = (np.tile(a, (repeats, 1)) for a in (contacts.loads, contacts.tangential, contacts.about))
    images = x, y, loads, MU, tangential, about
    spun = x, y, loads, MU, tangential, np.tile(np.array(contacts.spins), repeats), about
    once = list(zip(contacts.scenes, contacts.spins, strict=True))
    again = once * repeats
    calls = [
        _clock("torque_limits", len(loads), partial(torque_limits, *images)),
        *(_clock(name, len(loads), partial(work.limits, *images, 1)) for name, work in in_c.items()),
        _clock("utilisations", len(loads), partial(utilisations, *spun)),
        *(_clock(f"{name}, utilisations", len(loads), partial(work.uses, *spun)) for name, work in in_c.items()),
        _clock("torque_limits, one pass", len(loads), partial(torque_limits, *images, passes=1)),
        _clock("torque_limit", len(again), lambda: _each(_limit, again)),
        _clock("utilisation", len(again), lambda: _each(_use, again)),
        _clock("torque_limit, one pass", len(again), lambda: _each(_one_pass, again)),
        _clock("hybr", len(once), lambda: _each(lambda one, _: plain_hybr(one), once)),
        _clock("hybr with Jacobian", len(once), lambda: _each(lambda one, _: hybr(one), once)),
    ]
    if contacts.name == "full image":
        moving = _moving(len(again))
        calls += [
            _clock("utilisation, moving, cold", len(moving), lambda: _each(_use, moving)),
            _clock("utilisation, moving, warm", len(moving), lambda: _warm(moving)),
        ]
    return [*calls, partial(_clarabel, contacts.scenes)] if with_clarabel else calls


def _clock(name: str, contacts: int, work: Callable[[], object]) -> Call:
    def once() -> dict[str, float]:
        begin_ns = time.perf_counter_ns()
        work()
        return {name: (time.perf_counter_ns() - begin_ns) * 1e-3 / contacts}

    return once


def _clarabel(scenes: list[Scene]) -> dict[str, float]:
    from chart.rivals.cone import limit, solver_seconds

    begin_ns = time.perf_counter_ns()
    for one in scenes:
        limit(one)
    took_us = (time.perf_counter_ns() - begin_ns) * 1e-3
    inside_us = 1e6 * sum(map(solver_seconds, scenes))
    return {"Clarabel, solve": inside_us / len(scenes), "Clarabel, with set-up": took_us / len(scenes)}


def _each(use: Callable[[Scene, float], object], cases: list[tuple[Scene, float]]) -> None:
    for one, spin in cases:
        use(one, spin)


def _one_call(one: Scene, count: int) -> Table:
    """How long single calls take at most, as the daemon makes them on every force reading."""
    table = Table("Friction limit: one public call", ("call", "active taxels", "calls", "p50 µs", "p99 µs"))
    spin = 0.5 * _limit(one, 0.0).torque_nm
    for name, use in (("utilisation", _use), ("torque_limit", _limit)):
        took_us = []
        for _ in range(count):
            begin_ns = time.perf_counter_ns()
            use(one, spin)
            took_us.append((time.perf_counter_ns() - begin_ns) * 1e-3)
        table.rows.append((name, one.x.size, count, float(np.median(took_us)), float(np.percentile(took_us, 99))))
    return table


def _limit(one: Scene, _: float) -> TorqueLimit:
    return torque_limit(one.x, one.y, one.loads, one.mu, one.tangential, one.about)


def _one_pass(one: Scene, _: float) -> object:
    return torque_limit(one.x, one.y, one.loads, one.mu, one.tangential, one.about, passes=1)


def _use(one: Scene, spin: float) -> object:
    return utilisation(one.x, one.y, one.loads, one.mu, one.tangential, spin, one.about)


def _warm(moving: list[tuple[Scene, float]]) -> None:
    twist = (math.nan, math.nan, math.nan)
    for one, spin in moving:
        found = utilisation(one.x, one.y, one.loads, one.mu, one.tangential, spin, one.about, start=twist)
        twist = found.twist


FIGURES = (
    ("hybr / torque_limits", "hybr", "torque_limits", "at least", 100.0),
    ("hybr with Jacobian / torque_limits", "hybr with Jacobian", "torque_limits", "at least", 100.0),
    ("Clarabel's solve / torque_limits", "Clarabel, solve", "torque_limits", "at least", 100.0),
    ("Clarabel with set-up / torque_limits", "Clarabel, with set-up", "torque_limits", "", 0.0),
    ("torque_limits / C", "torque_limits", "C", "at most", 1.3),
    ("utilisations / C", "utilisations", "C, utilisations", "at most", 1.3),
    ("torque_limits / C for this processor", "torque_limits", "C, native", "", 0.0),
    ("utilisations / C for this processor", "utilisations", "C, native, utilisations", "", 0.0),
    ("hybr / torque_limit", "hybr", "torque_limit", "at least", 30.0),
    ("hybr with Jacobian / torque_limit", "hybr with Jacobian", "torque_limit", "at least", 30.0),
    ("utilisations / torque_limits", "utilisations", "torque_limits", "at most", 2.0),
    ("utilisation / torque_limit", "utilisation", "torque_limit", "at most", 2.0),
    ("one pass / all, torque_limits", "torque_limits, one pass", "torque_limits", "at most", 0.5),
    ("one pass / all, torque_limit", "torque_limit, one pass", "torque_limit", "at most", 0.5),
    ("utilisation of a moving scene, warm / cold", "utilisation, moving, warm", "utilisation, moving, cold", "", 0.0),
)
CALL_COST_US = 6.0


def _figures(contacts: str, timed: Times) -> Iterator[tuple[str | float, ...]]:
    for figure, above, below, bound, wanted in FIGURES:
        missing = [name for name in (above, below) if name not in timed]
        if not missing:
            found = [a / b for a, b in zip(timed[above], timed[below], strict=True)]
            yield (figure, contacts, *_spread(found), *_reached(float(np.median(found)), bound, wanted))
        elif "moving" not in missing[0]:
            yield (figure, contacts, *("not measured",) * 3, f"{bound} {wanted:g}" if bound else "", "")
    if "C" in timed and contacts == "full image":
        found = [a - b for a, b in zip(timed["torque_limit"], timed["C"], strict=True)]
        figure = "torque_limit less C, µs"
        yield (figure, contacts, *_spread(found), *_reached(float(np.median(found)), "at most", CALL_COST_US))


def _reached(median: float, bound: str, wanted: float) -> tuple[str, str]:
    if not bound:
        return "", ""
    reached = median >= wanted if bound == "at least" else median <= wanted
    return f"{bound} {wanted:g}", "yes" if reached else "no"


def _spread(values: list[float]) -> tuple[float, float, float]:
    return float(np.median(values)), min(values), max(values)


def _told(contacts: Contacts, in_c: dict[str, InC]) -> str:
    """How many taxels there were, whether the batch and C say the same, and how often hybr is right."""
    scale = np.array([one.torque_scale_nm for one in contacts.scenes])
    right = np.array([_limit(one, 0.0).torque_nm for one in contacts.scenes])
    problem = contacts.x, contacts.y, contacts.loads, MU, contacts.tangential, contacts.about
    others = {"torque_limits": torque_limits(*problem).torque_nm}
    others |= {name: work.limits(*problem, 1)[:, 0] for name, work in in_c.items()}
    agree = ", ".join(f"{name} to {np.max(np.abs(found - right) / scale):.0e}" for name, found in others.items())
    wrong = [
        int((~(np.abs(np.array([find(one) for one in contacts.scenes]) - right) <= WRONG * scale)).sum())
        for find in (plain_hybr, hybr)
    ]
    taxels = np.median([one.x.size for one in contacts.scenes])
    return (
        f"{contacts.name}: {taxels:.0f} active taxels of {contacts.x.size} in the median; agree with torque_limit, of "
        f"the contact's torque: {agree}; wrong by more than {WRONG:g} of it: hybr {wrong[0]} of {scale.size}, with "
        f"Jacobian {wrong[1]}."
    )
