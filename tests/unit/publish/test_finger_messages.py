"""Messages about a finger: each has exactly its fields, and what is not known is nil."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from finger_bench import read_force
from fixture_types import Image, Wrench
from known_zeros import known_finger
from nanoseconds import MS, T0

from slipd.config import Config, Levels
from slipd.finger.finger import Finger
from slipd.publish.finger_messages import slip_body, tactile_body, wrench_body
from slipd.types.samples import WrenchSample

FULL = np.full((4, 4), 100)

LEARNED = {"mu_d", "carried_friction", "relative_utilisation"}
"""What a grasp must show before it is known."""

ONLY_IN_CONTACT = LEARNED | {
    "required_friction",
    *("tangential_n", "spin_nm", "centroid_m", "centroid_std_m", "friction_ratio", "centroid_residual_m"),
    *("utilisation", "utilisation_lower", "utilisation_upper", "torque_limit_nm", "pole_m"),
    *("tipping_margin_m", "grip_needed_n", "friction_ratio_std"),
}


def made(parse: Callable[[str], Config], text: str) -> Finger:
    ((name, settings),) = parse(text).finger.items()
    return known_finger(name, settings, Levels())


@pytest.fixture
def finger(left: str, parse: Callable[[str], Config]) -> Finger:
    return made(parse, left)


def nil(body: dict[str, Any]) -> set[str]:
    """Keys without a value, but those of the zero, which this finger does not know."""
    return {name for name, value in body.items() if value is None} - {"tare_origin", "tare_age_s"}


ONE = np.where(np.arange(16) == 5, 100, 0).reshape(4, 4)
Case = tuple[np.ndarray, tuple[Any, ...] | None, dict[str, Any], set[str], dict[str, Any]]
"""Counts of the image, contact and status of the reading, keys that are nil, and some values."""
SLIPS: dict[str, Case] = {
    "a contact has no nil": (
        FULL,
        (10.0, (3.0, 0.0), 0.012, (0.001, -0.0005)),
        {},
        LEARNED,
        {
            "level": "caution",
            "level_code": 2,
            "model": "exact",
            "mu": 0.5,
            "mu_source": "config",
            "age_s": 0.0,
            "normal_n": pytest.approx(10.0),
            "tangential_n": pytest.approx([3.0, 0.0]),
            "spin_nm": pytest.approx(0.012),
            "centroid_m": pytest.approx([0.001, -0.0005]),
            "friction_ratio": pytest.approx(0.3),
            "tipping_margin_m": pytest.approx(0.005),
            "tipping_margin_std_m": 0.002,
        },
    ),
    "without contact the quantities of a contact are nil": (
        FULL,
        (0.2, (0.1, 0.0)),
        {},
        ONLY_IN_CONTACT,
        {"normal_n": pytest.approx(0.2), "level": "no_contact", "reasons": [], "model": "none"},
    ),
    "before the first reading everything is nil": (
        FULL,
        None,
        {},
        ONLY_IN_CONTACT | {"normal_n", "age_s"},
        {"level": "unknown"},
    ),
    "of an overloaded sensor everything is nil": (
        FULL,
        (10.0, (1.0, 0.0)),
        {"status": ("overload",)},
        ONLY_IN_CONTACT | {"normal_n"},
        {"level": "unknown", "age_s": 0.0},
    ),
    "of a reading that is not finite everything is nil": (
        FULL,
        (math.nan,),
        {},
        ONLY_IN_CONTACT | {"normal_n"},
        {"level": "unknown", "age_s": 0.0},
    ),
    "utilisation and grip needed are nil where no grip holds": (
        ONE,
        (10.0, (0.0, 0.0), 0.01, (-0.002, -0.002)),
        {},
        LEARNED | {"utilisation", "utilisation_lower", "utilisation_upper", "grip_needed_n", "required_friction"},
        {"reasons": ["unsupportable", "rotation"]},
    ),
}


@pytest.mark.parametrize("name", SLIPS)
def test_slip(finger: Finger, wrench: Wrench, image: Image, name: str) -> None:
    counts, contact, status, unknown, expected = SLIPS[name]
    finger.update_image(image(T0 - MS, counts))
    if contact is not None:
        read_force(finger, wrench(T0, *contact, **status))
    body = slip_body(finger, finger.state)
    assert nil(body) == unknown
    assert {key: body[key] for key in expected} == expected
    if not unknown - LEARNED:
        assert body["utilisation_lower"] <= body["utilisation"] <= body["utilisation_upper"]
        assert body["torque_limit_nm"] > 0.012
        assert body["grip_needed_n"] == pytest.approx(1.3 * 10.0 * body["utilisation"], rel=1e-6), "rigid, safety 1.3"
    finger.disconnect(T0 + 50 * MS)
    body = slip_body(finger, finger.state)
    assert nil(body) - {"age_s"} == ONLY_IN_CONTACT | {"normal_n"}
    assert body["age_s"] == (None if contact is None else pytest.approx(0.05))


def test_the_grip_needed_allows_for_the_noise_of_the_reading(
    left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image
) -> None:
    needed = []
    for noise_n in (0.0, 0.1):
        finger = made(parse, left.replace("force_std_n = 0.0", f"force_std_n = {noise_n}"))
        finger.update_image(image(T0 - MS, FULL))
        read_force(finger, wrench(T0, 10.0, (3.0, 0.0)))
        needed.append(slip_body(finger, finger.state)["grip_needed_n"])
    assert needed[1] / needed[0] == pytest.approx(1.0 + 1.645 * 0.1 / 3.0, rel=1e-3), "with a confidence of 95 %"


def test_the_torque_limit_is_in_the_sense_of_the_spin(finger: Finger, wrench: Wrench, image: Image) -> None:
    """With a force away from the centre of the load the two senses differ."""
    lopsided = np.array([[100] * 4] * 2 + [[10] * 4] * 2)
    finger.update_image(image(T0, lopsided))
    limits = []
    for spin_nm in (0.001, -0.001):
        read_force(finger, wrench(T0, 10.0, (3.0, 0.0), spin_nm, (0.0, -0.003)))
        limits.append(slip_body(finger, finger.state)["torque_limit_nm"])
    assert limits[0] != pytest.approx(limits[1], rel=1e-3)


@pytest.mark.parametrize("mu", [0.5, None])
def test_without_a_coefficient_a_load_is_compared_with_what_was_carried(
    left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image, mu: float | None
) -> None:
    """A load of 3 N after one of 2 N was carried for 0.4 s, both at 10 N."""
    finger = made(parse, left if mu else left.replace("mu = 0.5\n", ""))
    for k in range(41):
        t_ns = T0 + 10 * k * MS
        finger.update_image(image(t_ns, FULL))
        read_force(finger, wrench(t_ns, 10.0, (2.0 if k < 40 else 3.0, 0.001 * (k % 3))))
    body = slip_body(finger, finger.state)
    assert (body["mu"], body["mu_source"]) == ((mu, "config") if mu else (None, "none"))
    assert (body["utilisation"], body["reasons"]) == ((pytest.approx(0.6, rel=1e-3), []) if mu else (None, ["no_mu"]))
    assert body == body | {
        "required_friction": pytest.approx(0.3, rel=1e-3),
        "carried_friction": pytest.approx(0.2, rel=1e-2),
        "relative_utilisation": pytest.approx(1.5, rel=1e-2),
    }


def test_wrench_is_in_the_frame_of_the_pad_and_nil_where_a_component_is_not_finite(
    finger: Finger, wrench: Wrench
) -> None:
    read_force(finger, wrench(T0, 10.0, (3.0, -1.0), 0.0, (0.001, 0.0), status=("skipped",)), T0 - 2_000_000)
    assert wrench_body(finger, finger.state) == {
        "finger": "left",
        "force_unit": "N",
        "force_n": [3.0, -1.0, -10.0],
        "torque_nm": pytest.approx([0.0, 0.01, -0.001]),
        "normal_n": 10.0,
        "tangential_n": [3.0, -1.0],
        "status": ["skipped"],
        "tare_id": 0,
        "age_s": pytest.approx(0.002),
    }
    for pull_n, torque, force in ((math.nan, np.zeros(3), None), (2.0, None, [1.0, 2.0, -10.0])):
        read_force(finger, WrenchSample(T0, None, np.array((1.0, pull_n, -10.0)), torque))
        body = wrench_body(finger, finger.state)
        assert (body["force_n"], body["tangential_n"]) == (force, force and force[:2])
        assert (body["torque_nm"] is None) == (torque is None or force is None)


LINE, CORNER, EMPTY = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
LINE[2, :] = 100
CORNER[:2, :2] = (100, 200), (100, 4)
GRID = {"rows": 4, "cols": 4, "pitch_m": 0.004, "rows_along": "+y", "cols_along": "+x"}


@pytest.mark.parametrize(
    ("counts", "unknown", "expected"),
    [
        (
            CORNER,
            set(),
            {
                "image_ok": True,
                "loads_n": pytest.approx([1.0, 2.0, 0.0, 0.0, 1.0] + [0.0] * 11),
                "active": 3,
                "holes": 0,
                "area_m2": pytest.approx(3 * 0.004**2),
                "centroid_m": pytest.approx([-0.004, -0.005]),
            },
        ),
        (
            np.full((4, 4), np.nan),
            {"loads_n", "active", "area_m2", "centroid_m", "axis_rad", "elongation", "holes", "corners_m"},
            {"image_ok": False},
        ),
        (EMPTY, {"centroid_m", "axis_rad", "elongation"}, {"image_ok": True, "active": 0, "area_m2": 0.0}),
        (EMPTY, {"centroid_m", "axis_rad", "elongation"}, {"corners_m": []}),
        (LINE, {"elongation"}, {"axis_rad": pytest.approx(0.0)}),
    ],
)
def test_tactile_has_the_load_of_every_taxel_and_the_shape_of_the_contact(
    finger: Finger, image: Image, counts: np.ndarray, unknown: set[str], expected: dict[str, Any]
) -> None:
    finger.update_image(image(T0, counts))
    assert finger.image is not None
    body = tactile_body(finger, finger.image)
    assert nil(body) == unknown
    assert {key: body[key] for key in expected | GRID} == expected | GRID


def test_only_calibrated_forces_are_in_newtons(
    left: str, right: str, parse: Callable[[str], Config], wrench: Wrench, image: Image
) -> None:
    papillarray = right.replace('"xela"', '"papillarray"').replace("rows = 2\ncols = 2", "rows = 3\ncols = 3")
    papillarray = papillarray.replace("ws://127.0.0.1:5000", "/dev/p").replace('"2"', '"0"').partition("tare =")[0]
    for text, unit, image_unit in (
        (left, "N", "uncalibrated"),
        (left + "gain_error = 0.05\n", "N", "N"),
        (right, "uncalibrated", "uncalibrated"),
        (right + "gain_error = 0.05\n", "N", "N"),
        (papillarray.replace("[0.001, 0.001, -0.001]", "[1.0, -1.0, -1.0]"), "N", "N"),
        (papillarray, "uncalibrated", "uncalibrated"),
    ):
        assert units(made(parse, text)) == [unit, unit, image_unit]


def units(finger: Finger) -> list[str]:
    """Return the units of the messages about a finger."""
    assert finger.image is not None
    bodies = slip_body(finger, finger.state), wrench_body(finger, finger.state)
    return [body["force_unit"] for body in (*bodies, tactile_body(finger, finger.image))]


def test_raw_values_of_a_sensor_are_not_in_newtons(finger: Finger, wrench: Wrench) -> None:
    read_force(finger, wrench(T0, 10.0, status=("raw",)))
    assert units(finger)[:2] == ["uncalibrated"] * 2
