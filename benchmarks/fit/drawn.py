"""The loads of the tests that fall or jump for another reason than a slip, as grasps that hold."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator

import numpy as np
from fit.record import COLUMNS, Grasp
from load_course import MU, STD_N, readings
from project import ROOT

TESTS = ROOT / "tests" / "unit" / "fusion" / "test_load_drop.py"
SEEDS = range(3)


def drawn() -> Iterator[Grasp]:
    """Yield each load with each noise."""
    spec = importlib.util.spec_from_file_location("test_load_drop", TESTS)
    assert spec is not None
    assert spec.loader is not None
    tests = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tests)
    for number, (load, more) in enumerate(tests.NO_SLIPS):
        for seed in SEEDS:
            rows = readings(load, seed=seed, **more)
            contact, mu = rows["contact"], more.get("mu", MU)
            used = rows["utilisation"]["value"]
            told = {
                "t_s": rows["t_s"], "touches": 1.0, "q": used * (1.0 if math.isnan(mu) else mu),
                "normal": contact["normal_n"], "fx": contact["fx_n"], "fy": contact["fy_n"],
                "std": STD_N * np.hypot(1.0, contact["friction_ratio"]) / contact["normal_n"], "mu": mu, "exact": 1.0,
            }  # fmt: skip
            columns = [np.broadcast_to(told.get(name, 0.0), len(rows)) for name in COLUMNS]
            nothing = np.empty((0, 2))
            yield Grasp(f"drawn {number}", np.stack(columns, 1), nothing, np.zeros((2, 4)), nothing, 1.0)
