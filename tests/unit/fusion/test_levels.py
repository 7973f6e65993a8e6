"""Levels rise at once at their thresholds, earlier where a load grows, and fall a hysteresis below them after a dwell.

A reading counts as much as its noise allows: noise and vibration change a level at most once a minute.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from load_course import MU, Watch, assess, contact_rows, watch

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.fusion.level_hysteresis import CERTAIN_STDS
from slipd.fusion.load_growth import GROWTH_S, grows
from slipd.fusion.rows import CAUTION, FREE, STABLE, WARNING, Rows
from slipd.types.arrays import Array

DWELL = 260
"""Readings at 1 kHz after which a level may be left."""


@pytest.fixture
def gate() -> Watch:
    return Watch()


def test_another_mu_changes_the_level_at_once(gate: Watch) -> None:
    gate.step(0.9)
    rows = contact_rows(1, 0.4 * 10.0 * MU, 10.0, 0.4, 1e-3)
    assess(gate.watch, rows, 2.0 * MU)
    assert rows["assessment"]["friction_step"][0] == STABLE


def test_a_new_contact_begins_without_the_old_ones_hysteresis(gate: Watch) -> None:
    gate.step(0.86)
    gate.take(0.0, 0.1, math.nan, phase=FREE)
    assert gate.step(0.84) == CAUTION


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=30))
def test_a_level_is_never_below_that_of_the_load_nor_above_the_one_before(path: list[float]) -> None:
    gate = Watch()
    before = STABLE
    for used in path:
        step = gate.step(used)
        bare = (used >= 0.70) + (used >= 0.85)
        assert bare <= step <= max(bare, before)
        before = step


LIGHT_N = 0.5
LEVER_M = 5e-4
"""Of a contact on one taxel or two, by its friction."""
NOISE = WrenchUncertainty(0.0, 2e-4)


def course(used: Array, period_s: float = 1e-3, noise_n: float = 0.02) -> Rows:
    """Return the assessed readings of a load on a contact of 10 N, with noise."""
    load = used * 10.0 * MU + np.random.default_rng(3).normal(0.0, noise_n, len(used))
    rows = contact_rows(len(used), load, 10.0, load / 10.0 / MU, np.arange(len(used)) * period_s)
    assess(watch(), rows, MU, WrenchUncertainty(min(noise_n, 0.02)))
    return rows


def spun(spins: Array) -> Rows:
    """Return the assessed readings of a light contact that bears these spin torques, N·m."""
    used = np.abs(spins) / (MU * LIGHT_N * LEVER_M)
    rows = contact_rows(len(spins), 0.0, LIGHT_N, used, np.arange(len(spins)) * 1e-3)
    rows["contact"]["spin_nm"] = spins
    rows["utilisation"]["twist"][:, 2] = np.sign(spins)
    assess(watch(), rows, MU, NOISE)
    return rows


def first(rows: Rows, step: int) -> float:
    """Return the mean utilisation about the first reading of a step."""
    k = int(np.argmax(rows["assessment"]["friction_step"] == step))
    return float(rows["utilisation"]["value"][max(k - 5, 0) : k + 5].mean())


@pytest.mark.parametrize("period_s", [1e-3, 0.01, 0.025])
@pytest.mark.parametrize("per_s", [0.3, 1.0])
def test_a_load_that_grows_is_warned_of_a_hysteresis_earlier(per_s: float, period_s: float) -> None:
    rows = course(np.arange(0.3, 0.95, per_s * period_s), period_s, 0.005)
    assert first(rows, WARNING) == pytest.approx(0.80, abs=0.01 + 2.0 * per_s * period_s)


def test_a_load_that_hardly_grows_is_warned_of_at_its_threshold() -> None:
    rows = course(np.arange(0.70, 0.9, 0.05e-3))
    assert first(rows, WARNING) == pytest.approx(0.845, abs=0.01)


@pytest.mark.parametrize("from_used", [0.3, 0.6, 0.76])
def test_a_load_that_jumps_and_stays_does_not_grow(from_used: float) -> None:
    rows = course(np.where(np.arange(2000) < 1000, from_used, 0.82), noise_n=0.005)
    assert rows["assessment"]["friction_step"].max() == CAUTION


@pytest.mark.parametrize(
    ("begins", "step", "period_s", "warned"),
    [(0.3, 0.02, 0.12, 0.85), (0.63, 1e-3, 1e-3, 0.835), (0.6, 1.5e-3, 1e-3, 0.85)],
)
def test_readings_too_far_apart_or_too_few_show_no_growth(
    begins: float, step: float, period_s: float, warned: float
) -> None:
    rows = course(np.arange(begins, 0.95, step), period_s, 0.0)
    steps = rows["assessment"]["friction_step"]
    assert rows["utilisation"]["value"][np.argmax(steps == WARNING)] >= warned


def test_a_growth_within_its_noise_does_not_count() -> None:
    growing = watch()
    load = np.arange(0.3, 0.81, 0.3e-3) * MU * 10.0
    assess(growing, contact_rows(len(load), load, 10.0, load / 10.0 / MU, np.arange(len(load)) * 1e-3), MU, NOISE)
    growth = 0.3 * GROWTH_S * MU
    for stds, found in ((1.1 * CERTAIN_STDS, True), (0.9 * CERTAIN_STDS, False)):
        growing.row["drop"]["rough"] = growth / stds
        assert grows(growing.row["drop"][0], growing.row["ring"][0], MU, 0.75) is found
    growing.row["drop"]["rough"] = 0.0
    assert not grows(growing.row["drop"][0], growing.row["ring"][0], MU, 0.85), "its mean has not reached that"


def test_an_unknown_weight_adds_its_force_and_its_spin_to_the_load_and_takes_its_force_off_the_grip() -> None:
    rows = contact_rows(1, 3.0, 10.0, 0.5, 1e-3)
    assess(watch(), rows, MU, WrenchUncertainty(0.02, 0.0, unknown_n=1.0), 0.7)
    assert rows["assessment"]["utilisation_upper"] == pytest.approx((0.5 * 10.0 + 1.0 / MU + 0.7) / 9.0)


def test_a_new_contact_begins_without_the_mean_of_the_one_before() -> None:
    watched = watch()
    used = np.array([0.9, 0.0, 0.9])
    rows = contact_rows(3, used * LIGHT_N * MU, LIGHT_N, used, np.arange(3) * 1e-3)
    rows["phase"][1], rows["utilisation"]["twist"][:, 0] = FREE, 1.0
    for k, std_n in enumerate((0.005, 0.005, 0.2)):
        assess(watched, rows[k : k + 1], MU, WrenchUncertainty(std_n))
    assert rows["assessment"]["friction_step"].tolist() == [WARNING, STABLE, STABLE]


@pytest.mark.parametrize("share", [0.55, 0.60, 0.64, 0.67, 0.70, 0.75, 0.80, 0.84])
@pytest.mark.parametrize(("std_n", "swing"), [(0.02, 0.0), (0.2, 0.0), (0.02, 0.08)])
def test_F5_noise_and_vibration_change_the_level_of_a_steady_hold_at_most_once_a_minute(
    share: float, std_n: float, swing: float
) -> None:
    found = course(share + swing * np.sin(2.0 * np.pi * 0.12 * np.arange(60_000)), noise_n=std_n)["assessment"]
    assert np.count_nonzero(np.diff(found["level"][500:])) <= 1
    assert not found["slips"].any()


def test_a_slow_load_passes_each_level_once_on_its_way_up() -> None:
    assert np.count_nonzero(np.diff(course(np.linspace(0.4, 0.99, 4000))["assessment"]["level"])) == 2


HOLD, ONCE = DWELL, 1


@pytest.mark.parametrize(
    ("path", "steps"),
    [
        # reached at its threshold
        *(
            ([(used, ONCE)], [step])
            for used, step in (
                (0.0, STABLE), (0.699, STABLE), (0.70, CAUTION), (0.849, CAUTION), (0.85, WARNING), (math.inf, WARNING),
            )
        ),
        # left a hysteresis below it, and only after a while
        ([(0.70, HOLD), (0.651, HOLD), (0.649, HOLD)], [CAUTION, CAUTION, STABLE]),
        (
            [(0.85, HOLD), (0.801, HOLD), (0.799, HOLD), (0.651, HOLD), (0.649, HOLD)],
            [WARNING, WARNING, CAUTION, CAUTION, STABLE],
        ),
        ([(0.85, HOLD), (0.66, HOLD)], [WARNING, CAUTION]),
        ([(0.85, HOLD), (0.5, HOLD)], [WARNING, STABLE]),
        ([(0.66, HOLD), (0.81, HOLD)], [STABLE, CAUTION]),
        ([(math.inf, HOLD), (0.5, HOLD)], [WARNING, STABLE]),
        ([(0.9, ONCE), (0.5, 240), (0.5, 20)], [WARNING, WARNING, STABLE]),
        # not where the load returns meanwhile
        ([(0.9, ONCE), (0.4, 199)] * 3, [WARNING] * 6),
    ],
)  # fmt: skip
def test_a_level_is_reached_at_its_threshold_and_left_a_hysteresis_below_it_after_a_while(
    gate: Watch, path: list[tuple[float, int]], steps: list[int]
) -> None:
    assert [[gate.step(used) for _ in range(count)][-1] for used, count in path] == steps


LASTING = np.random.default_rng(5).normal(5.0 * NOISE.torque_std_nm, NOISE.torque_std_nm, 2000)


@pytest.mark.parametrize(
    ("spins", "first", "last"),
    [
        # the noise of a light grip is no danger, a spin beyond it is one at once, and one that lasts soon
        (np.random.default_rng(4).normal(0.0, NOISE.torque_std_nm, 100), STABLE, STABLE),
        *((np.array([0.0, stds * NOISE.torque_std_nm]), STABLE, WARNING) for stds in (10.0, 60.0)),
        (LASTING, STABLE, WARNING),
    ],
)
def test_a_spin_is_a_danger_beyond_its_noise(spins: Array, first: int, last: int) -> None:
    rows = spun(spins)
    steps = rows["assessment"]["friction_step"]
    assert (steps[0], steps[-1], steps.max()) == (first, last, last)
    assert rows["utilisation"]["value"].max() > 1.0


SHEAR_N, RATIO_ALONE = 0.9 * MU, -1


UNKNOWN_WEIGHT = WrenchUncertainty(0.02, 0.0, unknown_n=1.0)


@pytest.mark.parametrize(
    ("load_n", "normal_n", "used", "spin_nm", "axis", "kind", "noise", "step"),
    [
        # a load that no friction holds
        *(
            (0.0, LIGHT_N, math.inf, stds * NOISE.torque_std_nm, 2, 0, NOISE, step)
            for stds, step in ((0.5, STABLE), (60.0, WARNING))
        ),
        # the friction ratio alone
        *(
            (SHEAR_N * LIGHT_N, LIGHT_N, 0.0, 0.0, 0, RATIO_ALONE, WrenchUncertainty(std_n), step)
            for std_n, step in ((0.2, STABLE), (0.005, WARNING))
        ),
        # what the unknown weight of the finger may add is no noise: a mean over readings makes it no smaller
        (0.02, 2.0, 0.01 / MU, 0.0, 0, 0, UNKNOWN_WEIGHT, WARNING),
        (SHEAR_N * 2.0, 2.0, 0.9, 0.0, 0, RATIO_ALONE, UNKNOWN_WEIGHT, WARNING),
    ],
)
def test_a_reading_counts_as_its_noise_allows(
    load_n: float,
    normal_n: float,
    used: float,
    spin_nm: float,
    axis: int,
    kind: int,
    noise: WrenchUncertainty,
    step: int,
) -> None:
    rows = contact_rows(3, load_n, normal_n, used, np.arange(3) * 1e-3)
    rows["contact"]["spin_nm"], rows["utilisation"]["kind"], rows["utilisation"]["twist"][:, axis] = spin_nm, kind, 1.0
    rows["contact"]["friction_ratio_std"] = 0.5 * (noise.unknown_n > 0.0)
    assess(watch(), rows, MU, noise)
    assert rows["assessment"]["friction_step"].tolist() == [step] * 3
