"""Force sensor and image are compared: a wrong mounting is reported, an edge or a tipping object is not."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from nanoseconds import MS
from pad_wrenches import pad_wrench

from slipd.finger import force_image_check
from slipd.finger.force_image_check import Agreement
from slipd.fusion import Contact, contact_from_wrench, tipping_margin
from slipd.signals.pad import neighbours
from slipd.tools.sim.scene_parts import Pad, Patch

PAD = Pad()
X, Y = PAD.positions()
HALF_X, HALF_Y = PAD.cols * PAD.pitch_m / 2, PAD.rows * PAD.pitch_m / 2
LEAST_N, FORCE_STD_N, TORQUE_STD_NM = 0.8, 0.02, 0.0002
LEVER = np.array((0.004, -0.002, -0.025))

Fault = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def watch(gain_error: float | None = 0.05) -> Agreement:
    return Agreement(PAD.rows, PAD.cols, PAD.pitch_m, LEAST_N, gain_error)


def tilted(patch: Patch, tilt: tuple[float, float], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Relative pressure of a patch that is tilted about its middle, until a part of it lifts off."""
    u, v = (x - patch.centre_m[0]) / patch.half_length_m, (y - patch.centre_m[1]) / patch.half_width_m
    return patch.pressure(x, y) * np.clip(1.0 + tilt[0] * u + tilt[1] * v, 0.0, None)


def scene(rng: np.random.Generator, normal_n: float, least_m: float = 0.0012) -> tuple[np.ndarray, np.ndarray]:
    """An image in newtons and the true centroid of a random contact; none where nothing is felt."""
    spot = np.linspace(-0.6, 0.6, 7) * PAD.electrode_m
    dx, dy = (grid.ravel() for grid in np.meshgrid(spot, spot))
    on = np.hypot(dx, dy) <= PAD.electrode_m / 2
    while True:
        size = np.exp(rng.uniform(np.log((least_m, least_m)), np.log((0.030, 0.015))))
        centre = rng.uniform((-HALF_X, -HALF_Y), (HALF_X, HALF_Y)) * 0.9
        patch = Patch(*size, float(rng.choice((2.0, 4.0, 8.0))), (float(centre[0]), float(centre[1])))
        tilt = tuple(rng.uniform(-1.5, 1.5, 2) * rng.integers(0, 2))
        x, y = np.meshgrid(*(c + s * np.linspace(-1.0, 1.0, 60) for c, s in zip(centre, size, strict=True)))
        weight = tilted(patch, tilt, x, y) * (np.abs(x) <= HALF_X) * (np.abs(y) <= HALF_Y)
        cell_m2 = np.prod(size / 29.5)
        felt = tilted(patch, tilt, X[:, None] + dx[on], Y[:, None] + dy[on]).mean(axis=1) * PAD.pitch_m**2
        image = normal_n * felt / (weight.sum() * cell_m2) * (1.0 + 0.05 * rng.normal(size=X.size))
        image[image < 0.005] = 0.0
        if image.any():
            return image, np.array(((weight * x).sum(), (weight * y).sum())) / weight.sum()


def contact(
    rng: np.random.Generator, centroid: np.ndarray, normal_n: float, turn: float, fault: Fault | None = None
) -> Contact:
    """What the force sensor makes of a contact that carries a tangential load, with its noise."""
    pull = 0.4 * normal_n
    load = (pull * math.cos(turn), pull * math.sin(turn), 0.01)
    force, torque = pad_wrench(load, normal_n, (float(centroid[0]), float(centroid[1])))
    force, torque = force + FORCE_STD_N * rng.normal(size=3), torque + TORQUE_STD_NM * rng.normal(size=3)
    if fault is not None:
        force, torque = fault(force, torque)
    noise = {"force_std_n": FORCE_STD_N, "torque_std_nm": TORQUE_STD_NM}
    return contact_from_wrench(force, torque, min_normal_n=LEAST_N, **noise)


def judge(
    rng: np.random.Generator, image: np.ndarray, centroid: np.ndarray, normal_n: float, **options: Fault
) -> set[str]:
    """What is told in 150 ms of images at 100 Hz."""
    agreement = watch()
    turn = rng.uniform(0.0, 2.0 * math.pi)
    told: set[str] = set()
    for k in range(15):
        seen = contact(rng, centroid, normal_n, turn, **options)
        told.update(agreement.update(10 * MS * k, seen, FORCE_STD_N, X, Y, image))
    return told


@pytest.mark.parametrize("normal_n", [1.0, 5.0, 20.0])
def test_F3_healthy_contacts_agree_wherever_they_are_on_the_pad(normal_n: float) -> None:
    rng = np.random.default_rng(round(normal_n))
    for _ in range(60):
        image, centroid = scene(rng, normal_n)
        assert judge(rng, image, centroid, normal_n) == set()


FAULTS: dict[str, tuple[Fault, float]] = {
    "swapped axes": (lambda f, m: (f[[1, 0, 2]], -m[[1, 0, 2]]), 0.8),
    "flipped x": (lambda f, m: (f * (-1, 1, 1), m * (1, -1, -1)), 0.85),
    "flipped y": (lambda f, m: (f * (1, -1, 1), m * (-1, 1, -1)), 0.8),
    "turned by a quarter": (lambda f, m: (f[[1, 0, 2]] * (-1, 1, 1), m[[1, 0, 2]] * (-1, 1, 1)), 0.9),
    "turned by half": (lambda f, m: (f * (-1, -1, 1), m * (-1, -1, 1)), 0.9),
    "10 mm off along x": (lambda f, m: (f, m - np.cross((0.01, 0.0, 0.0), f)), 0.95),
    "10 mm off along z": (lambda f, m: (f, m - np.cross((0.0, 0.0, 0.01), f)), 0.65),
    "a bias of 1 N along x": (lambda f, m: (f + np.array((1.0, 0.0, 0.0)), m + np.cross(LEVER, (1.0, 0.0, 0.0))), 0.65),
    "a bias of 1 N along z": (lambda f, m: (f + np.array((0.0, 0.0, 1.0)), m + np.cross(LEVER, (0.0, 0.0, 1.0))), 0.5),
}


@pytest.mark.parametrize("name", FAULTS)
def test_F3_a_wrong_force_sensor_is_reported_on_most_contacts(name: str) -> None:
    """What cannot be told is a contact at the pad's centre: it looks the same in every mounting."""
    fault, least = FAULTS[name]
    rng = np.random.default_rng(7)
    scenes = [scene(rng, 5.0, 0.005) for _ in range(60)]
    assert sum(bool(judge(rng, *found, 5.0, fault=fault)) for found in scenes) >= 60 * least


def test_F3_a_dead_half_of_the_image_is_reported_where_the_contact_lies_on_it() -> None:
    rng = np.random.default_rng(3)
    told = felt = 0
    for _ in range(60):
        image, centroid = scene(rng, 5.0, 0.005)
        if image[X > 0.0].sum() > 0.3 * image.sum():
            felt += 1
            told += bool(judge(rng, np.where(X > 0.0, 0.0, image), centroid, 5.0))
    assert told >= 0.85 * felt > 20


@pytest.mark.uncovered
def test_F3_an_object_that_tips_over_its_edge_stays_a_matter_of_tipping() -> None:
    """One row is left of the contact, and the force acts up to one pitch beyond it."""
    image = np.where(np.isclose(Y, Y.min()) & (np.abs(X) < 0.012), 0.5, 0.0)
    active = image > 0.0
    rng = np.random.default_rng(1)
    for beyond in (0.6, 1.0, 1.4):
        centroid = np.array((0.0, Y.min() - beyond * PAD.pitch_m))
        assert tipping_margin(X[active], Y[active], centroid) < -0.5 * PAD.pitch_m
        assert judge(rng, image, centroid, 4.0) == set()
    assert judge(rng, image, np.array((0.0, Y.min() - 2.5 * PAD.pitch_m)), 4.0) == {"disagreement_centroid"}


def block(normal_n: float) -> np.ndarray:
    return normal_n * PAD.shares(Patch(centre_m=(0.0, 0.0)))


def quiet(normal_n: float, at: tuple[float, float] = (0.0, 0.0)) -> Contact:
    force, torque = pad_wrench((0.0, 0.0, 0.0), normal_n, at)
    return contact_from_wrench(force, torque, min_normal_n=LEAST_N)


def said(
    steps: int, seen: Contact, image: np.ndarray, agreement: Agreement | None = None, **at: int
) -> list[tuple[str, ...]]:
    """Return what is told in images every 10 ms, or ``period`` ms, from ``begin`` ms on."""
    agreement, period, begin = agreement or watch(), at.get("period", 10), at.get("begin", 0)
    return [agreement.update(MS * (begin + period * k), seen, 0.02, X, Y, image) for k in range(steps)]


def test_F3_a_pad_sum_that_differs_from_the_force_is_reported_where_the_pad_is_calibrated() -> None:
    for gain_error, told in ((0.05, ("disagreement_force",)), (0.5, ()), (None, ())):
        assert said(15, quiet(5.0), block(7.5), watch(gain_error))[-1] == told
    corner = np.where(np.hypot(X - X.max(), Y - Y.max()) < 1.5 * PAD.pitch_m, 9.0, 0.0)
    at = float((X * corner).sum() / corner.sum()), float((Y * corner).sum() / corner.sum())
    assert said(15, quiet(5.0, at), corner)[-1] == (), "no taxel has four active sides: the sum shows nothing"


def test_F3_a_clear_force_without_an_image_is_reported() -> None:
    for normal_n, told in ((2.0, ("disagreement_contact",)), (1.5, ())):
        assert said(15, quiet(normal_n), np.zeros(X.size))[-1] == told


def test_F3_a_lasting_disagreement_is_reported_until_both_have_agreed_for_long_or_the_contact_ends() -> None:
    agreement, image, wrong, right = watch(), block(5.0), quiet(5.0, (0.01, 0.0)), quiet(5.0)
    assert said(1, right, image, agreement) == [()]
    assert said(9, wrong, image, agreement, begin=10).index(("disagreement_centroid",)) == 7, (
        "60 ms; the first was a movement"
    )
    assert said(29, right, image, agreement, begin=100).index(()) == 19
    assert said(4, wrong, image, period=33) == [(), (), (), ("disagreement_centroid",)]
    faint = watch()
    assert said(9, wrong, image, faint)[-1] == ("disagreement_centroid",)
    assert said(1, quiet(1.2, (0.01, 0.0)), block(1.2), faint, begin=90) == [("disagreement_centroid",)]
    ended = watch()
    assert said(10, wrong, image, ended)[-1] == ("disagreement_centroid",)
    assert [*said(1, quiet(0.1), np.zeros(X.size), ended, begin=100), *said(1, wrong, image, ended, begin=110)] == [
        (),
        (),
    ]


def test_F3_a_contact_that_slides_fast_or_a_force_that_rises_fast_is_skew_and_no_disagreement() -> None:
    """The image lags by one reading while the force moves on by 2 mm, or rises by half, each time."""
    slides, rises = watch(), watch()
    for k in range(12):
        image = 5.0 * PAD.shares(Patch(0.010, 0.010, 2.0, (-0.014 + 0.002 * k, 0.0)))
        assert slides.update(33 * MS * k, quiet(5.0, (-0.012 + 0.002 * k, 0.0)), 0.02, X, Y, image) == ()
        if k < 8:
            assert rises.update(33 * MS * k, quiet(1.5 ** (k + 2)), 0.02, X, Y, block(1.5 ** (k + 1))) == ()


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_N1_an_image_that_is_no_number_is_not_compared(bad: float) -> None:
    agreement, image = watch(), block(5.0)
    broken = np.where(np.arange(X.size) == 3, bad, image)
    for k in range(20):
        assert agreement.update(10 * MS * k, quiet(5.0), 0.02, X, Y, broken if k % 2 else image) == ()
    nothing = contact_from_wrench(np.full(3, bad), np.zeros(3))
    assert said(1, nothing, image, agreement, begin=200) + said(1, quiet(5.0), image, agreement, begin=210) == [(), ()]


def test_a_taxel_is_inner_where_its_four_sides_are_active() -> None:
    compiled = force_image_check._moments
    sides = np.ascontiguousarray(neighbours(3, 4)[:, (1, 3, 4, 6)])
    image = np.array(((0.0, 1.0, 1.0, 1.0), (1.0, 2.0, 3.0, 0.0), (0.0, 1.0, 1.0, 0.0)))
    for moments in (compiled, getattr(compiled, "py_func", compiled)):
        assert moments(np.arange(12.0), np.ones(12), image.ravel(), sides) == (11.0, 57.0, 11.0, 1)
