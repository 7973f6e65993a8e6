"""Motion of the contact in the image: found where the patch moves over the pad, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from chirps import chirp
from plain_kernels import run_without_compilation

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.motion import image_blocks, image_fit, shift_path
from slipd.motion.evidence import LONG_STEP, REPORTED_NS, Evidence, f_surprise
from slipd.motion.image_blocks import ImageBlocks
from slipd.motion.image_shift import ImageShift
from slipd.motion.shift_path import LONGEST_NS, PathNoise
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

GEOMETRY = PadGeometry(8, 16, 0.004, 0.003)
X, Y = GEOMETRY.positions()
RATE_HZ, PERIOD_NS, T0 = 100, 10_000_000, 100_000_000_000
NOISE = WrenchUncertainty(0.02, 0.0005)
READINGS = 10
"""Force readings between two images, whose mean counts."""
CERTAIN = 12.0


def measured(rng: np.random.Generator, wrench: Array, *, torque: bool = True) -> tuple[float, ...]:
    """Return the mean of what a force sensor measures between two images; it may measure no torque."""
    noisy = np.asarray(wrench) + rng.normal(0.0, READINGS**-0.5, 6) * np.repeat(NOISE[:2], 3)
    return tuple(np.where(np.arange(6) < (6 if torque else 3), noisy, math.nan).tolist())


def watch(
    shift: ImageShift, count: int, *, turns: float = 0.0, slides_m: float = 0.0, ends: int = 1000, gripped: float = 0.0,
    tilted: float = 0.0, torque: bool = True,
) -> Iterator[Evidence | None]:  # fmt: skip
    """Yield the evidence in each image of a patch under 5 N, which slides along them or turns from the 60th image on.

    Args:
        shift: Finds the motion.
        count: Images.
        turns: By how much it turns between two images.
        slides_m: How far it slides between two images, m.
        ends: The image with which the motion ends.
        gripped: Share by which the grip swings.
        tilted: Slope by which the pressure swings, 1/m.
        torque: The force sensor measures a torque.
    """
    for k, noise in enumerate(chirp(count, 6, turn=0.7) * np.repeat((0.005, 1e-4), 3)):
        steps = min(max(k - 60, 0), ends - 60)
        grip, slope = 1.0 + gripped * math.sin(0.05 * k), tilted * math.sin(0.09 * k)
        c, s = math.cos(steps * turns), math.sin(steps * turns)
        x, y = X - 0.8 * steps * slides_m, Y - 0.6 * steps * slides_m
        u, v = (x * c + y * s) / grip ** (1 / 3), (y * c - x * s) / grip ** (1 / 3)
        loads = 0.3 * grip * np.exp(-((u / 0.014) ** 4) - (v / 0.009) ** 4) * (1.0 + slope * X)
        at_m, force = loads @ np.stack((X, Y), axis=1) / loads.sum(), np.array((4.0, 3.0, -12.0 * grip))
        wrench = noise + np.concatenate((force, np.cross((*at_m, 0.0), force) + np.array((0.0, 0.0, 0.03))))
        wrench[3:] += 0.0 if torque else math.nan
        yield shift.update(T0 + k * PERIOD_NS, loads + 0.002 * chirp(count, 128)[k], tuple(wrench.tolist()))


@pytest.mark.uncovered
@pytest.mark.parametrize("keeps", [0.0, 0.99, 1.0])
def test_noise_that_is_white_or_drifts_or_walks_is_no_motion(keeps: float) -> None:
    rng, shift = np.random.default_rng(7), ImageShift(GEOMETRY, NOISE)
    loads = np.where((np.abs(X) < 0.011) & (np.abs(Y) < 0.008), 0.3, 0.0)
    drift = np.zeros(loads.size)
    for k in range(12 * RATE_HZ):
        drift = keeps * drift + rng.normal(0.0, 0.0005, loads.size)
        image = loads + drift * (keeps > 0.0) + rng.normal(0.0, 0.005, loads.size)
        assert shift.update(T0 + k * PERIOD_NS, image, measured(rng, (3.0, 0.0, -10.0, 0.0, 0.0, 0.0))) is None


@pytest.mark.statistics
@pytest.mark.uncovered
@pytest.mark.parametrize("walks", [0.0, 0.1, 1.0])
def test_the_surprise_of_a_path_is_as_rare_as_it_says(walks: float) -> None:
    """1600 paths of noise, white or walking or both."""
    rng = np.random.default_rng(11)
    surprises, along = [], np.array((0.6, 0.0, 0.8))
    for _ in range(1600):
        noise = PathNoise()
        places = [*(rng.normal(0.0, walks * 1e-5, (60, 3)).cumsum(0) + rng.normal(0.0, 1e-5, (60, 3)))]
        for k in range(1, 61):
            noise.add(places[:k], 1)
            noise.add(places[: max(k - 2 * LONG_STEP, 0)], LONG_STEP)
        surprises.append(noise.surprise(along, float(along @ (places[-1] - rng.normal(0.0, 1e-5, 3))), 60))
    for limit in (4.0, 6.0):
        expected = 1600 * math.exp(-limit)
        assert sum(surprise > limit for surprise in surprises) <= expected + 4.0 * math.sqrt(expected)


def test_the_surprise_of_a_path_is_that_of_its_known_noise_and_none_without() -> None:
    along = np.array((1.0, 0.0, 0.0))
    assert PathNoise().surprise(along, 1e-3, 1) == 0.0
    known = PathNoise(np.full(3, 1e-5))  # worth 20 second differences: all of it may be a walk
    assert known.surprise(along, 1e-4, 1) == pytest.approx(f_surprise(1e-8 / (2e-10 + 3e-10), 1, 10))


def test_images_without_load_or_with_no_grip_or_a_swinging_one_show_nothing() -> None:
    for normal_n, swings_n, image in ((10.0, 0.0, np.zeros(128)), (0.0, 0.0, np.ones(128)), (10.0, 4.0, np.ones(128))):
        shift = ImageShift(GEOMETRY, NOISE)
        wrenches = [(1.0, 0.0, -normal_n - swings_n * (k % 2), 0.0, 0.0, 0.0) for k in range(100)]
        assert not any(shift.update(T0 + k * PERIOD_NS, image, wrench) for k, wrench in enumerate(wrenches))


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_a_contact_that_turns_about_its_centroid_is_found_where_it_follows_its_torque(turns: float) -> None:
    shift, rng, found = ImageShift(GEOMETRY, NOISE), np.random.default_rng(1), []
    for k in range(200):
        angle = turns * 0.1 * max(k - 60, 0) / RATE_HZ
        u, v = X * math.cos(angle) + Y * math.sin(angle), Y * math.cos(angle) - X * math.sin(angle)
        image = 0.3 * np.exp(-((u / 0.014) ** 4) - (v / 0.009) ** 4) + rng.normal(0.0, 0.002, X.size)
        found.append(shift.update(T0 + k * PERIOD_NS, image, measured(rng, (0.5, 0.0, -10.0, 0.0, 0.0, 0.05))))
    assert any(evidence is not None and evidence.surprise > CERTAIN for evidence in found) == (turns > 0.0)


@pytest.mark.parametrize(
    ("torque", "turns", "slides_m", "expected", "until_ms", "plain"),
    [
        (
            True, 0.0, 1e-5,
            {90: 21.185, 95: 23.822, 100: 26.043, 105: 28.236, 115: 32.363, 130: 37.678, 140: 40.784},
            [1450, 1450, 1600, 1700], False,
        ),
        (
            False, 0.0, 1e-5, {90: 31.406, 95: 37.344, 100: 39.23, 105: 42.237, 115: 42.237, 125: 42.237, 140: 42.237},
            [1450, 1450, 1550, 1700], False,
        ),
        (
            True, 1e-3, 0.0, {90: 41.236, 95: 48.728, 100: 47.436, 105: 52.623, 120: 52.623, 135: 52.623, 145: 52.623},
            [1450, 1500, 1650, 1750], False,
        ),
        (
            False, 5e-4, 1e-5,
            {90: 27.911, 95: 33.616, 100: 33.471, 105: 36.484, 115: 36.484, 125: 36.484, 140: 36.484},
            [1450, 1450, 1550, 1700], True,
        ),
    ],
)  # fmt: skip
def test_the_surprise_of_a_patch_that_slides_or_turns_keeps_its_digits(
    torque: bool, turns: float, slides_m: float, expected: dict[int, float], until_ms: list[int], plain: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """From the first second on, the motion is confirmed, so that only a further one is evidence."""
    run_without_compilation(monkeypatch, *[image_blocks, image_fit, shift_path] * plain)
    shift, found, until_ns = ImageShift(GEOMETRY, NOISE), {}, []
    for k, evidence in enumerate(watch(shift, 150, turns=turns, slides_m=slides_m, torque=torque)):
        if evidence is not None:
            found[k] = evidence.surprise
            until_ns += [shift.confirm()] if k > 100 else []
    assert found == pytest.approx(expected, abs=2e-3)
    assert [(end_ns - T0) / 1e6 for end_ns in until_ns] == until_ms


@pytest.mark.parametrize(("torque", "surprises"), [(True, (11.688, 23.866)), (False, (42.674, 42.674))])
def test_a_confirmed_motion_is_followed_from_taxel_to_taxel_and_forgotten_after_a_rest(
    torque: bool, surprises: tuple[float, float]
) -> None:
    shift, found = ImageShift(GEOMETRY, NOISE), {}
    with pytest.raises(ValueError, match="before it is confirmed"):
        shift.confirm()
    for k, evidence in enumerate(watch(shift, 300, slides_m=1e-4, ends=140, torque=torque)):
        if evidence is not None:
            found[k] = evidence.surprise
            assert REPORTED_NS <= shift.confirm() - evidence.t_ns <= LONGEST_NS
    at = list(found)
    assert (at[0], at[-1]) == (70, 145), "found after a millimetre, and followed over two taxels"
    assert np.diff(at).max() <= 10
    assert (found[70], found[145]) == pytest.approx(surprises, abs=0.01)


@pytest.mark.parametrize("torque", [True, False])
@pytest.mark.parametrize(("gripped", "tilted"), [(0.2, 0.0), (0.0, 4.0), (0.2, 3.0)])
def test_a_changing_load_is_no_motion(gripped: float, tilted: float, torque: bool) -> None:
    """The contact grows with the grip, as that of a sphere, and tilts about its middle."""
    shift = ImageShift(GEOMETRY, NOISE)
    assert list(watch(shift, 250, gripped=gripped, tilted=tilted, torque=torque)) == [None] * 250


def test_loads_are_the_same_within_shares_of_themselves_and_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """4 N along X and 10 N of grip: 10 % of each, and four standard deviations of the noise."""
    run_without_compilation(monkeypatch, image_blocks)
    blocks, wrench = ImageBlocks(GEOMETRY, NOISE), (4.0, 0.0, -10.0, 0.0, 0.0, 0.0)
    block = next(filter(None, (blocks.update(T0 + k * PERIOD_NS, np.full(128, 0.1), wrench) for k in range(60))))
    reach_m = 0.25 * math.hypot(8, 16) * GEOMETRY.pitch_m
    along, across, spin, centroid = 0.4 + 0.08, 1.0 + 0.08, reach_m * 0.4 + 0.002, 1e-3 + 0.002 / 10.0
    assert block.tolerance == pytest.approx([along, along, across, spin, centroid, centroid])
    assert block.rise_n == pytest.approx(0.03 * 4.0 + 0.08 / math.sqrt(len(block.wrenches)))
    assert block.same_load(block, np.zeros(2))
    for k in range(6):
        for share in (0.99, 1.01):
            moved = block.load + (np.arange(6) == k) * share * block.tolerance
            same = block.same_load(block._replace(load=moved), np.zeros(2))
            assert same == (k > 0 and share < 1.0), "a larger tangential force is another load"
