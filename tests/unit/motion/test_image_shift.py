"""Motion of the contact in the image: found where the patch moves over the pad, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from slipd.motion.evidence import Evidence
from slipd.motion.image_blocks import LoadNoise
from slipd.motion.image_fit import ImageFitter
from slipd.motion.image_shift import ImageShift
from slipd.motion.shift_path import PathNoise, ShiftPath
from slipd.motion.surprises import f_surprise
from slipd.signals.pad import PadGeometry
from slipd.tools.sim.stickslip import (
    ContactPatch,
    FrictionLaw,
    GraspedObject,
    GraspTrace,
    LoadHistory,
    PadCompliance,
    simulate,
)
from slipd.tools.sim.true_contact import Pad

GEOMETRY = PadGeometry(8, 16, 0.004, 0.003)
PAD = Pad(8, 16, 0.004, 0.003)
RATE_HZ, T0 = 100, 100_000_000_000
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


def felt(wrench: np.ndarray, *, torque: bool) -> tuple[float, ...]:
    """Return what a force sensor measures, that may measure no torque."""
    return tuple((wrench if torque else np.append(wrench[:3], np.full(3, math.nan))).tolist())


def watch(
    trace: GraspTrace, noise: float = 0.005, seed: int = 1, *, torque: bool = True
) -> list[tuple[Evidence, float]]:
    """Return the evidence in noisy images, each with how far the object had moved, m."""
    rng = np.random.default_rng(seed)
    times_s = np.arange(0.0, trace.t_s[-1], 1.0 / RATE_HZ)
    images = trace.taxel_loads(PAD, times_s)
    shift, found = ImageShift(GEOMETRY, NOISE), []
    for t_s, image in zip(times_s, images, strict=True):
        k = int(np.searchsorted(trace.t_s, t_s, side="right")) - 1
        wrench = trace.wrench_left[k] + rng.normal(0.0, READINGS**-0.5, 6) * np.repeat(NOISE, 3)
        loads = image * trace.normal_n[k] / image.sum() + rng.normal(0.0, noise, image.size)
        evidence = shift.update(T0 + round(t_s * 1e9), loads, felt(wrench, torque=torque))
        if evidence is not None:
            found.append((evidence, math.hypot(*trace.displacement[k, :2])))
    return found


@pytest.mark.no_cover
@pytest.mark.parametrize("torque", [True, False])
@pytest.mark.parametrize(("kind", "speed_mps"), [("rectangle", 0.0003), ("ring", 0.001), ("rectangle", 0.003)])
def test_a_patch_that_creeps_over_the_pad_is_found_within_a_millimetre(
    kind: str, speed_mps: float, torque: bool
) -> None:
    trace = grasp(1.7 + 0.0013 / speed_mps, creeping(speed_mps), kind=kind, law=CREEPS)
    assert math.hypot(*trace.displacement[-1, :2]) > 7e-4
    at_m = [moved_m for evidence, moved_m in watch(trace, torque=torque) if evidence.surprise > CERTAIN]
    assert at_m
    assert 2e-4 < at_m[0] < 1e-3


def test_a_patch_that_stays_on_the_pad_shows_nothing() -> None:
    trace = grasp(3.0, creeping(0.001), kind="rectangle", moves=False, law=CREEPS)
    assert math.hypot(*trace.displacement[-1, :2]) > 7e-4
    assert watch(trace) == []


@pytest.mark.no_cover
@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("growth", [0.0, 0.33])
def test_a_changing_load_is_no_motion(growth: float, moves: bool) -> None:
    for kind in ("rectangle", "disc"):
        for trace in (
            grasp(3.0, still, kind=kind, moves=moves, growth=growth, tilt_nm=0.03),
            grasp(3.0, shaken, kind=kind, moves=moves, growth=growth, tilt_nm=0.03),
            grasp(3.0, still, kind=kind, moves=moves, growth=growth, grip=lambda t: 10.0 + 5.0 * min(t / 3.0, 1.0)),
        ):
            assert not trace.gross.any()
            assert watch(trace) == []
            assert watch(trace, torque=False) == []


@pytest.mark.no_cover
@pytest.mark.parametrize("drifts", ["white", "seconds", "walk"])
def test_noise_of_any_colour_is_no_motion(drifts: str) -> None:
    rng = np.random.default_rng(7)
    x, y = GEOMETRY.positions()
    loads = np.where((np.abs(x) < 0.011) & (np.abs(y) < 0.008), 0.3, 0.0)
    keeps = {"white": 0.0, "seconds": 0.99, "walk": 1.0}[drifts]
    shift, drift = ImageShift(GEOMETRY, NOISE), np.zeros(loads.size)
    surprises = []
    for k in range(120 * RATE_HZ):
        drift = keeps * drift + rng.normal(0.0, 0.0005, loads.size)
        image = loads + drift * (keeps > 0.0) + rng.normal(0.0, 0.005, loads.size)
        wrench = np.array((3.0, 0.0, -10.0, 0.0, 0.0, 0.0)) + rng.normal(0.0, READINGS**-0.5, 6) * np.repeat(NOISE, 3)
        evidence = shift.update(T0 + k * 10_000_000, image, tuple(wrench.tolist()))
        if evidence is not None:
            surprises.append(evidence.surprise)
    assert surprises == []


@pytest.mark.no_cover
@pytest.mark.parametrize("walks", [0.0, 0.1, 1.0])
def test_the_surprise_of_a_path_is_as_rare_as_it_says(walks: float) -> None:
    """1600 paths of noise, white or walking or both."""
    rng = np.random.default_rng(11)
    over, along = {4.0: 0, 6.0: 0}, np.array((0.6, 0.0, 0.8))
    for _ in range(1600):
        path = ShiftPath(PathNoise())
        walk, reference = np.zeros(3), rng.normal(0.0, 1e-5, 3)
        for _ in range(60):
            walk += rng.normal(0.0, walks * 1e-5, 3)
            place = walk + rng.normal(0.0, 1e-5, 3) - reference
            path.add(place)
        for limit in over:
            over[limit] += path.surprise(along, float(along @ place)) > limit
    for limit, count in over.items():
        expected = 1600 * math.exp(-limit)
        assert count <= expected + 4.0 * math.sqrt(expected)


def test_a_fit_finds_shift_and_turn_beside_gain_and_tilt() -> None:
    fine = PadGeometry(16, 32, 0.002, 0.002)

    def image(dx: float, dy: float, turn: float) -> np.ndarray:
        x, y = fine.positions()
        u, v = x - dx, y - dy
        u, v = u * math.cos(turn) + v * math.sin(turn), v * math.cos(turn) - u * math.sin(turn)
        return np.exp(-((u / 0.016) ** 4) - (v / 0.01) ** 4)

    before = image(0.0, 0.0, 0.0)
    x, y = fine.positions()
    after = image(4e-4, -3e-4, 0.03) * (1.1 + 5.0 * x - 8.0 * y)
    fit = ImageFitter(fine).fit(before, after, np.full(before.size, 1e-6))
    assert fit is not None
    assert fit.shift_m[:2] == pytest.approx([4e-4, -3e-4], abs=4e-5)
    assert fit.shift_m[2] / fit.radius_m == pytest.approx(0.03, abs=0.004)


def test_a_fit_of_a_dark_or_tiny_image_is_unknown() -> None:
    fitter = ImageFitter(PadGeometry(4, 4, 0.004, 0.002))
    assert fitter.fit(np.zeros(16), np.zeros(16), np.ones(16)) is None
    few = np.full(16, math.inf)
    few[:8] = 1.0
    assert fitter.fit(np.ones(16), np.ones(16), few) is None


def test_the_surprise_of_a_ratio_is_bounded() -> None:
    assert f_surprise(0.0, 3, 30) == 0.0
    assert f_surprise(1e12, 3, 1e4) == 700.0


@pytest.mark.parametrize("torque", [True, False])
def test_a_known_motion_is_reported_again_only_after_a_further_one(torque: bool) -> None:
    trace = grasp(4.0, creeping(0.0005), kind="rectangle", law=CREEPS)
    shift, rng = ImageShift(GEOMETRY, NOISE), np.random.default_rng(1)
    with pytest.raises(ValueError, match="before it is confirmed"):
        shift.confirm()
    times_s = np.arange(0.0, trace.t_s[-1], 1.0 / RATE_HZ)
    found_ns: list[int] = []
    for t_s, image in zip(times_s, trace.taxel_loads(PAD, times_s), strict=True):
        k = int(np.searchsorted(trace.t_s, t_s, side="right")) - 1
        loads = image * trace.normal_n[k] / image.sum() + rng.normal(0.0, 0.005, image.size)
        evidence = shift.update(T0 + round(t_s * 1e9), loads, felt(trace.wrench_left[k], torque=torque))
        if evidence is not None and evidence.surprise > CERTAIN:
            found_ns.append(evidence.t_ns)
            assert 300_000_000 <= shift.confirm() - evidence.t_ns <= 800_000_000
    assert len(found_ns) > 1
    assert np.diff(found_ns).min() >= 100_000_000


def test_a_path_of_which_no_noise_is_known_is_no_surprise() -> None:
    assert ShiftPath(PathNoise()).surprise(np.array((1.0, 0.0, 0.0)), 1e-3) == 0.0


def test_images_without_load_or_without_grip_show_nothing() -> None:
    for normal_n, image in ((10.0, np.zeros(128)), (0.0, np.ones(128))):
        shift = ImageShift(GEOMETRY, NOISE)
        wrench = (1.0, 0.0, -normal_n, 0.0, 0.0, 0.0)
        assert all(shift.update(T0 + k * 10_000_000, image, wrench) is None for k in range(100))


@pytest.mark.parametrize("torque", [True, False])
def test_a_confirmed_motion_is_followed_from_taxel_to_taxel_and_forgotten_after_a_rest(torque: bool) -> None:
    trace = grasp(6.0, creeping(0.0025), kind="rectangle", law=CREEPS)
    moved_m = math.hypot(*trace.displacement[-1, :2])
    assert moved_m > PAD.pitch_m
    shift, rng = ImageShift(GEOMETRY, NOISE), np.random.default_rng(1)
    assert shift.looks_per_hour >= 3600.0
    times_s = np.arange(0.0, trace.t_s[-1], 1.0 / RATE_HZ)
    images = trace.taxel_loads(PAD, times_s)
    at_m: list[float] = []
    for t_s, image in zip(times_s, images, strict=True):
        k = int(np.searchsorted(trace.t_s, t_s, side="right")) - 1
        loads = image * trace.normal_n[k] / image.sum() + rng.normal(0.0, 0.005, image.size)
        evidence = shift.update(T0 + round(t_s * 1e9), loads, felt(trace.wrench_left[k], torque=torque))
        if evidence is not None and evidence.surprise > CERTAIN:
            shift.confirm()
            at_m.append(math.hypot(*trace.displacement[k, :2]))
    assert at_m[-1] > PAD.pitch_m, "it is still followed"
    wrench, end_ns = felt(trace.wrench_left[-1], torque=torque), T0 + round(trace.t_s[-1] * 1e9)
    rested = [
        shift.update(end_ns + k * 10_000_000, images[-1] + rng.normal(0.0, 0.005, images[-1].size), wrench)
        for k in range(200)
    ]
    assert all(evidence is None for evidence in rested[100:])


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_a_contact_that_turns_about_its_centroid_is_found_where_it_follows_its_torque(turns: float) -> None:
    shift, rng = ImageShift(GEOMETRY, NOISE), np.random.default_rng(1)
    x, y = GEOMETRY.positions()
    found = []
    for k in range(200):
        angle = turns * 0.1 * max(k - 60, 0) / RATE_HZ
        u, v = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
        image = 0.3 * np.exp(-((u / 0.014) ** 4) - (v / 0.009) ** 4) + rng.normal(0.0, 0.002, x.size)
        wrench = np.array((0.5, 0.0, -10.0, 0.0, 0.0, 0.05)) + rng.normal(0.0, READINGS**-0.5, 6) * np.repeat(NOISE, 3)
        evidence = shift.update(T0 + k * 10_000_000, image, tuple(wrench.tolist()))
        found += [] if evidence is None else [evidence.surprise > CERTAIN]
    assert any(found) == (turns > 0.0)
