"""One public call of the friction limit on a full image, as the daemon makes it on every force reading."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from tables import Table

from slipd.fusion import torque_limit, utilisation
from slipd.pipeline.warm_up import warm_up
from slipd.sim.contact import Pad, Patch

MU = 0.55
CASES = 200
"""Loads of different size and direction, for the search takes longer for some than for others."""

OVER_THE_EDGE = Patch(half_length_m=0.03, half_width_m=0.016, centre_m=(0.0, 0.0))
"""A patch larger than the pad, so that every taxel is loaded."""


def run(calls: int) -> Table:
    """Measure ``calls`` of each."""
    warm_up()
    pad = Pad()
    x, y = pad.centres()
    loads = 10.0 * pad.shares(OVER_THE_EDGE)
    about = np.array((np.dot(x, loads), np.dot(y, loads))) / loads.sum()
    rng = np.random.default_rng(0)
    pulls = rng.uniform(0.1, 0.6, CASES) * MU * loads.sum()
    angles = rng.uniform(0.0, 2.0 * np.pi, CASES)
    tangential = np.stack((pulls * np.cos(angles), pulls * np.sin(angles)), axis=1)
    spins = rng.uniform(-0.04, 0.04, CASES)

    def use(case: int) -> None:
        utilisation(x, y, loads, MU, tangential[case], spins[case], about)

    def limit(case: int) -> None:
        torque_limit(x, y, loads, MU, tangential[case], about)

    active = int((loads > 0.0).sum())
    table = Table("One public call", ("call", "active taxels", "calls", "p50 µs", "p99 µs"))
    for name, call in (("utilisation", use), ("torque_limit", limit)):
        took_us = _timed_us(call, calls)
        table.rows.append((name, active, calls, float(np.median(took_us)), float(np.percentile(took_us, 99))))
    table.notes.append(f"{CASES} loads in turn; compiled before, as in the daemon.")
    return table


def _timed_us(call: Callable[[int], None], calls: int) -> list[float]:
    took_us = []
    for number in range(-CASES, calls):
        begin_ns = time.perf_counter_ns()
        call(number % CASES)
        took_us.append((time.perf_counter_ns() - begin_ns) * 1e-3)
    return took_us[CASES:]
