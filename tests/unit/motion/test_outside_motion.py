"""A displacement or a speed of the object that another process states, beyond its errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.motion.evidence import Evidence
from slipd.motion.outside_motion import OutsideMotion
from slipd.types.samples import ObjectSample

RATE_HZ, T0 = 30.0, 10**11
LEVEL = (0.0, 0.0, 0.0, 1.0)
CERTAIN = 13.0


def observed(*pose: tuple[float, ...], **speed: float) -> ObjectSample:
    return ObjectSample(T0, None, *pose, **speed)


def watch(readings: list[ObjectSample], motion: OutsideMotion | None = None) -> list[tuple[int, Evidence]]:
    motion = motion or OutsideMotion(5e-4, RATE_HZ)
    found = [motion.update(T0 + round(k * 1e9 / RATE_HZ), r, held=True) for k, r in enumerate(readings)]
    return [(k, evidence) for k, evidence in enumerate(found) if evidence is not None]


def places(moved_m: np.ndarray, std_m: float, seed: int = 1) -> list[ObjectSample]:
    rng = np.random.default_rng(seed)
    return [observed(tuple(np.array((moved, 0.01, 0.1)) + rng.normal(0.0, std_m, 3))) for moved in moved_m]


def turn(angle: float) -> tuple[float, ...]:
    return 0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)


def test_a_displacement_and_a_turn_beyond_their_errors_are_found() -> None:
    moved = 0.006 * np.clip((np.arange(120) - 60) / 20.0, 0.0, 1.0)
    readings = [places(moved, 5e-4)]
    for sign in (1.0, -1.0):  # a quaternion and its negative are one orientation
        turned = [tuple(sign**k * q for q in turn(0.01 * max(k - 60, 0))) for k in range(90)]
        readings.append([observed((0.0, 0.0, 0.1), quaternion) for quaternion in turned])
    for found in map(watch, readings):
        assert 60 < next(k for k, evidence in found if evidence.surprise > CERTAIN) < 85


def test_a_speed_counts_by_its_own_error() -> None:
    found = watch([observed(speed_mps=0.001 if k < 60 else 0.02, speed_std_mps=0.002) for k in range(90)])
    assert [k for k, evidence in found if evidence.surprise > CERTAIN] == list(range(61, 90))
    assert watch([observed(speed_mps=0.02)] * 90) == []
    assert watch([observed()] * 90) == []


@pytest.mark.parametrize("std_m", [0.0, 1e-4, 3e-3])
def test_noise_is_as_rare_as_it_says(std_m: float) -> None:
    looks = found = 0
    for seed in range(12):
        surprises = [evidence.surprise for _, evidence in watch(places(np.zeros(600), std_m, seed))]
        found += sum(surprise > 5.0 for surprise in surprises)
        looks += 580
    assert found <= looks * math.exp(-5.0)


def test_one_wrong_reading_is_none() -> None:
    moved = np.zeros(90)
    moved[60] = 0.5
    assert all(evidence.surprise < 5.0 for _, evidence in watch(places(moved, 1e-4)))


def test_the_reference_begins_anew_with_the_hold_and_where_the_orientation_comes_or_goes() -> None:
    motion = OutsideMotion(5e-4, RATE_HZ)
    watch(places(np.zeros(60), 1e-4), motion)
    assert motion.update(T0 + 3 * 10**9, observed((0.5, 0.0, 0.0)), held=False) is None
    assert watch(places(np.full(60, 0.5), 1e-4), motion)[-1][1].surprise < 5.0
    turned = observed((0.9, 0.0, 0.0), LEVEL)
    assert motion.update(T0 + 4 * 10**9, turned, held=True) is None


def test_a_confirmed_motion_is_measured_from_there() -> None:
    motion = OutsideMotion(5e-4, RATE_HZ)
    assert watch(places(np.where(np.arange(90) < 60, 0.0, 0.01), 1e-4), motion)[-1][1].surprise > CERTAIN
    motion.confirm()
    later = [
        motion.update(T0 + 4 * 10**9 + k * 33_000_000, r, held=True)
        for k, r in enumerate(places(np.full(90, 0.01), 1e-4))
    ]
    assert all(evidence is None or evidence.surprise < 6.0 for evidence in later)
