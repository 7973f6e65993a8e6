"""Motion of the contact in the image: found where the patch moves over the pad, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from chirps import chirp
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.trace import GraspTrace, simulate

from slipd.motion.evidence import Evidence, f_surprise
from slipd.motion.image_blocks import ImageBlocks, LoadNoise
from slipd.motion.image_shift import ImageShift
from slipd.motion.shift_path import AGAIN_M, LONG_STEP, LONGEST_NS, SHORTEST_NS, PathNoise
from slipd.signals.pad import PadGeometry
from slipd.tools.sim.scene_parts import Pad
from slipd.types.arrays import Array

GEOMETRY = PadGeometry(8, 16, 0.004, 0.003)
X, Y = GEOMETRY.positions()
PAD = Pad(8, 16, 0.004, 0.003)
RATE_HZ, PERIOD_NS, T0 = 100, 10_000_000, 100_000_000_000
NOISE = LoadNoise(0.02, 0.0005)
READINGS = 10
"""Force readings between two images, whose mean counts."""
CERTAIN = 12.0
CREEPS = FrictionLaw(0.5, 0.5, 0.01, 20.0)

Ramp = Callable[[float], tuple[float, float]]


def still(t_s: float) -> tuple[float, float]:
    return 4.0 * min(t_s, 1.0), 0.0


def shaken(t_s: float) -> tuple[float, float]:
    return 3.0 * min(t_s, 1.0) + 2.0 * math.sin(12.6 * t_s), 1.5 * math.sin(18.8 * t_s)


def creeping(speed_mps: float) -> Ramp:
    carried_n = 10.0 * (1.0 + 20.0 * speed_mps)
    return lambda t_s: (0.866 * carried_n * min(t_s / 1.5, 1.0), -0.5 * carried_n * min(t_s / 1.5, 1.0))


def grasp(
    seconds: float, force: Ramp, *, kind: str = "rounded", moves: bool = True, growth: float = 0.0,
    law: FrictionLaw | None = None, grip: Callable[[float], float] = lambda _: 10.0, tilt_nm: float = 0.0,
) -> GraspTrace:  # fmt: skip
    t = np.arange(0.0, seconds, 0.005)
    history = LoadHistory(
        t,
        np.array([force(x) for x in t]),
        np.zeros(len(t)),
        np.array([grip(x) for x in t]),
        tilt_nm * np.stack((np.sin(9.0 * t), np.sin(13.0 * t)), axis=1),
    )
    patch = ContactPatch(kind, 0.014, 0.009, growth=growth, moves_with_object=moves)
    return simulate(GraspedObject(0.2), patch, law or FrictionLaw(), PadCompliance(), history, cell_m=0.001)


def measured(rng: np.random.Generator, wrench: Array, *, torque: bool = True) -> tuple[float, ...]:
    """Return the mean of what a force sensor measures between two images; it may measure no torque."""
    noisy = np.asarray(wrench) + rng.normal(0.0, READINGS**-0.5, 6) * np.repeat(NOISE, 3)
    return tuple(np.where(np.arange(6) < (6 if torque else 3), noisy, math.nan).tolist())


def watch(
    trace: GraspTrace, shift: ImageShift | None = None, *, torque: bool = True, confirms: bool = False
) -> Iterator[tuple[Evidence, float, int]]:
    """Yield evidence in noisy images, how far the object had moved, m, and until when it counts as moving."""
    shift, rng = shift or ImageShift(GEOMETRY, NOISE), np.random.default_rng(1)
    times_s = np.arange(0.0, trace.t_s[-1], 1.0 / RATE_HZ)
    for t_s, image in zip(times_s, trace.taxel_loads(PAD, times_s), strict=True):
        k = int(np.searchsorted(trace.t_s, t_s, side="right")) - 1
        loads = image * trace.normal_n[k] / image.sum() + rng.normal(0.0, 0.005, image.size)
        evidence = shift.update(T0 + round(t_s * 1e9), loads, measured(rng, trace.wrench_left[k], torque=torque))
        if evidence is not None:
            certain = confirms and evidence.surprise > CERTAIN
            yield evidence, math.hypot(*trace.displacement[k, :2]), shift.confirm() if certain else 0


@pytest.mark.no_cover
@pytest.mark.parametrize(("kind", "speed_mps", "torque"), [("ring", 0.001, False), ("rectangle", 0.003, True)])
def test_a_patch_that_creeps_over_the_pad_is_found_within_a_millimetre(
    kind: str, speed_mps: float, torque: bool
) -> None:
    trace = grasp(1.7 + 0.0013 / speed_mps, creeping(speed_mps), kind=kind, law=CREEPS)
    assert math.hypot(*trace.displacement[-1, :2]) > 7e-4
    at_m = [moved_m for evidence, moved_m, _ in watch(trace, torque=torque) if evidence.surprise > CERTAIN]
    assert 2e-4 < at_m[0] < 1e-3


def test_a_patch_that_stays_on_the_pad_shows_nothing() -> None:
    trace = grasp(3.0, creeping(0.001), kind="rectangle", moves=False, law=CREEPS)
    assert math.hypot(*trace.displacement[-1, :2]) > 7e-4
    assert list(watch(trace)) == []


@pytest.mark.no_cover
@pytest.mark.parametrize(
    ("force", "more", "torque"),
    [
        (still, {"kind": "rectangle", "tilt_nm": 0.03}, True),
        (shaken, {"kind": "disc", "moves": False, "tilt_nm": 0.03}, False),
        (shaken, {"kind": "disc", "growth": 0.33, "tilt_nm": 0.03}, True),
        (still, {"kind": "rectangle", "moves": False, "growth": 0.33, "grip": lambda t_s: 10.0 + 2.0 * t_s}, True),
    ],
)
def test_a_changing_load_is_no_motion(force: Ramp, more: dict[str, Any], torque: bool) -> None:
    trace = grasp(2.5, force, **more)
    assert not trace.gross.any()
    assert list(watch(trace, torque=torque)) == []


@pytest.mark.no_cover
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
@pytest.mark.no_cover
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


def test_images_without_load_or_without_grip_show_nothing() -> None:
    for normal_n, image in ((10.0, np.zeros(128)), (0.0, np.ones(128))):
        shift = ImageShift(GEOMETRY, NOISE)
        wrench = (1.0, 0.0, -normal_n, 0.0, 0.0, 0.0)
        assert all(shift.update(T0 + k * PERIOD_NS, image, wrench) is None for k in range(100))


@pytest.mark.parametrize("torque", [True, False])
def test_a_confirmed_motion_is_followed_from_taxel_to_taxel_and_forgotten_after_a_rest(torque: bool) -> None:
    trace = grasp(5.0, creeping(0.0025), kind="rectangle", law=CREEPS)
    shift = ImageShift(GEOMETRY, NOISE)
    with pytest.raises(ValueError, match="before it is confirmed"):
        shift.confirm()
    found = [(e.t_ns, moved_m, until_ns) for e, moved_m, until_ns in watch(trace, shift, torque=torque, confirms=True)
             if until_ns]  # fmt: skip
    times_ns, moved_m, until_ns = np.array(found).T
    assert moved_m[-1] > PAD.pitch_m, "it is still followed"
    assert np.diff(moved_m).min() > 0.5 * AGAIN_M, "reported again only after a further motion"
    assert ((until_ns - times_ns >= SHORTEST_NS) & (until_ns - times_ns <= LONGEST_NS)).all()
    rng, end_ns = np.random.default_rng(2), T0 + round(trace.t_s[-1] * 1e9)
    (image,) = trace.taxel_loads(PAD, trace.t_s[-1:])
    wrench = measured(rng, trace.wrench_left[-1], torque=torque)
    rested = [
        shift.update(end_ns + k * PERIOD_NS, image + rng.normal(0.0, 0.005, image.size), wrench) for k in range(200)
    ]
    assert rested[100:] == [None] * 100


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
    ("torque", "turns", "slides_m", "expected", "until_ms"),
    [
        (
            True, 0.0, 1e-5,
            {90: 21.158, 95: 23.794, 100: 26.014, 105: 28.206, 115: 32.331, 130: 37.644, 140: 40.748},
            [1450, 1450, 1600, 1700],
        ),
        (
            False, 0.0, 1e-5, {95: 28.12, 100: 30.153, 105: 32.401, 115: 32.401, 125: 32.401, 140: 32.401},
            [1450, 1450, 1550, 1700],
        ),
        (
            True, 1e-3, 0.0, {90: 37.44, 95: 44.1, 100: 42.107, 105: 47.024, 120: 47.024, 135: 47.024},
            [1450, 1500, 1650],
        ),
        (
            False, 5e-4, 1e-5, {95: 24.706, 100: 24.541, 105: 26.734, 120: 26.734, 130: 26.734, 145: 26.734},
            [1450, 1500, 1600, 1750],
        ),
    ],
)  # fmt: skip
def test_the_surprise_of_a_patch_that_slides_or_turns_keeps_its_digits(
    torque: bool, turns: float, slides_m: float, expected: dict[int, float], until_ms: list[int]
) -> None:
    """From the first second on, the motion is confirmed, so that only a further one is evidence."""
    shift, found, until_ns = ImageShift(GEOMETRY, NOISE), {}, []
    for k, noise in enumerate(chirp(150, 6, turn=0.7) * np.repeat((0.005, 1e-4), 3)):
        moved_m, angle = max(k - 60, 0) * slides_m, max(k - 60, 0) * turns
        x, y = X - 0.8 * moved_m, Y - 0.6 * moved_m
        u, v = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
        image = 0.3 * np.exp(-((u / 0.014) ** 4) - (v / 0.009) ** 4) + 0.002 * chirp(150, 128)[k]
        spin = 0.03 + (0.8 * 3.0 - 0.6 * 4.0) * moved_m
        wrench = noise + np.array((4.0, 3.0, -12.0, -7.2 * moved_m, 9.6 * moved_m, spin))
        wrench[3:] += 0.0 if torque else math.nan
        evidence = shift.update(T0 + k * PERIOD_NS, image, tuple(wrench.tolist()))
        if evidence is not None:
            found[k] = evidence.surprise
            until_ns += [shift.confirm()] if k > 100 else []
    assert found == pytest.approx(expected, abs=2e-3)
    assert [(end_ns - T0) / 1e6 for end_ns in until_ns] == until_ms


def test_loads_are_the_same_within_shares_of_themselves_and_the_noise() -> None:
    """4 N along X and 10 N of grip: 15 % of the one, 7 % of the other, and four standard deviations of the noise."""
    blocks = ImageBlocks(GEOMETRY, NOISE)
    wrench = (4.0, 0.0, -10.0, 0.0, 0.0, 0.0)
    found = [blocks.update(T0 + k * PERIOD_NS, np.full(128, 0.1), wrench) for k in range(60)]
    block = next(block for block in found if block is not None)
    reach_m = 0.25 * math.hypot(8, 16) * GEOMETRY.pitch_m
    along, across, spin, centroid = 0.6 + 0.08, 0.7 + 0.08, reach_m * 0.6 + 0.002, 1e-3 + 0.002 / 10.0
    assert block.tolerance == pytest.approx([along, along, across, spin, centroid, centroid])
    assert block.rise_n == pytest.approx(0.03 * 4.0 + 0.08 / math.sqrt(len(block.wrenches)))
    assert block.same_load(block, np.zeros(2))
    for k in range(6):
        for share in (0.99, 1.01):
            moved = block.load + (np.arange(6) == k) * share * block.tolerance
            same = block.same_load(block._replace(load=moved), np.zeros(2))
            assert same == (k > 0 and share < 1.0), "a larger tangential force is another load"
