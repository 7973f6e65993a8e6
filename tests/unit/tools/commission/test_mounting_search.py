"""Every wrong mounting is found from the touches, or reported as not found; nothing is guessed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slipd.signals.mounting import mounting_matrix
from slipd.tools.commission.mounting_search import find_mounting
from slipd.tools.commission.touches import (
    CENTRE,
    CORNER,
    END,
    NAMES,
    PUSH_X,
    PUSH_Y,
    STEPS,
    SYMMETRIES,
    Mount,
    Symmetry,
    Touch,
    find_three_axis,
)
from slipd.tools.commission.weighing_search import Pose, find_weight

PLACES = {CENTRE: (0.0, 0.0), END: (0.02, 0.0), CORNER: (0.02, 0.009), PUSH_X: (0.0, 0.0), PUSH_Y: (0.0, 0.0)}
PUSHES = {PUSH_X: (2.0, 0.0), PUSH_Y: (0.0, 2.0)}
TILTED = (0.9659258, 0.2588190, 0.0, 0.0)
LEVEL = Mount(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
TRUE = Mount(-1, (0.004, -0.002, -0.025), TILTED)
SEEDS = st.none() | st.integers(0, 19)


def touches(
    true: Mount = TRUE,
    symmetry: Symmetry | None = SYMMETRIES[0],
    *,
    places: dict[str, tuple[float, float]] = PLACES,
    pushes: dict[str, tuple[float, float]] = PUSHES,
    seed: int | None = None,
    torque_gain: float = 1.0,
) -> dict[str, Touch]:
    """What a sensor and a pad read of the touches; with a seed, of those of an inexact hand."""
    rng = np.random.default_rng(seed)
    matrix = np.linalg.inv(mounting_matrix(true.xyz_m, true.quat_xyzw, true.sign))
    found: dict[str, Touch] = {}
    for step, (x, y) in places.items():
        force = np.array((*pushes.get(step, (0.0, 0.0)), -5.0))
        if seed is not None:
            force = Rotation.from_rotvec(rng.normal(scale=math.radians(3.0), size=3)).apply(force)
            x, y = x + rng.normal(scale=5e-4), y + rng.normal(scale=5e-4)
        raw = matrix @ np.concatenate((force, np.cross(np.array((x, y, 0.0)), force)))
        scan_m = None if symmetry is None else scan_of(symmetry, (x, y))
        found[step] = Touch(raw[:3], torque_gain * raw[3:], scan_m)
    return found


def scan_of(symmetry: Symmetry, place: tuple[float, float]) -> tuple[float, float]:
    """Where a place of the pad is in the scan of an image with this orientation."""
    x, y = -place[0] if symmetry.flip_x else place[0], -place[1] if symmetry.flip_y else place[1]
    return (y, x) if symmetry.swap_xy else (x, y)


def wrong(true: Mount) -> dict[str, Mount]:
    """Configs that a person may have written for this mounting."""
    x, y, z, w = true.quat_xyzw
    return {
        "right": true,
        "sign": replace(true, sign=-true.sign),
        "wxyz": replace(true, quat_xyzw=(w, x, y, z)),
        "inverse": replace(true, quat_xyzw=(-x, -y, -z, w)),
        "elsewhere": replace(true, xyz_m=(0.0, 0.0, 0.0)),
        "everything": Mount(-true.sign, (0.01, 0.02, 0.03), (w, x, y, z)),
    } | {
        f"turned by {turn}": replace(true, quat_xyzw=turned(true, turn))
        for turn in ("x90", "x180", "y90", "y-90", "z90", "z180", "z-90")
    }


def turned(mount: Mount, turn: str) -> tuple[float, float, float, float]:
    rotation = Rotation.from_quat(mount.quat_xyzw) * Rotation.from_euler(turn[0], float(turn[1:]), degrees=True)
    x, y, z, w = map(float, rotation.as_quat())
    return x, y, z, w


def away_deg(first: Mount, second: Mount) -> float:
    return math.degrees((Rotation.from_quat(first.quat_xyzw) * Rotation.from_quat(second.quat_xyzw).inv()).magnitude())


@given(st.sampled_from(sorted(wrong(TRUE))), st.sampled_from(SYMMETRIES), st.sampled_from((1, -1)), SEEDS)
def test_every_wrong_mounting_is_found_with_every_orientation_of_the_image_by_an_inexact_hand_too(
    fault: str, symmetry: Symmetry, sign: int, seed: int | None
) -> None:
    true = replace(TRUE, sign=sign)
    found = find_mounting(touches(true, symmetry, seed=seed), wrong(true)[fault])
    assert found.mount is not None, found.problems
    assert (found.mount.sign, found.symmetry, found.problems) == (sign, symmetry, [])
    assert away_deg(found.mount, true) < 0.1
    assert found.mount.xyz_m == pytest.approx(true.xyz_m, abs=2e-4 if seed is None else 4e-3)


@pytest.mark.parametrize("fault", ["right", "sign"])
def test_what_is_right_in_a_config_is_kept_to_the_digit(fault: str) -> None:
    found = find_mounting(touches(seed=3), wrong(TRUE)[fault])
    assert found.mount == TRUE
    assert "the position of the config is kept" in found.notes[-1]


ONE_PLACE = dict.fromkeys(PLACES, (0.0, 0.0))
NO_PUSH = "the pushes show no force along the pad: push along +X and along +Y"
Change = Callable[[], dict[str, Touch]]


@pytest.mark.parametrize(
    ("made", "words", "doubtful"),
    [
        (lambda: touches(places=ONE_PLACE), "all presses were at one place", (END, CORNER)),
        (lambda: touches(places=ONE_PLACE, symmetry=None), "all presses were at one place", (END, CORNER)),
        (lambda: touches(places=PLACES | {CORNER: (0.02, -0.009)}), "on the other side", (CORNER, PUSH_X, PUSH_Y)),
        (lambda: touches(places=PLACES | {END: (0.0, 0.009)}), "on the other side", (END, CORNER, PUSH_X, PUSH_Y)),
        (lambda: touches(pushes={PUSH_X: (2.0, 0.0), PUSH_Y: (0.0, -2.0)}), "on the other side", None),
        (
            lambda: touches(pushes={PUSH_X: (-2.0, 0.0), PUSH_Y: (0.0, 2.0)}),
            "on the other side",
            (CORNER, PUSH_X, PUSH_Y),
        ),
        (lambda: touches(pushes={PUSH_X: (2.0, 0.0), PUSH_Y: (2.0, 0.0)}), "0° apart, not 90°", (PUSH_X, PUSH_Y)),
        (lambda: touches(pushes={PUSH_X: (2.0, 0.0), PUSH_Y: (1.5, 1.5)}), "45° apart, not 90°", (PUSH_X, PUSH_Y)),
        (lambda: touches(torque_gain=1000.0), "in N·mm", ()),
        (lambda: touches(torque_gain=0.001), "in kN·m", ()),
        (lambda: touches(torque_gain=1.7), "1.70 times as far as the image: pitch_m", (CENTRE, END, CORNER)),
        (lambda: {step: touch for step, touch in touches().items() if step != PUSH_Y}, "nothing at: push_y", ()),
        (
            lambda: touches() | {END: replace(touches()[END], force=touches()[PUSH_X].force * (1, -1, -1))},
            "different",
            (END,),
        ),
        (lambda: touches(pushes=PUSHES | {PUSH_X: (0.0, 0.0)}), NO_PUSH, (PUSH_X,)),
        (lambda: touches(pushes=PUSHES | {PUSH_Y: (0.0, 0.0)}), NO_PUSH, (PUSH_Y,)),
        (
            lambda: touches() | {step: replace(touches()[step], scan_m=(0.016, 0.013)) for step in (END, CORNER)},
            "the orientation of the image is open",
            None,
        ),
    ],
)  # fmt: skip
def test_what_does_not_follow_is_reported_and_not_guessed_and_what_made_again_may_help_is_named(
    made: Change, words: str, doubtful: tuple[str, ...] | None
) -> None:
    for present in wrong(TRUE).values():
        found = find_mounting(made(), present)
        assert (found.mount, found.symmetry) == (None, None)
        assert any(words in problem for problem in found.problems), found.problems
        assert doubtful in (None, found.doubtful)


@pytest.mark.parametrize("has_pad", [True, False])
@pytest.mark.parametrize("step", [CENTRE, PUSH_X])
def test_a_touch_that_no_position_of_the_sensor_explains_is_named(step: str, has_pad: bool) -> None:
    made = touches(symmetry=SYMMETRIES[3] if has_pad else None, seed=1)
    spin_nm = 0.1 * made[CENTRE].force / np.linalg.norm(made[CENTRE].force)
    made[step] = replace(made[step], torque=made[step].torque + spin_nm)
    found = find_mounting(made, TRUE, has_pad=has_pad)
    assert (found.mount, found.symmetry) == (None, None)
    assert f"{NAMES[step]} fits the others worst" in found.problems[0]
    assert found.doubtful == (step,)


def three_axis(symmetry: Symmetry, signs: tuple[int, int, int]) -> dict[str, Touch]:
    order = [1, 0, 2] if symmetry.swap_xy else [0, 1, 2]
    return {
        step: Touch(
            (np.array((*PUSHES.get(step, (0.0, 0.0)), -5.0)) * signs)[order], np.zeros(3), scan_of(symmetry, place)
        )
        for step, place in PLACES.items()
    }


@pytest.mark.parametrize("symmetry", SYMMETRIES, ids=str)
@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, -1, -1)])
def test_the_axes_of_a_three_axis_pad_are_found(symmetry: Symmetry, signs: tuple[int, int, int]) -> None:
    found = find_three_axis(three_axis(symmetry, signs))
    assert (found.symmetry, found.axes, found.problems) == (symmetry, signs, [])


def test_what_a_three_axis_pad_does_not_show_is_reported() -> None:
    made = three_axis(Symmetry(), (1, 1, 1))
    centre = made[CENTRE].scan_m
    for wrong_touches, words in (
        (made | {END: replace(made[END], scan_m=None)}, "showed nothing at: end"),
        (made | {END: replace(made[END], scan_m=centre), CORNER: replace(made[CORNER], scan_m=centre)}, "orientation"),
        (made | {PUSH_X: made[PUSH_Y]}, "do not fit the presses"),
        (made | {CENTRE: replace(made[CENTRE], force=np.array((1.0, 0.0, 0.1)))}, "right angles"),
    ):
        found = find_three_axis(wrong_touches)
        assert found.axes is None
        assert words in found.problems[0]


NUMBERS = st.sampled_from((0.0, 0.0, 1.0, -1.0, 5.0, -5.0, 1e-300, 1e6)) | st.floats(-1e3, 1e3)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
SCANS = st.none() | st.tuples(*(st.sampled_from((0.0, 0.01, -0.02)),) * 2)
TOUCHES = st.dictionaries(st.sampled_from(STEPS), st.builds(Touch, VECTORS, VECTORS, SCANS))
FULL = st.fixed_dictionaries(dict.fromkeys(STEPS, st.builds(Touch, VECTORS, VECTORS, SCANS)))


@given(TOUCHES | FULL)
def test_any_touches_give_a_mounting_or_problems(touches: dict[str, Touch]) -> None:
    found = find_mounting(touches, LEVEL)
    assert (found.mount is None) <= bool(found.problems)
    found = find_three_axis(touches)
    assert (found.axes is None) == bool(found.problems)


TYPED = 9.81 * np.array(((0, 0, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1)))
ALONG_Z = [Pose(np.array((0.0, 0.0, k == 3)), np.zeros(3), TYPED[k]) for k in range(4)]
"""Forces on one line, from which no rotation follows."""


@given(st.lists(st.builds(Pose, VECTORS, VECTORS, VECTORS), min_size=3, max_size=5))
@example(ALONG_Z)
def test_any_poses_give_a_weight_or_problems(poses: list[Pose]) -> None:
    findings = find_weight(poses, LEVEL)
    assert (findings.found is None) <= bool(findings.problems)
