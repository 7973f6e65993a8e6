"""Mass and centre of mass follow from poses; a wrong mounting or unit is named, or said to be undecidable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slipd.signals.gravity import FingerWeight
from slipd.signals.mounting import mounting_matrix
from slipd.tools.commission.touches import Mount
from slipd.tools.commission.weighing_search import (
    Pose,
    WeightFindings,
    find_weight,
    force_misfit,
    torque_misfit,
)

TILTED = (0.9659258, 0.2588190, 0.0, 0.0)
TRUE = Mount(-1, (0.004, -0.002, -0.025), TILTED)
WEIGHT = FingerWeight(0.08, (0.001, 0.002, -0.012))
DOWN = ((9.8, 0.0, 0.0), (0.0, 0.0, -9.8), (0.0, 0.0, 9.8), (0.0, 9.8, 0.0))
BIAS = np.array((0.6, -0.4, 0.9, 0.004, -0.003, 0.002))


def poses(
    *,
    true: Mount = TRUE,
    down: Sequence[Sequence[float]] = DOWN,
    held_deg: float = 0.0,
    gains: tuple[float, float] = (1.0, 1.0),
    weight: FingerWeight = WEIGHT,
) -> list[Pose]:
    """What a sensor reads in the poses, which a hand holds within some degrees."""
    rng = np.random.default_rng(1)
    matrix = np.linalg.inv(mounting_matrix(true.xyz_m, true.quat_xyzw, true.sign))
    found: list[Pose] = []
    for gravity in map(np.array, down):
        held = Rotation.from_rotvec(np.radians(rng.normal(scale=held_deg, size=3))).apply(gravity)
        raw = (matrix @ weight.wrench(held) + BIAS) * np.repeat(gains, 3)
        found.append(Pose(raw[:3], raw[3:], gravity))
    return found


def texts(findings: WeightFindings) -> str:
    return "\n".join([*findings.notes, *findings.problems])


@pytest.mark.parametrize(("held_deg", "w"), [(0.0, 0.0), (4.0, 1e-4), (4.0, -1e-4)])
def test_mass_and_centre_of_mass_are_found(held_deg: float, w: float) -> None:
    """With a rotation of half a turn, as measured: its inverse is about the same."""
    findings = find_weight(poses(held_deg=held_deg), replace(TRUE, quat_xyzw=(*TILTED[:3], w)))
    assert findings.found is not None, texts(findings)
    assert findings.found.mass_kg == pytest.approx(0.08, rel=0.001 + 0.02 * held_deg)
    assert findings.found.com_m == pytest.approx(WEIGHT.com_m, abs=1e-6 + 0.001 * held_deg)
    assert "sign -1 and rotation of the config fit the weight" in texts(findings)


@pytest.mark.parametrize(
    ("present", "words"),
    [
        (Mount(1, TRUE.xyz_m, TILTED), "the weight fits sign -1"),
        (Mount(-1, TRUE.xyz_m, (0.0, *TILTED[:3])), "that of the config read as w, x, y, z"),
        (Mount(-1, TRUE.xyz_m, (0.0, 0.0, 0.0, 1.0)), "not those of the config"),
    ],
)
def test_a_wrong_mounting_is_named_and_no_mass_is_written(present: Mount, words: str) -> None:
    findings = find_weight(poses(held_deg=3.0), present)
    assert findings.found is None
    assert words in findings.problems[0]
    assert "Touches decide" in findings.problems[0]


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ((1.0, 1000.0), "the torques are in N·mm, not N·m"),
        ((1.0, 30.0), "the torques are wrong, or xyz_m is wrong. Weighing cannot tell"),
        ((1000.0, 1000.0), "the forces are in mN, not N"),
        ((0.001, 0.001), "it is too light to be weighed, and needs no mass_kg; or the forces are in kN"),
    ],
)
def test_a_wrong_unit_is_named(gains: tuple[float, float], words: str) -> None:
    findings = find_weight(poses(gains=gains), TRUE)
    assert findings.found is None
    assert words in texts(findings)


@pytest.mark.parametrize("number", range(4))
def test_a_pose_in_which_the_finger_was_touched_is_named(number: int) -> None:
    for force, torque, words in (
        ((0.0, 0.6, 0.0), (0.0, 0.0, 0.0), ""),
        ((0.0, 0.0, 0.0), (0.08, 0.0, 0.0), "torques"),
    ):
        made = poses(held_deg=2.0)
        made[number] = replace(made[number], force=made[number].force + force, torque=made[number].torque + torque)
        findings = find_weight(made, TRUE)
        assert findings.found is None
        assert findings.worst == number, texts(findings)
        assert words in findings.problems[0]


def test_a_pose_in_which_the_finger_was_touched_is_named_of_three_in_a_plane() -> None:
    made = poses(down=DOWN[:3])
    made[0] = replace(made[0], force=made[0].force + np.array((0.0, 0.5, 0.0)))
    findings = find_weight(made, TRUE)
    assert findings.found is None
    assert "of the weight from any weight in these poses" in findings.problems[0]
    assert findings.worst == 0


def test_no_weight_follows_from_one_direction_of_gravity() -> None:
    made = poses(down=DOWN[:1] * 3)
    wrenches = np.array([np.concatenate((pose.force, pose.torque)) for pose in made])
    gravities = np.array([pose.gravity for pose in made])
    assert force_misfit(wrenches, gravities) == torque_misfit(wrenches, gravities, 0.03) == math.inf
