"""A batch of frames gives the same results as single frames, and an invalid frame changes no other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.fusion import torque_limit, torque_limits, utilisation, utilisations

MU, FRAMES = 0.5, 40


@pytest.fixture
def frames() -> tuple[np.ndarray, ...]:
    """Images of a 4 × 5 pad with half of the taxels in contact."""
    rng = np.random.default_rng(1)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(5) * 3e-3, np.arange(4) * 3e-3))
    loads = rng.random((FRAMES, 20)) * (rng.random((FRAMES, 20)) < 0.5)
    loads[:, 0] += 0.1
    tangential = 0.2 * MU * loads.sum(axis=1)[:, None] * rng.normal(size=(FRAMES, 2))
    return x, y, loads, tangential, 0.002 * rng.normal(size=FRAMES), rng.normal(0.006, 0.001, (FRAMES, 2))


@pytest.mark.parametrize("sense", [1, -1])
def test_each_frame_has_the_limit_that_its_active_taxels_have_alone(frames, sense: int) -> None:
    x, y, loads, f, _, about = frames
    found = torque_limits(x, y, loads, MU, f, about, sense)
    for i, on in enumerate(loads > 0.0):
        alone = torque_limit(x[on], y[on], loads[i, on], MU, f[i], about[i], sense)
        assert found.kind[i] == alone.kind
        pole_m = (math.nan, math.nan) if alone.pole_m is None else alone.pole_m
        numbers = (found.torque_nm[i], found.lower_nm[i], found.upper_nm[i], *found.pole_m[i])
        np.testing.assert_equal(numbers, (alone.torque_nm, alone.lower_nm, alone.upper_nm, *pole_m))


def test_each_frame_has_the_utilisation_that_it_has_alone(frames) -> None:
    x, y, loads, f, spin, about = frames
    found = utilisations(x, y, loads, MU, f, spin, about)
    for i in range(FRAMES):
        alone = utilisation(x, y, loads[i], MU, f[i], spin[i], about[i])
        assert found.value[i] == pytest.approx(alone.value, rel=1e-11)
        assert max(found.lower[i], alone.lower) <= min(found.upper[i], alone.upper)
        assert found.twist[i] / np.linalg.norm(found.twist[i]) == pytest.approx(
            np.array(alone.twist) / np.linalg.norm(alone.twist), abs=1e-6
        )


def test_pads_that_move_have_positions_of_their_own(frames) -> None:
    x, y, loads, f, spin, _ = frames
    shift = np.linspace(0.0, 1.0, FRAMES)[:, None]
    still = utilisations(x, y, loads, MU, f, spin, (0.006, 0.004))
    moved = utilisations(x + shift, y - shift, loads, MU, f, spin, (0.006, 0.004) + shift * (1.0, -1.0))
    assert moved.value == pytest.approx(still.value, rel=1e-9)
    held = torque_limits(x, y, loads, MU, f, (0.006, 0.004))
    turned = torque_limits(x + shift, y - shift, loads, MU, f, (0.006, 0.004) + shift * (1.0, -1.0))
    assert turned.torque_nm == pytest.approx(held.torque_nm, rel=1e-6)


def test_a_bad_frame_is_marked_and_changes_no_other(frames) -> None:
    x, y, loads, f, spin, about = frames
    whole = utilisations(x, y, loads, MU, f, spin, about)
    loads[3, 0], loads[5], f[7, 0], loads[9, 0] = math.nan, 0.0, math.inf, -1.0
    found = utilisations(x, y, loads, MU, f, spin, about)
    limits = torque_limits(x, y, loads, MU, f, about)
    assert [*limits.kind[[3, 5, 7, 9]]] == ["none"] * 4
    assert np.isnan((*limits.torque_nm[[3, 5, 7, 9]], *found.value[[3, 7, 9]])).all()
    assert found.value[5] == math.inf
    good = np.setdiff1d(np.arange(FRAMES), (3, 5, 7, 9))
    assert found.value[good] == pytest.approx(whole.value[good], rel=1e-11)


def test_no_frames_are_no_answers() -> None:
    found = torque_limits([0.0, 1.0], [0.0, 0.0], np.empty((0, 2)), MU, np.empty((0, 2)), (0.0, 0.0))
    assert found.torque_nm.shape == found.kind.shape == (0,)
    assert utilisations([0.0], [0.0], np.empty((0, 1)), MU, np.empty((0, 2)), [], (0, 0)).twist.shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"loads": np.ones(20)}, r"loads must have shape \(frames, n\)"),
        ({"x": np.ones(19)}, r"x must have shape \(20,\) or \(40, 20\), got \(1, 19\)"),
        ({"y": np.ones((40, 20))}, "x and y must share one shape"),
        ({"tangential": np.ones((39, 2))}, r"tangential must have shape \(40, 2\), got \(39, 2\)"),
        ({"about": np.ones(3)}, r"about must have shape \(2,\) or \(40, 2\)"),
        ({"spin": np.ones(3)}, r"spin must have shape \(40,\), got \(3,\)"),
        ({"mu": 0.0}, "mu must be positive and finite"),
    ],
)
def test_invalid_arguments_raise_with_the_rule_in_the_message(frames, change: dict, said: str) -> None:
    names = ("x", "y", "loads", "tangential", "spin", "about")
    arguments = {**dict(zip(names, frames, strict=True)), "mu": MU, **change}
    with pytest.raises(ValueError, match=said):
        utilisations(**arguments)
