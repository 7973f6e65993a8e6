"""Fit the weights of a posterior so that each slip is found early, and no grasp is reported falsely.

A slip counts as found by its best look within 1.5 mm of sliding, and a grasp as quiet by its worst look outside slips:
a smooth maximum over the looks of each goes into a logistic loss, in which all slips together weigh half as much as all
grasps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from fit.posterior import SOURCES, Looks
from fit.record import Grasp
from fit.score import EARLY_S, LATE_S
from numpy.typing import NDArray
from scipy.optimize import minimize

from slipd.types.arrays import Array

SOON_M = 1.5e-3
"""A slip is to be found within this way,"""
LEAST_M, MOST_RATIO = 5e-4, 0.94
"""if it goes at least so far, and μ_d / μ_s is at most this."""
SEEN_S = (0.003, 0.02)
"""A slip shows from the first time after its onset on, and at least until the second, s."""
SHARPNESS = 5.0
"""Of the smooth maximum, per nat."""
FALSE = 2.0
"""Weight of all grasps, that of all slips being 1."""
RIDGE = 1e-4
THRESHOLD = 0.5
"""Log-odds from which on slip is reported."""
HELD_S = 0.25
"""A report lasts at least so long, s."""


class Bags(NamedTuple):
    """Looks in bags: sources, shape (n, 27); looks of each bag, shape (m,); whether a bag is a slip, shape (m,)."""

    sources: Array
    counts: NDArray[np.int64]
    slip: NDArray[np.bool_]


def bags(data: Sequence[tuple[Grasp, Looks]]) -> Bags:
    """Return a bag for the looks in which each grasp does not slide, and one for each slip that is to be found."""
    parts: list[Array] = []
    slip: list[bool] = []
    for grasp, (t_s, sources) in data:
        quiet = np.ones(len(t_s), bool)
        for begin, end in grasp.episodes:
            quiet &= ~((t_s >= begin - EARLY_S) & (t_s <= end + LATE_S))
        chosen = [(quiet, False), *((_soon(grasp, t_s, *episode), True) for episode in grasp.episodes.tolist())]
        for inside, is_slip in chosen:
            if inside.any():
                parts.append(sources[inside])
                slip.append(is_slip)
    return Bags(np.concatenate(parts), np.array([len(one) for one in parts]), np.array(slip))


def _soon(grasp: Grasp, t_s: Array, begin: float, end: float) -> NDArray[np.bool_]:
    """Return which looks are soon after the onset of a slip; none of one that is not to be found."""
    way, times = grasp.way_m, grasp.truth[:, 0]
    start, slid = np.interp((begin, end), times, way)
    if slid - start < LEAST_M or grasp.ratio > MOST_RATIO:
        return np.zeros(len(t_s), bool)
    until = max(min(end, float(np.interp(start + SOON_M, way, times))), begin + SEEN_S[1])
    return np.asarray((t_s > begin + SEEN_S[0]) & (t_s <= until))


def fit(data: Bags, use: NDArray[np.bool_] | None = None) -> Array:
    """Return the weights of the sources, nats; 0 for those that are not used."""
    mask = np.ones(len(SOURCES)) if use is None else use.astype(float)
    starts = np.concatenate([[0], np.cumsum(data.counts)[:-1]])
    weight = _weights(data)

    def loss(weights: Array) -> tuple[float, Array]:
        odds = data.sources @ (weights * mask)
        most = np.maximum.reduceat(odds, starts)
        scaled = np.exp(SHARPNESS * (odds - np.repeat(most, data.counts)))
        total = np.add.reduceat(scaled, starts)
        of_bag = most + np.log(total) / SHARPNESS
        slope = weight * (1.0 / (1.0 + np.exp(-of_bag)) - data.slip)
        gradient = data.sources.T @ (scaled / np.repeat(total, data.counts) * np.repeat(slope, data.counts))
        value = (weight * np.logaddexp(0.0, np.where(data.slip, -of_bag, of_bag))).sum() + RIDGE * (weights @ weights)
        return float(value), (gradient + 2.0 * RIDGE * weights) * mask

    found = minimize(loss, np.zeros(len(SOURCES)), jac=True, method="L-BFGS-B", options={"maxiter": 500})
    return np.asarray(found.x * mask)


def loss_of(data: Bags, weights: Array) -> float:
    """Return the loss of weights on bags, with the true maximum."""
    starts = np.concatenate([[0], np.cumsum(data.counts)[:-1]])
    most = np.maximum.reduceat(data.sources @ weights, starts)
    return float((_weights(data) * np.logaddexp(0.0, np.where(data.slip, -most, most))).sum())


def _weights(data: Bags) -> Array:
    slips = max(int(data.slip.sum()), 1)
    return np.where(data.slip, 1.0 / slips, FALSE / max(len(data.slip) - slips, 1))


def spans(grasp: Grasp, found: Looks, weights: Array, threshold: float = THRESHOLD) -> list[tuple[float, float]]:
    """Return when slip is reported: by the posterior, or by the daemon's evidence beside the load."""
    by_load = found.t_s[found.sources @ weights > threshold]
    beside = grasp.load[grasp.load[:, 11].astype(int) & ~1 > 0, 0]
    reported: list[tuple[float, float]] = []
    for t_s in np.sort(np.concatenate([by_load, beside])).tolist():
        if reported and t_s <= reported[-1][1]:
            reported[-1] = reported[-1][0], t_s + HELD_S
        else:
            reported.append((t_s, t_s + HELD_S))
    return reported
