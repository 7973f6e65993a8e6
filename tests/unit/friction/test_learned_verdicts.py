"""What a finger learns of friction from force traces with slips, and how its verdicts follow."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import groupby

import numpy as np
import pytest
from finger_bench import make_finger, read_force
from fixture_types import Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.fusion.streaming import assessment_at
from slipd.publish.finger_messages import slip_body
from slipd.types.samples import TactileSample

pytestmark = pytest.mark.uncovered

TRUE_MU = 0.5
NORMAL_N = 10.0
SLIDING = 0.8 * TRUE_MU


class Grasp:
    """A finger that holds an object with true friction 0.5 and a grip of 10 N, and its reports; 1 kHz, with noise."""

    def __init__(self, finger: Finger, wrench: Wrench) -> None:
        self.finger = finger
        self.t_ns = T0
        self._wrench = wrench
        self._rng = np.random.default_rng(4)
        self.levels: list[str] = []

    def read(self, q: float) -> None:
        """Hand over a reading of the required friction q, and an image every 10 ms."""
        self.t_ns += MS
        if self.t_ns % (10 * MS) == 0:
            self.finger.update_image(TactileSample(self.t_ns, None, 100.0 + self._rng.normal(0.0, 0.3, 16)))
        x_n, y_n, z_n = self._rng.normal(0.0, 0.005, 3)
        state = read_force(self.finger, self._wrench(self.t_ns, NORMAL_N + z_n, (q * NORMAL_N + x_n, y_n)))
        self.levels.append(state.verdict.level)

    def load(self, *parts: tuple[float, float, float]) -> list[str]:
        """Load or unload evenly, from one q to another within some seconds; return the levels of the last part."""
        for begin, end, seconds in parts:
            first = len(self.levels)
            for q in np.linspace(begin, end, round(seconds * 1000)):
                self.read(q)
        return self.levels[first:]

    def approach_and_slip(self) -> int:
        """Load until the object slips for 60 ms, and then rests at 0.2.

        Returns:
            For how long its approach had been warned without interruption, ms.
        """
        approach = self.load((0.2, TRUE_MU, 0.6))
        self.load((TRUE_MU, SLIDING, 0.003), (SLIDING, SLIDING, 0.06), (SLIDING, 0.2, 0.1), (0.2, 0.2, 0.8))
        return len(approach) - 1 - max((k for k, level in enumerate(approach) if level != "warning"), default=-1)


@pytest.fixture
def make_grasp(left: str, parse: Parse, wrench: Wrench) -> Callable[[str], Grasp]:
    """Make a grasp by a finger with a configured μ, a line of its config."""
    return lambda mu: Grasp(make_finger(left.replace("mu = 0.5\n", mu), parse), wrench)


MakeGrasp = Callable[[str], Grasp]


def test_after_the_first_slip_with_a_coefficient_a_fifth_too_high_the_next_one_is_warned(make_grasp: MakeGrasp) -> None:
    grasp = make_grasp("mu = 0.6\n")
    assert grasp.approach_and_slip() < 60, "warned only at 0.96 of the true limit"
    assert [level for level, _ in groupby(grasp.levels)].count("slipping") == 1, "the unloading is no slip"
    friction = grasp.finger.friction.state
    assert friction.source == "learned"
    assert friction.mu < TRUE_MU < friction.mu_high
    assert friction.mu_d == pytest.approx(SLIDING, rel=0.03)
    assert grasp.approach_and_slip() > 130


def test_without_a_coefficient_the_first_slip_teaches_one_that_warns_of_the_next(make_grasp: MakeGrasp) -> None:
    grasp = make_grasp("")
    assert set(grasp.load((0.3, 0.3, 0.3))) == {"unknown"}
    state = grasp.finger.state
    assert (state.friction.mu, slip_body(grasp.finger, state)["model"]) == (None, "none")
    required = assessment_at(state.reading, 0).required_friction
    assert (required, state.friction.carried) == pytest.approx((0.3, 0.3), rel=0.01)
    assert (math.isnan(state.utilisation.value), state.utilisation.kind == "none") == (True, False), "its pole is known"
    assert grasp.approach_and_slip() == 0
    assert "slipping" in grasp.levels
    assert grasp.finger.friction.state.source == "learned"
    assert grasp.approach_and_slip() > 130


def test_false_warnings_with_a_coefficient_a_fifth_too_low_stop_once_more_was_carried(make_grasp: MakeGrasp) -> None:
    grasp = make_grasp("mu = 0.4\n")
    assert set(grasp.load((0.36, 0.36, 0.5))[20:]) == {"warning"}
    grasp.load((0.36, 0.46, 0.5), (0.46, 0.46, 0.3), (0.46, 0.36, 0.3))
    assert set(grasp.load((0.36, 0.36, 0.8))[400:]) == {"caution"}
    friction = grasp.finger.friction.state
    assert friction.source == "learned"
    assert 0.44 < friction.mu < TRUE_MU
