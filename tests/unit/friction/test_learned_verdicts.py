"""What a finger learns of friction from force traces with slips, and how its verdicts follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import groupby

import numpy as np
import pytest
from finger_bench import MS, T0, Parse, Wrench, make_finger, read_force

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.types.samples import TactileSample

pytestmark = pytest.mark.no_cover

TRUE_MU = 0.5
NORMAL_N = 10.0
DYNAMIC = 0.8
"""Dynamic over static friction."""


class Grasp:
    """A finger that holds an object with true friction 0.5 and a grip of 10 N, and its reports; 1 kHz, with noise."""

    def __init__(self, finger: Finger, wrench: Wrench) -> None:
        self.finger = finger
        self.t_ns = T0
        self._wrench = wrench
        self._rng = np.random.default_rng(4)
        self.states: list[FingerState] = []

    def read(self, q: float, normal_n: float = NORMAL_N) -> None:
        """Hand over a reading of the required friction q, and an image every 10 ms."""
        self.t_ns += MS
        if self.t_ns % (10 * MS) == 0:
            counts = 100.0 * normal_n / 10.0 + self._rng.normal(0.0, 0.3, 16)
            self.finger.update_image(TactileSample(self.t_ns, None, counts))
        noise = self._rng.normal(0.0, 0.005, 3)
        sample = self._wrench(self.t_ns, normal_n + noise[2], (q * normal_n + noise[0], noise[1]))
        self.states.append(read_force(self.finger, sample))

    def load(self, begin: float, end: float, seconds: float) -> list[FingerState]:
        """Load or unload evenly; return the states."""
        first = len(self.states)
        for share in np.linspace(0.0, 1.0, round(seconds * 1000)):
            self.read(begin + share * (end - begin))
        return self.states[first:]

    def approach_and_slip(self) -> list[FingerState]:
        """Load until the object slips for 60 ms; return the states until the slip begins. It then rests at 0.2."""
        approach = self.load(0.2, TRUE_MU, 0.6)
        self.load(TRUE_MU, DYNAMIC * TRUE_MU, 0.003)
        self.load(DYNAMIC * TRUE_MU, DYNAMIC * TRUE_MU, 0.06)
        self.load(DYNAMIC * TRUE_MU, 0.2, 0.1)
        self.load(0.2, 0.2, 0.8)
        return approach

    def let_go(self) -> None:
        """End the contact."""
        for _ in range(30):
            self.read(0.0, 0.0)

    def tare(self) -> None:
        """Let go, and take the zero."""
        self.let_go()
        before = self.finger.tare.current.id
        self.finger.begin_tare(self.t_ns, 0.05, "test")
        for _ in range(3):
            self.let_go()
        assert self.finger.tare.current.id > before


@pytest.fixture
def make_grasp(left: str, parse: Parse, wrench: Wrench) -> Callable[[float | None], Grasp]:
    """Make a finger, tared, with a configured μ."""

    def make(mu: float | None) -> Grasp:
        grasp = Grasp(make_finger(left.replace("mu = 0.5\n", "" if mu is None else f"mu = {mu}\n"), parse), wrench)
        grasp.tare()
        return grasp

    return make


MakeGrasp = Callable[[float | None], Grasp]


def levels(states: Sequence[FingerState]) -> list[str]:
    return [state.verdict.level for state in states]


def lead_ms(approach: Sequence[FingerState]) -> int:
    """Return for how long the end of an approach was warned without interruption, ms."""
    quiet = [k for k, level in enumerate(levels(approach)) if level != "warning"]
    return len(approach) - 1 - max(quiet, default=-1)


def test_after_the_first_slip_with_a_coefficient_a_fifth_too_high_the_next_one_is_warned(make_grasp: MakeGrasp) -> None:
    grasp = make_grasp(1.2 * TRUE_MU)
    assert lead_ms(grasp.approach_and_slip()) < 60, "warned only at 0.96 of the true limit"
    assert [level for level, _ in groupby(levels(grasp.states))].count("slipping") == 1, "the unloading is no slip"
    friction = grasp.finger.friction.state
    assert friction.source == "learned"
    assert friction.mu < TRUE_MU < friction.mu_high
    assert friction.mu_d == pytest.approx(DYNAMIC * TRUE_MU, rel=0.03)
    assert lead_ms(grasp.approach_and_slip()) > 130


def test_without_a_coefficient_the_first_slip_teaches_one_that_warns_of_the_next(make_grasp: MakeGrasp) -> None:
    grasp = make_grasp(None)
    grasp.load(0.3, 0.3, 0.3)
    state = grasp.states[-1]
    assert (state.friction.mu, state.friction.source, state.model) == (None, "none", "none")
    assert (state.required_friction, state.friction.carried) == pytest.approx((0.3, 0.3), rel=0.01)
    assert (math.isnan(state.utilisation.value), state.utilisation.kind == "none") == (True, False), "its pole is known"
    assert {state.verdict.reasons for state in grasp.approach_and_slip()} == {("no_mu",)}
    assert "slipping" in levels(grasp.states)
    assert grasp.finger.friction.state.source == "learned"
    assert lead_ms(grasp.approach_and_slip()) > 130


def test_false_warnings_with_a_coefficient_a_fifth_too_low_stop_once_more_was_carried(make_grasp: MakeGrasp) -> None:
    grasp = make_grasp(0.8 * TRUE_MU)
    assert set(levels(grasp.load(0.36, 0.36, 0.5))[20:]) == {"warning"}
    grasp.load(0.36, 0.46, 0.5)
    grasp.load(0.46, 0.46, 0.3)
    grasp.load(0.46, 0.36, 0.3)
    assert set(levels(grasp.load(0.36, 0.36, 0.8))[400:]) == {"caution"}
    friction = grasp.finger.friction.state
    assert friction.source == "learned"
    assert 0.44 < friction.mu < TRUE_MU


@pytest.mark.parametrize(("mu", "restart"), [(0.6, "tare"), (0.3, "tare"), (0.6, "pad"), (0.6, "request")])
def test_a_request_starts_anew_a_tare_forgets_what_is_more_lenient_and_a_lost_pad_nothing(
    make_grasp: MakeGrasp, mu: float, restart: str
) -> None:
    grasp = make_grasp(mu)
    grasp.finger.friction.set_object("mug")
    grasp.approach_and_slip()
    grasp.let_go()
    learned = grasp.finger.friction.state
    assert learned.source == "learned"
    if restart == "tare":
        grasp.tare()
    elif restart == "pad":
        grasp.finger.disconnect_image()
    else:
        grasp.finger.set_friction(mu, None)
    grasp.let_go()
    friction = grasp.finger.friction.state
    kept = restart == "pad" or (restart == "tare" and learned.mu < mu)
    assert friction.mu == (learned.mu if kept else mu)
    assert friction.object_name == "mug"
