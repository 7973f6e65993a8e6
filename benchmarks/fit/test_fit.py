"""The harness of the posterior on courses made by hand: its sources are bounded, and its scores and weights known."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest
from fit.drawn import drawn
from fit.fitting import Bags, fit, loss_of, spans
from fit.posterior import JUMP, SOURCES, Looks, looks
from fit.record import Grasp
from fit.replay import LoadRules, joined
from fit.rules import IMAGE, LOAD, replaced
from fit.score import score, spans_of, today

from slipd.motion import image_shift, shift_path, width_change
from slipd.types.arrays import Array
from slipd_client.messages import level_code

MU, SLIDES_S, SPEED_MPS = 0.6, 1.0, 0.02
SLIPPING = level_code("slipping")


def grasp(q: Array, *, reported_s: float = math.inf, mu: float = MU) -> Grasp:
    """Return a grasp with a course of q at 1 kHz that slides from 1 s on at 20 mm/s, reported from a time on."""
    n = len(q)
    t_s, one = np.arange(n) * 1e-3, np.ones(n)
    noisy = q + np.random.default_rng(1).normal(0.0, 0.002, n)
    still = np.zeros(n)
    load = [t_s, one, noisy, 10.0 * one, 10.0 * noisy, *[still] * 4, 0.002 * one, mu * one, still, one]
    slides = t_s >= SLIDES_S
    level = np.where(t_s >= reported_s, SLIPPING, 1)
    truth = np.stack([t_s, SPEED_MPS * slides, slides, q / MU], 1)
    episodes = np.array([[SLIDES_S, t_s[-1]]]) if slides.any() else np.empty((0, 2))
    return Grasp("by hand 1", np.stack(load, 1), np.stack([t_s, level], 1), truth, episodes, 0.75)


RISE = np.linspace(0.2, MU, 1000)
SLIP = np.concatenate([RISE, np.linspace(MU, 0.75 * MU, 5), np.full(300, 0.75 * MU)])
JUMPS = np.concatenate([np.full(1000, 0.2), np.linspace(0.2, MU, 5), np.full(300, MU)])


def test_every_source_stays_between_0_and_1_and_a_slip_is_looked_at_soon() -> None:
    for course, own in ((SLIP, slice(0, JUMP)), (JUMPS, slice(JUMP, None)), (RISE.repeat(2), slice(None))):
        found = looks(grasp(course))
        assert ((found.sources >= 0.0) & (found.sources <= 1.0)).all()
        if course is not SLIP and course is not JUMPS:
            continue
        of_kind = found.t_s[found.sources[:, own].any(axis=1)]
        assert SLIDES_S < of_kind.min() < SLIDES_S + 0.03


def test_a_fall_shows_how_near_the_limit_it_began_and_how_deep_it_is() -> None:
    found = looks(grasp(SLIP))
    falls = found.sources[(found.t_s > 1.02) & (found.sources[:, 0] > 0.0)]
    by_name = dict(zip(SOURCES, falls.T, strict=True))
    assert by_name["limit"].max() > 0.95
    assert by_name["deep"].max() == 0.0
    assert by_name["moving"].min() < 0.1
    unknown = looks(grasp(SLIP, mu=math.nan)).sources
    assert unknown[unknown[:, 0] > 0.0, SOURCES.index("limit")].max() < 0.5


def test_noise_alone_is_no_look() -> None:
    assert looks(grasp(np.full(900, 0.5))).t_s.size == 0


def test_a_report_is_scored_by_the_way_of_the_slip() -> None:
    in_time = grasp(SLIP, reported_s=1.075)  # 1.5 mm
    found = score(in_time, today(in_time))
    assert found.reached.tolist() == [1, 1, 1]
    assert found.reported.tolist() == [0, 1, 1]
    assert (found.false, found.never) == (0, 0)
    early = grasp(SLIP, reported_s=0.5)
    assert score(early, today(early)).false == 1
    assert (found + score(early, [])).grasps == 2


def test_spans_last_as_long_as_the_flag() -> None:
    t_s = np.array([0.0, 1.0, 2.0, 3.0])
    assert spans_of(t_s, np.array([False, True, True, False])) == [(1.0, 3.0)]
    assert spans_of(np.empty(0), np.empty(0, bool)) == []


def test_the_fit_tells_slips_from_grasps_that_hold() -> None:
    rng = np.random.default_rng(2)
    sources = rng.uniform(0.0, 1.0, (400, len(SOURCES)))
    sources[:, 0] = 1.0
    slip = np.arange(200) % 2 == 0
    sources[:, 1] = np.repeat(slip, 2)
    data = Bags(sources, np.full(200, 2), slip)
    weights = fit(data)
    unused = fit(data, np.arange(len(SOURCES)) != 1)
    assert weights[1] > 3.0
    assert unused[1] == 0.0
    assert loss_of(data, weights) < 0.3 * loss_of(data, unused)


def test_reports_of_the_posterior_last_while_looks_go_on() -> None:
    course = grasp(SLIP)
    weights = np.zeros(len(SOURCES))
    weights[0] = 1.0
    times = np.array([1.0, 1.1, 1.9])
    sources = np.zeros((3, len(SOURCES)))
    sources[:, 0] = 1.0
    assert spans(course, Looks(times, sources), weights) == [(1.0, 1.35), (1.9, 2.15)]


def test_a_constant_is_replaced_wherever_it_is_used_and_only_meanwhile() -> None:
    with replaced({"motion.shift_path.LEAST_M": 7.0}):
        assert image_shift.LEAST_M == shift_path.LEAST_M == 7.0
        assert width_change.LEAST_M == 3e-4
    assert image_shift.LEAST_M == shift_path.LEAST_M == 2e-4


def test_every_rule_has_a_constant() -> None:
    for rules in (LOAD, IMAGE):
        for values in rules.values():
            for path in values:
                where, name = path.rsplit(".", 1)
                assert name in vars(importlib.import_module(f"slipd.{'fusion.' * (rules is LOAD)}{where}")), path


@pytest.mark.long
def test_rules_with_given_constants_find_a_slip_until_they_are_left_out() -> None:
    rules, course = LoadRules({"load_drop.RECENT_S", "slow_fall.MOST_DROP"}), grasp(SLIP)
    ((begin, _),) = rules.spans(course, {})
    assert SLIDES_S < begin < SLIDES_S + 0.03
    assert rules.spans(course, LOAD["source: falls"] | LOAD["source: slow falls"]) == []


def test_spans_that_overlap_are_one() -> None:
    assert joined([(2.0, 3.0), (0.0, 1.0), (0.5, 1.5)]) == [(0.0, 1.5), (2.0, 3.0)]


def test_drawn_loads_hold() -> None:
    some = list(drawn())
    assert len(some) == 3 * len({one.name for one in some})
    assert not any(len(one.episodes) for one in some)
