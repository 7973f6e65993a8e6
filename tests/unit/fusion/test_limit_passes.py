"""Bounds and answers of the friction limit do not depend on how much work is done, nor on where it starts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from limit_contacts import MU, disc, random_contact

from slipd.config import Levels, Slip
from slipd.fusion import torque_limit, utilisation
from slipd.fusion.contact_state import ContactState
from slipd.fusion.limit.batch import solve_readings
from slipd.fusion.rows import FREE, UNTRUSTED
from slipd.fusion.streaming import contact_at, find_contacts, new_readings, utilisation_at


@pytest.mark.parametrize("gap", [1e-2, 1e-6])
def test_a_gap_asked_for_is_kept_and_not_undercut_by_much_work(gap: float) -> None:
    for seed in range(100):
        x, y, loads, f, spin = random_contact(seed)
        centre = (loads @ x / loads.sum(), loads @ y / loads.sum())
        used = utilisation(x, y, loads, MU, f, spin, centre, gap=gap)
        exact = utilisation(x, y, loads, MU, f, spin, centre)
        assert used.upper - used.lower <= 1.001 * gap * used.upper
        assert max(used.lower, exact.lower) <= min(used.upper, exact.upper)


@pytest.mark.parametrize(
    ("solve", "met"),
    [
        (
            lambda x, y, loads, f, spin, passes: utilisation(x, y, loads, MU, f, 0.1 * spin, (0.01, 0), passes=passes),
            {2: 67, 4: 108, 5: 130, 7: 158, 8: 172, 10: 185, 12: 193, 15: 198, 20: 199},
        ),
        (
            lambda x, y, loads, f, spin, passes: torque_limit(
                x, y, loads, MU, f, (0.01, 0), round(math.copysign(1, spin)), passes=passes
            ),
            {2: 49, 4: 109, 5: 123, 7: 140, 8: 161, 10: 183, 12: 192, 15: 195, 20: 200},
        ),
    ],
)
def test_the_bounds_hold_after_any_number_of_passes_and_meet_after_few(
    solve: Callable[..., tuple[float, ...]], met: dict[int, int]
) -> None:
    """In so many of 200 contacts, but for a few in which rounding decides."""
    found = Counter()
    for contact in map(random_contact, range(200)):
        _, least, most, *_ = solve(*contact, 120)
        for passes in met:
            _, lower, upper, *_ = solve(*contact, passes)
            assert max(lower, least) <= min(upper, most)
            found[passes] += upper - lower <= 1e-9 * max(abs(upper), 1e-3)
    assert all(found[passes] >= count - 3 for passes, count in met.items())


def test_the_start_changes_no_answer() -> None:
    for seed in range(40):
        x, y, loads, f, spin = random_contact(seed)
        about = (0.01, 0.02)
        plain = utilisation(x, y, loads, MU, f, spin, about)
        rng = np.random.default_rng(seed)
        starts = [plain.twist, (0.0, 0.0, 1.0), (math.nan, 0.0, 1.0), (math.inf, 0.0, 0.0), (0.0, 0.0, 0.0)]
        for start in [*starts, *(tuple(rng.normal(size=3)) for _ in range(5))]:
            again = utilisation(x, y, loads, MU, f, spin, about, start=start)
            assert again.value == pytest.approx(plain.value, rel=1e-10)
            assert again.upper - again.lower <= 1e-9 * again.value


@pytest.mark.parametrize("seed", range(10))
def test_readings_that_follow_each_other_have_the_utilisation_that_each_has(seed: int) -> None:
    """Each solution starts from the last twist; unsolved readings keep it, and a reading without contact resets it."""
    x, y, loads, f, spin = random_contact(seed)
    x, y, shares = x - x.mean(), y - y.mean(), loads / loads.sum()
    rng = np.random.default_rng(seed)
    wrench = np.tile((*f / loads.sum(), -1.0, 0.0, 0.0, spin / loads.sum()), (12, 1)) * rng.uniform(0.5, 1.0, (12, 6))
    wrench *= rng.uniform(2.0, 9.0, (12, 1))
    wrench[4, 2] = 1.0
    readings = new_readings(wrench.tolist(), list(range(12)))
    readings["phase"][8] = UNTRUSTED
    watch = ContactState(Levels(), Slip(), 0.001, 0.5)
    find_contacts(readings, watch.row, 0, False)
    assert readings["phase"][[4, 8]].tolist() == [FREE, UNTRUSTED]
    assert utilisation_at(readings, 0) is None, "not solved yet"
    singly, unknown = readings.copy(), (math.nan,) * 3
    solve_readings(readings, x, y, shares, MU, 1.0, *unknown, 1e-9, 40)
    twist = None
    for k in range(12):
        solve_readings(singly[k : k + 1], x, y, shares, MU, 1.0, *(twist or unknown), 1e-9, 40)
        assert repr(singly[k]) == repr(readings[k]), "to the last bit"
        told, contact = utilisation_at(readings, k), contact_at(readings, k)
        if not contact.valid:
            assert (told.kind, math.isnan(told.value), told.pole_m) == ("none", True, None)
            twist = twist if k == 8 else None
            continue
        alone = utilisation(
            x, y, shares * contact.normal_n, MU, contact.tangential_n, contact.spin_nm, contact.centroid_m, start=twist
        )
        assert told.value == pytest.approx(alone.value, rel=2e-9)
        assert told.lower <= told.value <= told.upper <= told.lower * (1.0 + 2e-9)
        twist = told.twist


def test_a_scene_that_moves_little_needs_fewer_passes_from_the_twist_before() -> None:
    x, y, loads = disc(0.01, 12)
    gaps = []
    for step in range(20):
        f, spin, about = (0.1 + 1e-3 * step, 0.05), 1e-3, (0.001, 0.0)
        before = utilisation(x, y, loads, MU, (f[0] - 1e-3, f[1]), spin, about)
        both = [utilisation(x, y, loads, MU, f, spin, about, passes=2, start=start) for start in (None, before.twist)]
        gaps.append([used.upper - used.lower for used in both])
    cold, warm = np.median(gaps, axis=0)
    assert warm < 0.05 * cold
