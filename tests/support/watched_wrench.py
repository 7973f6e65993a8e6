"""A force sensor for the tests of its watch: readings that come alone, and what is reported of each."""

from __future__ import annotations

import numpy as np

from slipd.signals.frozen import WrenchWatch
from slipd.types.arrays import Array

MS = 1_000_000


def take(watch: WrenchWatch, force: Array, torque: Array, t_ns: int) -> str:
    """Return the fault that is reported of a reading that arrives alone."""
    six = (*force.tolist(), *torque.tolist())
    said = watch.update([six], [t_ns], np.array([six]))
    assert said == ({0: watch.fault} if watch.fault else {})
    return watch.fault


class Stream:
    """A force sensor at 1 kHz with noise of 0.3 counts of 10 mN, and the faults that are reported of it."""

    def __init__(self, seed: int = 0, **options: float) -> None:
        self.rng = np.random.default_rng(seed)
        self.watch = WrenchWatch(200.0, **options)  # type: ignore[arg-type]
        self.t_ns = 0
        self.force, self.torque = np.zeros(3), np.zeros(3)

    def send(self, count: int = 1, at: float = 5.0) -> list[str]:
        said = []
        for _ in range(count):
            self.force = 0.01 * np.rint(100.0 * at + 0.3 * self.rng.normal(size=3))
            self.torque = 0.001 * np.rint(0.3 * self.rng.normal(size=3))
            said.append(self.repeat()[0])
        return said

    def repeat(self, count: int = 1) -> list[str]:
        said = []
        for _ in range(count):
            self.t_ns += MS
            said.append(take(self.watch, self.force, self.torque, self.t_ns))
        return said

    def give(self, *force: float) -> str:
        self.force = np.array(force)
        return self.repeat()[0]
