"""Contact centroid, spin and friction ratio of a wrench: (1)–(4), with (3) corrected."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.config import Levels, Slip
from slipd.fusion import Contact, contact_from_wrench
from slipd.fusion.contact import contact_of
from slipd.fusion.contact_state import ContactState, WrenchUncertainty
from slipd.fusion.rows import FREE, LATE, PENDING, TOUCHING, UNTRUSTED
from slipd.fusion.streaming import (
    contact_at,
    find_contacts,
    move_to_pad,
    new_readings,
    utilisation_at,
    wrench_at,
)

lengths = st.floats(-0.02, 0.02)
forces = st.floats(-20.0, 20.0)


@given(c=st.tuples(lengths, lengths), f=st.tuples(forces, forces), fn=st.floats(0.5, 50.0), m=st.floats(-0.5, 0.5))
def test_a_wrench_built_from_a_centroid_gives_it_back(c, f, fn, m) -> None:
    force = np.array((*f, -fn))
    torque = np.cross((*c, 0.0), force) + np.array((0.0, 0.0, m))  # M = C × F + (0, 0, m)
    contact = contact_from_wrench(force, torque)
    assert contact.valid
    numbers = (*contact.centroid_m, contact.spin_nm, contact.normal_n, contact.friction_ratio)
    assert numbers == pytest.approx((*c, m, fn, math.hypot(*f) / fn), abs=1e-11)


def test_the_centroid_is_less_certain_the_less_the_contact_is_pressed() -> None:
    noise = {"force_std_n": 0.02, "torque_std_nm": 0.0005}
    rng = np.random.default_rng(1)
    for fn in (0.5, 5.0):
        force, torque = np.array((0.1, 0.2, -fn)), np.cross((0.004, -0.002, 0.0), (0.1, 0.2, -fn))
        told = contact_from_wrench(force, torque, **noise)
        noisy = [
            contact_from_wrench(force + rng.normal(0, 0.02, 3), torque + rng.normal(0, 0.0005, 3)).centroid_m
            for _ in range(4000)
        ]
        assert np.std(noisy, axis=0) == pytest.approx((told.cx_std_m, told.cy_std_m), rel=0.1)


@pytest.mark.parametrize(
    ("force", "torque"),
    [
        ((0, 0, -0.1), (0, 0, 0)),
        ((0, 0, 3.0), (0, 0, 0)),
        ((math.nan, 0, -5), (0, 0, 0)),
        ((0, 0, -5), (0, math.inf, 0)),
    ],
)
def test_lift_off_pull_and_bad_data_are_no_contact_and_no_number(force, torque) -> None:
    contact = contact_from_wrench(force, torque)
    assert not contact.valid
    assert np.isnan((*contact.centroid_m, contact.spin_nm, contact.friction_ratio)).all()


READINGS = st.lists(
    st.tuples(
        st.sampled_from((PENDING, PENDING, PENDING, UNTRUSTED, LATE)),
        st.sampled_from((-1.0, 0.0, 0.39, 0.4, 0.45, 0.5, 7.0, math.nan, math.inf)),
        st.tuples(forces, forces),
        st.one_of(st.none(), st.tuples(lengths, lengths, lengths)),
    ),
    min_size=1,
    max_size=20,
)
"""Normal forces about those at which a contact begins and ends, and what is no number."""


@given(readings=READINGS, in_contact=st.booleans(), torque_std_nm=st.floats(0.0, 0.01))
def test_readings_that_follow_each_other_have_the_contacts_that_each_has(
    readings: list, in_contact: bool, torque_std_nm: float
) -> None:
    """A contact begins at 0.5 N and lasts down to 0.4 N; without torque its centroid and spin are not known."""
    nan = (math.nan,) * 3
    rows = new_readings(
        [(*force, -normal, *(torque or nan)) for _, normal, force, torque in readings],
        [100_000_000 * k for k in range(len(readings))],
    )
    rows["phase"] = [phase for phase, *_ in readings]
    moved = rows.copy()
    watch = ContactState(Levels(), Slip(), 0.001, 0.5)
    watch.set_uncertainty(WrenchUncertainty(0.02, torque_std_nm))
    watch.row["memory"]["in_contact"] = in_contact
    move_to_pad(moved, watch.row)
    ends_at, phases = find_contacts(rows, watch.row, 0, False)
    ends, found_phases = [], set()
    for k, (phase, *_, torque) in enumerate(readings):
        found, contact, wrench = rows[k], contact_at(rows, k), wrench_at(moved, k)
        *force, fz = wrench[:3]
        expected = contact_of(
            (*force, fz, *(wrench[3:] if torque else (0.0, 0.0, 0.0))), 0.4 if in_contact else 0.5, 0.02, torque_std_nm
        )
        if phase != PENDING or not expected.valid:
            expected = Contact(*nan, math.nan, -fz, *force, *nan, False)
        elif torque is None:
            expected = expected._replace(
                cx_m=math.nan, cy_m=math.nan, cx_std_m=math.nan, cy_std_m=math.nan, spin_nm=math.nan
            )
        found_phase = phase if phase != PENDING else TOUCHING if expected.valid else FREE
        assert found["phase"] == found_phase
        assert found["t_s"] == 100_000_000 * k * 1e-9
        found_phases.add(found_phase)
        assert utilisation_at(rows, k) is None
        assert math.isnan(found["tipping_margin_m"])
        assert np.array_equal(found["wrench"], wrench, equal_nan=True)
        assert np.array_equal(contact, expected, equal_nan=True)
        if found_phase != UNTRUSTED:
            ends += [k] if in_contact and not contact.valid else []
            in_contact = contact.valid
    assert ends_at == min(ends, default=len(rows))
    assert phases == sum(1 << phase for phase in found_phases)


def test_a_batch_of_any_size_is_transformed_like_single_readings() -> None:
    rng = np.random.default_rng(3)
    watch = ContactState(Levels(), Slip(), 0.001, 0.5)
    matrix, offset, weight = rng.normal(size=(6, 6)), rng.normal(size=6), rng.normal(size=6)
    matrix[:3, 3:] = 0.0
    now = watch.row["conditions"]
    now["matrix"], now["offset"], now["weight"] = matrix, offset, weight
    wrenches, times_ns = rng.normal(size=(50, 6)), list(range(50))
    moved = new_readings(wrenches.tolist(), times_ns)
    move_to_pad(moved, watch.row)
    expected = (wrenches - offset) @ matrix.T - weight
    assert moved["wrench"] == pytest.approx(expected)
    assert moved["t_s"].tolist() == [t_ns * 1e-9 for t_ns in times_ns]
    for k, wrench in enumerate(wrenches.tolist()):
        alone = new_readings([wrench], [0])
        move_to_pad(alone, watch.row)
        assert wrench_at(alone, 0) == wrench_at(moved, k), "to the last bit"
    found = new_readings(wrenches.tolist(), times_ns)
    find_contacts(found, watch.row, 0, False)
    assert np.array_equal(found["wrench"], moved["wrench"])


def test_a_torque_that_is_not_measured_leaves_the_force_alone() -> None:
    watch = ContactState(Levels(), Slip(), 0.001, 0.5)
    watch.row["conditions"]["matrix"][0, 3:, :3] = 0.02
    reading = new_readings([(1.0, 2.0, -3.0, *[math.nan] * 3)], [0])
    move_to_pad(reading, watch.row)
    assert reading["wrench"][0, :3].tolist() == [1.0, 2.0, -3.0]
    assert np.isnan(reading["wrench"][0, 3:]).all()
