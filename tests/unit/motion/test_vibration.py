"""The noise of sliding in the high band of a force sensor; what an arm or a motor does is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chirps import chirp
from plain_kernels import check_without_compilation

from slipd.motion import vibration
from slipd.motion.vibration import BLOCK, LOUD, MOST_SUPPORT, Vibration

RATE_HZ, SECONDS = 1000, 36
N = RATE_HZ * SECONDS
T = np.arange(N) / RATE_HZ


def surprises(wrenches: np.ndarray, read: int = BLOCK) -> np.ndarray:
    """Return the surprise of each block, 0 where there is no evidence; blocks begin ``read`` readings apart."""
    heard, found = Vibration(RATE_HZ), []
    for k in range(0, N - BLOCK, read):
        evidence = heard.update(10**11 + (k + read) * 1_000_000, wrenches[k : k + read])
        found += [] if evidence is None else [evidence.surprise]
    return np.concatenate((found, np.zeros(N // read - len(found))))


def white(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.02, (N, 6))


def pink() -> np.ndarray:
    frequency = np.fft.rfftfreq(N)
    frequency[0] = 1.0
    spectrum = np.fft.rfft(white(), axis=0) / np.sqrt(frequency)[:, None]
    return np.fft.irfft(spectrum, N, axis=0)


def low_pass() -> np.ndarray:
    noise = white()
    return sum(np.roll(noise, k, axis=0) for k in range(8)) / 8.0


def quiet(wrenches: np.ndarray) -> bool:
    """Return whether surprises are as rare as they say."""
    found = surprises(wrenches)
    return all((found > limit).mean() <= math.exp(-limit) for limit in (1.0, 2.0, 4.0))


def test_noise_of_the_sensor_and_an_arm_that_shakes_vibrates_or_knocks_are_no_sliding() -> None:
    assert all(map(quiet, (white(), pink(), low_pass(), np.round(white() / 0.02) * 0.02)))
    swings = 5.0 * np.sin(50.0 * T)[:, None] * (1.0, 0.5, 0.3, 0.0, 0.0, 0.0)
    loud = np.where(T % 3.0 > 2.8, 1.0, 0.0)[:, None] * np.random.default_rng(3).normal(0.0, 0.2, (N, 6))
    knocks = np.zeros((N, 6))
    for k in range(500, N - 200, 1700):
        ring = np.exp(-np.arange(200) / 20.0) * np.sin(0.9 * np.arange(200))
        knocks[k : k + 200, :3] += ring[:, None] * (3.0, 2.0, 2.0)
    assert all(quiet(white() + disturbance) for disturbance in (swings, loud, knocks))


def test_a_motor_is_predicted() -> None:
    hums = np.where(T % 4.0 > 2.0, 0.5, 0.0) * np.sin(754.0 * T)
    found = surprises(white() + hums[:, None] * (1.0, 0.5, 0.2, 0.0, 0.0, 0.0))
    assert (found > 4.0).mean() < 0.03, "little but the block in which it begins"


@pytest.mark.parametrize("read", [BLOCK, BLOCK + 8])
def test_a_rough_surface_that_slides_is_heard_but_never_alone_enough(read: int) -> None:
    slides = np.where(T % 3.0 > 2.7, 1.0, 0.0)[:, None] * np.random.default_rng(3).normal(0.0, 0.05, (N, 6))
    found = surprises(white() + slides * (1.0, 1.0, 0.3, 0.0, 0.0, 0.0), read)
    assert (found > LOUD).mean() == pytest.approx(0.1, abs=0.03)
    assert found.max() == MOST_SUPPORT


@pytest.mark.parametrize("value", [0.0, math.nan])
def test_silence_and_damage_say_nothing(value: float) -> None:
    assert not surprises(np.full((N, 6), value)).any()


@pytest.mark.parametrize("loud", [0.0, 1.0])
def test_the_kernels_find_the_same_without_compilation(loud: float) -> None:
    readings = np.random.default_rng(1).normal(0.0, 0.02, (BLOCK, 3)) + np.sin(0.9 * np.arange(BLOCK))[:, None]
    check_without_compilation(vibration._powers, loud * readings, np.zeros(4))
    check_without_compilation(vibration._unpredictable, loud * readings[:, 0])


@pytest.mark.parametrize(
    ("normal", "expected"),
    [
        (0.0, [0.0] * 5 + [3.68834, 5.90101, 5.42311, 4.81669] + [6.0] * 6),
        (0.05, [0.0] * 6 + [4.19469, 0.0, 0.0, 3.00099, 3.87423, 0.0, 4.061, 3.97995, 4.23038]),
    ],
)
def test_the_surprise_of_a_sliding_that_grows_louder_keeps_its_digits(normal: float, expected: list[float]) -> None:
    """It is less where the normal force shakes as well."""
    heard, found = Vibration(RATE_HZ), []
    for n, block in enumerate(0.02 * chirp(75, BLOCK, 6)):
        louder = max(n - 60, 0)
        scale = 1.0 + louder * np.array((0.12, 0.132, normal, 0.0, 0.0, 0.0))
        evidence = heard.update(10**11 + n * BLOCK * 1_000_000, block * scale)
        found.append(0.0 if evidence is None else evidence.surprise)
    assert found == pytest.approx([0.0] * 60 + expected, abs=1e-4)


def test_a_new_contact_settles_first_and_a_block_needs_its_readings() -> None:
    heard, noise = Vibration(RATE_HZ), white()
    for k in range(0, 20 * BLOCK, BLOCK):
        heard.update(10**11 + k * 1_000_000, noise[k : k + BLOCK])
    heard.reset()
    assert heard.update(10**11, 5.0 * noise[:BLOCK]) is None
    with pytest.raises(ValueError, match="must have 32 readings, got 31"):
        heard.update(10**11, noise[: BLOCK - 1])
