"""The C program of the benchmark gives the same limits as the compiled kernels, to the same digits."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bench.alternatives import FLAGS, SOURCE, InC, compiled_c
from chart.scenes import FAMILIES, PITCH_M, Scene, draw

from slipd.fusion import torque_limits, utilisations
from slipd.fusion.limit.solve import KINDS
from slipd.types.arrays import Array

if shutil.which("cc") is None:
    pytest.skip("no C compiler named cc is here", allow_module_level=True)

SCENES = 20 * len(FAMILIES)
SAME, CLOSED = 1e-12, 1e-9
"""Differences of two roundings, and gaps of the C program's own bounds: of the contact's torque, or of 1 in a use."""

STEP_FOR_STEP, SHARE = 1e-14, 0.95
"""Bounds so near to each other were reached by the same steps; where sums cancel, rounding alone parts a few."""


@pytest.fixture(scope="module")
def in_c(tmp_path_factory: pytest.TempPathFactory) -> dict[str, InC]:
    return compiled_c(tmp_path_factory.mktemp("limit"))


def frame(scene: Scene) -> tuple[Array, Array, Array, float, Array, Array]:
    """Arguments of the batch form for one frame, in the memory layout that C reads."""
    x, y, loads, force, about = (
        np.ascontiguousarray(a) for a in (scene.x, scene.y, scene.loads, scene.tangential, scene.about)
    )
    return x, y, loads[None], scene.mu, force[None], about[None]


def agree(out: Array, kind: str, found: Array, scale: float) -> bool:
    """Same kind; the same value to rounding, bounds that overlap and meet; or no number on both sides."""
    value, lower, upper = found
    if KINDS[int(out[-1])] != kind:
        return False
    if not math.isfinite(value):
        return np.array_equal(out[:3], found, equal_nan=True)
    overlap = out[1] <= upper and lower <= out[2] and out[1] <= out[0] <= out[2]
    return bool(overlap and abs(out[0] - value) <= SAME * scale and out[2] - out[1] <= CLOSED * scale)


def apart(out: Array, found: Array, scale: float) -> float:
    """How far the bounds are from each other; 0 where there are none."""
    return float(np.abs(out[1:3] - found[1:]).max()) / scale if np.isfinite(found).all() else 0.0


def test_it_compiles_without_a_warning(tmp_path: Path) -> None:
    warnings = ("-Wall", "-Wextra", "-pedantic", "-Werror")
    run = ["cc", *FLAGS, *warnings, "-shared", "-fPIC", "-o", str(tmp_path / "limit.so"), str(SOURCE), "-lm"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", ["C", "C, native"])
def test_it_finds_the_same_limit_in_every_family_by_the_same_steps(in_c: dict[str, InC], name: str) -> None:
    wrong, distances = [], []
    for seed in range(SCENES):
        scene, sense = draw(seed), 1 if seed % 2 else -1
        ours, (out,) = torque_limits(*frame(scene), sense), in_c[name].limits(*frame(scene), sense)
        found = np.array((ours.torque_nm[0], ours.lower_nm[0], ours.upper_nm[0]))
        scale = scene.torque_scale_nm or scene.mu * scene.loads.sum() * PITCH_M
        distances.append(apart(out, found, scale))
        if not agree(out, str(ours.kind[0]), found, scale):
            wrong.append((seed, scene.family, out, ours))
    assert not wrong
    assert np.quantile(distances, SHARE) <= STEP_FOR_STEP


@pytest.mark.parametrize("name", ["C", "C, native"])
def test_it_finds_the_same_utilisation_in_every_family_by_the_same_steps(in_c: dict[str, InC], name: str) -> None:
    wrong, distances, rng = [], [], np.random.default_rng(0)
    for seed in range(SCENES):
        scene = draw(seed)
        x, y, loads, mu, force, about = frame(scene)
        spin = rng.uniform(-1.5, 1.5, 1) * scene.torque_scale_nm
        ours = utilisations(x, y, loads, mu, force, spin, about)
        (out,) = in_c[name].uses(x, y, loads, mu, force, spin, about)
        found = np.array((ours.value[0], ours.lower[0], ours.upper[0]))
        scale = max(1.0, float(ours.value[0]))
        distances.append(apart(out, found, scale))
        if not agree(out, str(ours.kind[0]), found, scale):
            wrong.append((seed, scene.family, out, ours))
    assert not wrong
    assert np.quantile(distances, SHARE) <= STEP_FOR_STEP


def test_a_pole_on_a_taxel_is_a_hinge_from_the_first_pass_on(in_c: dict[str, InC]) -> None:
    row, col = np.divmod(np.arange(9.0), 3.0)
    (out,) = in_c["C"].limits(col, row, np.ones((1, 9)), 0.5, np.zeros((1, 2)), np.ones((1, 2)), 1)
    assert out[0] == pytest.approx(0.5 * 4.0 * (1.0 + math.sqrt(2.0)), rel=1e-12)
    assert KINDS[int(out[5])] == "hinge"
    assert out[3:5].tolist() == [1.0, 1.0]


def test_frames_do_not_mix_and_zeros_are_no_contact(in_c: dict[str, InC]) -> None:
    rng = np.random.default_rng(1)
    x, y = rng.normal(0.0, 0.01, (2, 12))
    loads = rng.uniform(0.1, 1.0, (40, 12)) * (rng.random((40, 12)) < 0.6)
    loads[7], loads[8, 3] = 0.0, -1.0  # no contact; no answer
    loads[:, 5], x[5] = 0.0, math.nan
    force, about = 0.2 * rng.normal(0.0, 1.0, (40, 2)), rng.normal(0.0, 0.01, (40, 2))
    spin = rng.normal(0.0, 0.005, 40)
    limits, uses = torque_limits(x, y, loads, 0.5, force, about), utilisations(x, y, loads, 0.5, force, spin, about)
    limits_c = in_c["C"].limits(x, y, loads, 0.5, force, about, 1)
    uses_c = in_c["C"].uses(x, y, loads, 0.5, force, spin, about)
    assert limits.kind[7] == limits.kind[8] == "none"
    assert [KINDS[int(k)] for k in limits_c[:, -1]] == list(limits.kind)
    assert [KINDS[int(k)] for k in uses_c[:, -1]] == list(uses.kind)
    np.testing.assert_allclose(limits_c[:, :3].T, (limits.torque_nm, limits.lower_nm, limits.upper_nm), rtol=1e-12)
    np.testing.assert_allclose(limits_c[:, 3:5], limits.pole_m, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(uses_c[:, 0], uses.value, rtol=1e-12)
    np.testing.assert_allclose(uses_c[:, 3:5], uses.pole_m, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(uses_c[:, 5:8], uses.twist, rtol=1e-5, atol=1e-7)
