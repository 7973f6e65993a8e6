"""Every metric on courses made by hand, where its value is known; and the statistics against closed forms."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from evaluate.intervals import quantile, rate_upper, share_upper
from evaluate.reports import CAUTION, NO_CONTACT, SLIPPING, STABLE, WARNING, Reports
from evaluate.score import RunScore, score
from evaluate.summary import summarise
from evaluate.truth import Episode, Truth

STEP_S = 1e-3


def course(*slips: tuple[float, float], used: float = 0.5, seconds: float = 2.0, speed: float = 0.02) -> Truth:
    """λ is ``used`` but while the contact slides; it slides in each of the ``slips``."""
    t = np.arange(round(seconds / STEP_S) + 1) * STEP_S
    gross = np.zeros(t.size, dtype=bool)
    for begin, end in slips:
        gross |= (t >= begin - 1e-9) & (t < end - 1e-9)
    level = np.where(gross, 1.0, used)
    return Truth(t, level, np.where(gross, speed, 0.0), gross, np.full(t.size, 10.0), 10.0 * level, mu=0.5)


def said(*levels: tuple[float, int], seconds: float = 2.0, q_error: float = 0.0, grip_error: float = 0.0) -> Reports:
    """Messages every 4 ms and at each change of level: (from when, level)."""
    t = np.union1d(np.arange(0.0, seconds, 0.004), [begin for begin, _ in levels])
    which = np.searchsorted([begin for begin, _ in levels], t, side="right") - 1
    level = np.array([level for _, level in levels], dtype=float)[which]
    used = np.full(t.size, 0.5 * (1.0 + q_error))
    return Reports(t, t, level, used, np.full(t.size, 0.5), 0.5 * used, 5.0 * (1.0 + grip_error) + 0.0 * t)


def scored(truth: Truth, reports: Reports, steady: tuple[float, float] | None = None) -> RunScore:
    return score(truth, reports, steady=steady, closed_s=0.4)


def test_a_gross_slip_is_fast_enough_and_long_enough_and_short_pauses_do_not_end_it() -> None:
    assert course((1.0, 1.2)).episodes() == [Episode(pytest.approx(1.0), pytest.approx(1.2))]
    assert course((1.0, 1.2), (1.205, 1.3)).episodes() == [Episode(pytest.approx(1.0), pytest.approx(1.3))]
    assert len(course((1.0, 1.2), (1.22, 1.3)).episodes()) == 2
    assert course((1.0, 1.2), speed=1e-4).episodes() == [], "the pads creep"
    assert course((1.0, 1.005)).episodes() == []
    assert course((1.9, 3.0)).episodes() == [Episode(pytest.approx(1.9), pytest.approx(2.0))]


def test_a_warned_and_reported_slip() -> None:
    found = scored(
        course((1.0, 1.5)), said((0.0, NO_CONTACT), (0.2, STABLE), (0.7, CAUTION), (0.8, WARNING), (1.03, SLIPPING))
    )
    (slip,) = found.episodes
    assert slip.warned
    assert slip.lead_s == pytest.approx(0.2)
    assert slip.latency_s == pytest.approx(0.03)
    assert slip.path_m == pytest.approx(0.03 * 0.02, rel=1e-6)
    assert (slip.missed, slip.silent) == (False, False)
    assert slip.overstay_s == pytest.approx(0.5)
    assert (found.early, found.false_slipping) == (False, 0)
    assert (found.sliding_s, found.sliding_reported_s) == (pytest.approx(0.4), pytest.approx(0.4))
    assert found.sliding_stable_s == 0.0
    assert found.changes_before == 2, "to caution and to warning"


@pytest.mark.parametrize(("falls", "seen_s"), [(0.2, 0.4), (0.0, 0.0)])
def test_an_oracle_sees_a_slide_whose_required_friction_falls(falls: float, seen_s: float) -> None:
    reports = said((0.0, STABLE))
    noise = np.random.default_rng(0).normal(0.0, 1e-3, reports.t_s.size)
    required = 0.25 * (1.0 - falls * (reports.t_s >= 1.0)) + noise
    found = scored(course((1.0, 1.5)), dataclasses.replace(reports, required=required))
    assert found.episodes[0].visible is bool(seen_s)
    assert found.sliding_seen_s == pytest.approx(seen_s)
    assert summarise([found]).seen == pytest.approx(seen_s / 0.4)


def test_a_slip_that_nobody_reports_is_missed_and_silent() -> None:
    found = scored(course((1.0, 1.5)), said((0.0, NO_CONTACT), (0.2, STABLE)))
    (slip,) = found.episodes
    assert (slip.warned, slip.missed, slip.silent, slip.latency_s) == (False, True, True, math.inf)
    assert found.sliding_stable_s == pytest.approx(0.4)


def test_a_warning_after_the_onset_breaks_the_silence_and_still_misses() -> None:
    (slip,) = scored(course((1.0, 1.5)), said((0.0, STABLE), (1.05, WARNING), (1.11, SLIPPING))).episodes
    assert (slip.warned, slip.missed, slip.silent) == (False, True, False)
    assert slip.latency_s == pytest.approx(0.11)


def test_a_short_slip_is_neither_missed_nor_silent() -> None:
    (slip,) = scored(course((1.0, 1.05)), said((0.0, STABLE))).episodes
    assert (slip.long, slip.missed, slip.silent) == (False, False, False)


def test_an_alarm_that_pauses_before_the_slip_leads_from_its_last_beginning() -> None:
    (slip,) = scored(course((1.0, 1.5)), said((0.0, STABLE), (0.5, WARNING), (0.6, STABLE), (0.9, WARNING))).episodes
    assert slip.lead_s == pytest.approx(0.1)


def test_the_oracle_warns_where_the_true_load_comes_near_the_limit() -> None:
    truth = course((1.0, 1.5))
    truth.utilisation[(truth.t_s > 0.3995) & (truth.t_s < 0.4995)] = 0.8
    (slip,) = scored(truth, said((0.0, STABLE))).episodes
    assert slip.oracle_lead_s == pytest.approx(0.6), "the load has not been low since"
    truth.utilisation[(truth.t_s > 0.5995) & (truth.t_s < 0.6995)] = 0.4
    assert math.isnan(scored(truth, said((0.0, STABLE))).episodes[0].oracle_lead_s)
    truth.utilisation[(truth.t_s > 0.8995) & (truth.t_s < 1.0)] = 0.8
    found = scored(truth, said((0.0, STABLE)))
    assert found.episodes[0].oracle_lead_s == pytest.approx(0.1)
    assert summarise([found]).oracle_lead_p5_ms == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("at", "false"),
    [(0.9, 1), (0.985, 0), (1.2, 0), (1.6, 0), (1.8, 1)],
    ids=["early", "just-before", "in", "after", "late"],
)
def test_slipping_is_false_far_from_a_slip(at: float, false: int) -> None:
    found = scored(course((1.0, 1.5), used=0.8), said((0.0, STABLE), (at, SLIPPING), (at + 0.01, STABLE)))
    assert (found.false_slipping, found.closing, found.early) == (false, at < 0.4, bool(false) and 0.4 < at < 1.0)
    assert found.quiet_s == pytest.approx(2.0 - 0.5 - 0.02 - 0.25, abs=0.005)
    assert found.false_warnings == 0, "the object is near its limit"


def test_time_counts_in_contact_and_where_the_load_has_been_safe_for_a_while() -> None:
    truth = course(used=0.5)
    truth.normal_n[truth.t_s < 0.5] = 0.0
    truth.utilisation[(truth.t_s > 0.9995) & (truth.t_s < 1.0995)] = 0.8
    found = scored(truth, said((0.0, STABLE), (1.11, WARNING), (1.12, STABLE), (1.14, WARNING)))
    assert found.quiet_s == pytest.approx(1.5, abs=0.002)
    assert found.safe_s == pytest.approx(1.5 - 0.1 - 0.03, abs=0.003)
    assert found.false_warnings == 1, "the first follows a load near its limit"


def test_a_short_slip_counts_for_no_latency_whether_it_is_reported_or_not() -> None:
    reported = scored(course((1.0, 1.05)), said((0.0, STABLE), (1.01, SLIPPING)))
    late = scored(course((1.0, 1.5)), said((0.0, STABLE), (1.2, SLIPPING)))
    found = summarise([reported, late])
    assert found.latency_p50_ms == found.latency_p95_ms == pytest.approx(200.0)
    assert found.within_1mm == 0.0


def test_an_alarm_on_a_safe_load_is_false_once() -> None:
    found = scored(
        course(used=0.6), said((0.0, STABLE), (0.5, WARNING), (0.6, SLIPPING), (0.7, WARNING), (0.8, STABLE))
    )
    assert (found.false_warnings, found.false_slipping) == (1, 1)
    assert found.safe_s == pytest.approx(2.0)
    assert found.changes_before is None


def test_a_slip_still_reported_when_the_next_begins_is_one() -> None:
    truth = course((0.5, 0.7), (0.8, 1.0), (1.5, 1.8))
    found = scored(truth, said((0.0, STABLE), (0.51, SLIPPING), (1.2, STABLE), (1.45, WARNING), (1.6, SLIPPING)))
    assert [slip.first for slip in found.episodes] == [True, False]
    assert [slip.warned for slip in found.episodes] == [False, True]


def test_changes_in_a_steady_hold() -> None:
    found = scored(course(), said((0.0, STABLE), (0.4, CAUTION), (0.9, STABLE), (1.2, CAUTION)), (0.5, 2.0))
    assert (found.steady_changes, found.steady_s) == (2, 1.5)


def test_errors_are_relative_and_do_not_depend_on_mu() -> None:
    found = scored(course((1.0, 1.5)), said((0.0, STABLE), q_error=0.03, grip_error=-0.07))
    assert found.used_errors == pytest.approx(np.full(found.used_errors.size, 0.03))
    assert found.grip_errors == pytest.approx(np.full(found.grip_errors.size, -0.07))
    assert found.used_errors.size == pytest.approx((2.0 - 0.75) / 0.004, abs=3)


def test_quantiles_keep_what_never_came() -> None:
    assert quantile([3.0, 1.0, 2.0, math.inf], 0.5) == 2.0
    assert quantile([3.0, 1.0, 2.0, math.inf], 0.95) == math.inf
    assert quantile(range(1, 101), 0.95) == 95.0
    assert math.isnan(quantile([], 0.5))


def test_bounds_are_those_of_the_tables() -> None:
    assert rate_upper(0, 1.0) == pytest.approx(2.9957, abs=1e-4), "the rule of three"
    assert rate_upper(2, 0.5) == pytest.approx(2 * 6.2958, abs=1e-3)
    assert rate_upper(0, 0.0) == math.inf
    assert share_upper(0, 20) == pytest.approx(1.0 - 0.05 ** (1 / 20))
    assert share_upper(3, 3) == 1.0
