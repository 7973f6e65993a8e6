"""Every method on the same scenes in the same run: time, error, failures and verdicts of each."""

from __future__ import annotations

import math
import multiprocessing
import os
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from time import perf_counter_ns

import numpy as np
from chart.methods import METHODS, Method, ask, verdict
from chart.reference import exact_limit
from chart.rivals import models
from chart.scenes import Scene, draw
from numpy.typing import NDArray

from slipd.fusion import torque_limit
from slipd.types.arrays import Array

WRONG, WRONG_TOLD = 1e-6, "1e-6"
"""Of the contact's own torque: an error above this is told as wrong."""

CALLS, LONGEST_S = 3, 10e-3
"""Of the calls the best is taken; no more are made once they have taken this long together."""

NEAREST_SPIN = 1e-4
"""The spins of the verdicts lie this part of the contact's own torque, to all of it, from the limit."""


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """A scene with the right answer, and a spin that is measured on it."""

    scene: Scene
    limit_nm: float
    spin_nm: float
    is_safe: bool


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """What one method made of all questions; every array has shape (questions,).

    Attributes:
        method: The method.
        seconds: Time of a decision.
        error: |limit − right limit| over the contact's own torque; NaN where it gave no answer.
        failure: "" where it answered, else how it failed.
        unsafe: It called a sliding contact safe.
        alarm: It called a safe contact sliding.
        silent: It gave no verdict.
    """

    method: Method
    seconds: Array
    error: Array
    failure: NDArray[np.str_]
    unsafe: NDArray[np.bool_]
    alarm: NDArray[np.bool_]
    silent: NDArray[np.bool_]

    def of(self, some: NDArray[np.bool_]) -> Score:
        """The same of some questions only."""
        return Score(
            self.method,
            *(a[some] for a in (self.seconds, self.error, self.failure, self.unsafe, self.alarm, self.silent)),
        )

    @property
    def no_answer(self) -> NDArray[np.bool_]:
        """It gave no limit, or raised."""
        return np.isnan(self.error)

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """It gave a limit that is wrong by more than ``WRONG``."""
        return self.error > WRONG

    def quantile(self, q: float, *, failures: bool = False) -> float:
        """Of the error, of the scenes that it answered; or of all, a failure counting as the worst."""
        error = np.where(self.no_answer, np.inf, self.error) if failures else self.error[~self.no_answer]
        return float(np.quantile(error, q, method="higher")) if error.size else math.nan


def questions(count: int) -> list[Question]:
    """The first ``count`` scenes; contacts of one point, whose scale is 0, and those without a limit are left out."""
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        limits = list(pool.map(_reference, range(count), chunksize=8))
    found = [_question(seed, limit) for seed, limit in enumerate(limits)]
    return [question for question in found if question is not None]


def scores(asked: Sequence[Question], methods: Sequence[Method] = METHODS) -> list[Score]:
    """All methods on one scene, then on the next: whatever else the machine does meets all alike."""
    shape = (len(methods), len(asked))
    seconds, error = np.zeros(shape), np.zeros(shape)
    failure = np.empty(shape, dtype="U32")
    judged = np.zeros((3, *shape), dtype=bool)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # methods divide by zero on the way
        for method in methods:
            ask(method, asked[0].scene)  # compiles and fills tables before any time is taken
        for column, question in enumerate(asked):
            models.felt_torque(question.scene)  # measured beforehand, by its meaning
            for row, method in enumerate(methods):
                at = row, column
                limit, seconds[at], failure[at] = timed(method, question.scene)
                error[at] = _error(limit, question)
                safe = _verdict(method, question, limit)
                judged[(slice(None), *at)] = (
                    safe is True and not question.is_safe,
                    safe is False and question.is_safe,
                    safe is None,
                )
    return [Score(m, seconds[k], error[k], failure[k], *judged[:, k]) for k, m in enumerate(methods)]


def _reference(seed: int) -> float:
    scene = draw(seed)
    return exact_limit(scene) if scene.torque_scale_nm > 0.0 else math.nan


def _question(seed: int, limit: float) -> Question | None:
    """Half the spins are below the limit, but above that of the other sense; half above."""
    scene = draw(seed)
    if math.isnan(limit):
        return None
    rng = np.random.default_rng((seed, 1))
    away = scene.torque_scale_nm * 10.0 ** rng.uniform(math.log10(NEAREST_SPIN), 0.0)
    other = torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about, sense=-1)
    is_safe = bool(rng.random() < 0.5)
    if is_safe:
        away = -min(away, 0.5 * max(limit + other.torque_nm, 0.0))
    return Question(scene, limit, limit + away, is_safe)


def timed(method: Method, scene: Scene) -> tuple[float, float, str]:
    """The limit, the time of a decision in s, and how it failed."""
    seconds, spent = math.inf, 0.0
    for _ in range(CALLS):
        start = perf_counter_ns()
        limit, failure = ask(method, scene)
        taken = (perf_counter_ns() - start) / 1e9
        seconds, spent = min(seconds, taken), spent + taken
        if spent > LONGEST_S:
            break
    if method.time_s is not None and not failure:
        seconds = min(method.time_s(scene) for _ in range(CALLS))
    return limit, seconds, failure


def _error(limit: float, question: Question) -> float:
    return abs(limit - question.limit_nm) / question.scene.torque_scale_nm


def _verdict(method: Method, question: Question, limit: float) -> bool | None:
    if method.safe is not None:
        return verdict(method, question.scene, question.spin_nm)
    return None if math.isnan(limit) else question.spin_nm <= limit
