"""Motion of the contact centroid: found under a load that rests, and nowhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chirps import chirp
from nanoseconds import MS

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.motion.evidence import BLOCK_S, Evidence
from slipd.motion.image_blocks import Block
from slipd.motion.image_fit import ImageComparison
from slipd.motion.image_shift import CentroidShift
from slipd.motion.shift_path import LONGEST_NS, KnownMotion, Motion, PathNoise, ShiftPath
from slipd.signals.pad import PadGeometry

GEOMETRY = PadGeometry(8, 16, 0.004, 0.003)
X, Y = GEOMETRY.positions()
STEP_NS = round(1e9 * BLOCK_S)
STD_M = 1.5e-5
CERTAIN = 12.0
DIRECTION = np.array((0.8, 0.6))


class Hold:
    """Blocks of a contact that moves along `DIRECTION` under a load.

    Args:
        images: In a block.
        torque_nm: Noise of the force sensor.
        turn: Angle from that direction to the load.

    Attributes:
        t_ns: When the newest block was completed.
        at_m: How far the contact has moved along the load.
    """

    def __init__(self, images: int = 10, torque_nm: float = 0.0002, turn: float = 0.0) -> None:
        c, s = math.cos(turn), math.sin(turn)
        self.pull = DIRECTION @ ((c, s), (-s, c))
        self.shift = CentroidShift(ImageComparison(GEOMETRY), WrenchUncertainty(0.02, torque_nm))
        self.rng, self.images = np.random.default_rng(3), images
        self.t_ns, self.at_m, self.drift_m = 0, 0.0, 0.0

    def block(self, speed_mps: float = 0.0, load_n: float = 5.0, drift_mps: float = 0.0, gap_ns: int = 0) -> Block:
        self.t_ns += STEP_NS + gap_ns
        self.at_m += speed_mps * BLOCK_S
        self.drift_m += drift_mps * BLOCK_S
        dx, dy = self.at_m * DIRECTION
        image = np.exp(-(((X - dx) / 0.014) ** 4) - ((Y - dy) / 0.009) ** 4) + self.rng.normal(0.0, 1e-3, X.size)
        centroids = (self.at_m + self.drift_m) * DIRECTION + self.rng.normal(0.0, STD_M, (self.images, 2))
        wrenches = np.zeros((self.images, 6))
        wrenches[:, 2], wrenches[:, 3], wrenches[:, 4] = -12.0, -12.0 * centroids[:, 1], 12.0 * centroids[:, 0]
        load = np.array((*(load_n * self.pull), 12.0, 0.0, *centroids.mean(axis=0)))
        tolerance = np.array((0.8, 0.8, 0.8, 0.01, 1e-3, 1e-3))
        return Block(self.t_ns, image, np.full(X.size, 5e-7), load, tolerance, 0.15, wrenches)

    def watch(self, blocks: int = 1, speed_mps: float = 0.0, **motion: float) -> list[Evidence]:
        """Return the certain evidence in further blocks."""
        found = [self.shift.update(self.block(speed_mps, **motion)) for _ in range(blocks)]
        return [evidence for evidence in found if evidence is not None and evidence.surprise > CERTAIN]


@pytest.mark.parametrize("images", [2, 10])
@pytest.mark.parametrize("speed_mps", [0.0003, 0.001, 0.003])
def test_a_creeping_contact_is_found_well_within_a_millimetre(speed_mps: float, images: int) -> None:
    hold = Hold(images)
    assert hold.watch(10) == []
    while not hold.watch(1, speed_mps):
        assert hold.at_m < 6e-4
    assert hold.at_m > 2e-4


@pytest.mark.parametrize("motion", [{}, {"drift_mps": 0.001}, {"speed_mps": -0.0005}])
def test_rest_drift_and_a_motion_against_the_load_are_no_motion(motion: dict[str, float]) -> None:
    assert Hold().watch(60, **motion) == []


@pytest.mark.parametrize(("turn", "found"), [(0.95, True), (-0.95, True), (1.15, False), (-1.15, False)])
def test_a_contact_moves_within_sixty_degrees_of_its_load(turn: float, found: bool) -> None:
    hold = Hold(turn=turn)
    assert bool(hold.watch(10) + hold.watch(12, 0.001)) is found


def test_what_moves_while_the_load_grows_is_another_or_is_unseen_is_no_motion() -> None:
    grows, hold = Hold(), Hold()
    assert [grows.watch(1, 0.001, load_n=3.0 + 0.1 * k) for k in range(30)] == 30 * [[]], "partial slip"
    assert hold.watch(10) + hold.watch(1, 0.005, load_n=6.0) + hold.watch(1) == []
    hold.at_m += 3e-4
    assert hold.watch(1, gap_ns=2 * STEP_NS) + hold.watch(19) == []


def test_a_known_motion_is_reported_again_after_a_further_one_until_it_rests() -> None:
    hold, at_m = Hold(), []
    assert hold.watch(10) == []
    for _ in range(60):
        if hold.watch(1, 0.001):
            at_m.append(hold.at_m)
            assert 300 * MS <= hold.shift.motion.confirm() - hold.t_ns <= 800 * MS
    assert at_m[-1] > 2.5e-3, "it is still followed beyond the first millimetre"
    assert np.diff(at_m).min() > 0.9e-4
    assert hold.watch(1, load_n=6.0) + hold.watch(1) == []
    assert hold.watch(1, drift_mps=0.003), "too little for the image"
    assert hold.watch(2, drift_mps=0.006) == [], "no image shows it"
    assert hold.watch(60) == []
    hold.shift.reset()
    assert hold.watch(2, 0.01) == []


def test_a_shift_within_the_noise_is_no_motion_even_where_the_image_shows_it() -> None:
    hold = Hold(images=2, torque_nm=0.01)
    assert [hold.shift.update(hold.block(0.001)) for _ in range(12)] == 12 * [None]
    assert hold.at_m > 5e-4


@pytest.mark.parametrize(("walks", "surprise"), [(0.0, 11.546), (0.1, 11.911), (1.0, 5.668)])
def test_the_surprise_of_a_path_keeps_its_digits(walks: float, surprise: float) -> None:
    path = ShiftPath(Hold().block(), PathNoise())
    for place_m in 1e-5 * (chirp(60, 3) + walks * chirp(60, 3, turn=0.7).cumsum(0)):
        path.add(place_m)
    assert path.surprise(np.array((0.6, 0.0, 0.8)), 2e-4) == pytest.approx(surprise, abs=1e-3)


def test_a_motion_counts_for_twice_the_time_it_took() -> None:
    motion, found = KnownMotion(), Motion(1_000 * MS, np.zeros(1), 9.0, ShiftPath(Hold().block(), PathNoise()))
    with pytest.raises(ValueError, match="before it is confirmed"):
        motion.confirm()
    motion.found = found
    assert motion.confirm() == 1_400 * MS
    for later_ns, lasts_ns in ((50 * MS, 300 * MS), (200 * MS, 400 * MS), (900 * MS, LONGEST_NS)):
        motion.known, motion.found = found, found._replace(t_ns=found.t_ns + later_ns)
        assert motion.confirm() == found.t_ns + later_ns + lasts_ns
    assert not motion.rests(found.t_ns + 900 * MS + LONGEST_NS)
    assert motion.rests(found.t_ns + 900 * MS + LONGEST_NS + 1)
    assert motion.known is None
