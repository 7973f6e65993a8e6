"""The methods of the chart implement what they are named after, so that the comparison is fair."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from chart.methods import METHODS, Method, ask, find, verdict
from chart.rivals import models
from chart.scaling import contact
from chart.scenes import Scene, draw
from chart.scores import Question, scores
from project import MODULES

from slipd.fusion import torque_limit

EXACT = [method for method in METHODS if method.exact]
SOUGHT = [method for method in METHODS if method.short not in ("bounds", "translation")]


@pytest.fixture
def easy() -> Scene:
    """A round contact of 60 taxels, no taxel near the pole."""
    return contact(60, np.random.default_rng(5))


def disc(ratio: float, rings: int = 20) -> Scene:
    """A uniform disc of radius 1 m, μ f_n = 1 N, in rings of equal width that each carry their area."""
    radius = (np.arange(rings) + 0.5) / rings
    angle = 2.0 * math.pi * (np.arange(4 * rings) + 0.5) / (4 * rings)
    x, y = (np.outer(radius, way(angle)).ravel() for way in (np.cos, np.sin))
    loads = np.repeat(radius, angle.size)
    return Scene("disc", x, y, 2.0 * loads / loads.sum(), 0.5, np.array((ratio, 0.0)), np.zeros(2))


@pytest.mark.parametrize("method", EXACT, ids=lambda method: method.short)
def test_what_claims_the_exact_limit_has_it_on_an_easy_contact(method: Method, easy: Scene) -> None:
    right = torque_limit(easy.x, easy.y, easy.loads, easy.mu, easy.tangential, easy.about).torque_nm
    limit, failure = ask(method, easy)
    assert failure == ""
    assert limit == pytest.approx(right, abs=1e-6 * easy.torque_scale_nm)


@pytest.mark.parametrize("method", SOUGHT, ids=lambda method: method.short)
def test_every_limit_scales_with_lengths_and_forces(method: Method, easy: Scene) -> None:
    places = (1e3 * easy.x, 1e3 * easy.y)
    other = Scene("other", *places, 1e-6 * easy.loads, easy.mu, 1e-6 * easy.tangential, 1e3 * easy.about)
    assert method.limit(other) == pytest.approx(1e-3 * method.limit(easy), rel=1e-6)


@pytest.mark.parametrize(("ratio", "printed", "factor"), [(0.0, 0.667, 1.0), (0.5, 0.798, 1.48), (0.9, 1.293, 5.68)])
def test_the_printed_test_overstates_a_disc_as_its_integrals_say(ratio: float, printed: float, factor: float) -> None:
    scene = disc(ratio)
    found, right = find("(6) printed").limit(scene), find("(6) corrected").limit(scene)
    assert found == pytest.approx(printed, rel=3e-3)
    assert found / right == pytest.approx(factor, rel=6e-3)


def test_the_printed_test_calls_a_sliding_disc_safe_and_the_corrected_one_does_not() -> None:
    scene = disc(0.9)
    assert verdict(find("(6) printed"), scene, 0.3) is True
    assert verdict(find("(6) corrected"), scene, 0.3) is False


def test_the_paper_finds_a_hinge() -> None:
    scene = Scene(
        "hinge", np.array((0.0, 1.0, -1.0)), np.zeros(3), np.array((10.0, 1.0, 1.0)), 0.5, np.zeros(2), np.zeros(2)
    )
    assert find("(6) corrected").limit(scene) == pytest.approx(1.0)


def test_the_models_have_the_right_disc_where_they_are_exact_and_err_where_known() -> None:
    free, near = disc(0.0), disc(0.9)
    for short in ("power law", "separate", "felt ellipsoid", "ellipsoid"):
        assert find(short).limit(free) == pytest.approx(2.0 / 3.0, rel=2e-3), short
    assert find("ellipsoid").limit(near) == pytest.approx(0.290, abs=2e-3)
    assert find("separate").limit(near) == pytest.approx(0.667, abs=2e-3)
    assert find("translation").limit(near) == math.inf


def test_the_power_law_is_exact_on_its_own_patch() -> None:
    """A patch of that pressure, in rings, against the curve from elliptic integrals."""
    for ratio in (0.3, 0.9, 0.99):
        scene = disc(ratio)
        radius = np.hypot(scene.x, scene.y)
        loads = scene.loads * (1.0 - radius**models.PRESSURE_EXPONENT) ** (1.0 / models.PRESSURE_EXPONENT)
        scene = Scene("patch", scene.x, scene.y, 2.0 * loads / loads.sum(), 0.5, scene.tangential, scene.about)
        assert models.power_law(scene) == pytest.approx(find("slipd").limit(scene), rel=3e-3), ratio


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.short)
def test_none_calls_a_contact_safe_whose_force_is_beyond_the_friction_circle(method: Method) -> None:
    assert verdict(method, disc(1.1), 0.0) is False


def test_the_bounds_of_one_pass_say_nothing_between_them() -> None:
    scene, method = draw(15), find("bounds")
    right = find("slipd").limit(scene)
    assert verdict(method, scene, right) is None
    assert verdict(method, scene, method.limit(scene)) is True
    assert verdict(method, scene, 3.0 * right) is False


def test_an_exception_is_counted_as_a_failure() -> None:
    def broken(_: Scene) -> float:
        raise ZeroDivisionError

    method = Method("broken", "broken", broken)
    assert ask(method, draw(0))[1] == "ZeroDivisionError"
    assert verdict(method, draw(0), 0.0) is None


def test_scores_tell_wrong_missing_and_both_wrong_sides_apart() -> None:
    def method(value: float) -> Method:
        return Method("m", str(value), lambda _: value)

    scene = disc(0.0)
    asked = [Question(scene, 0.6, 0.3, is_safe=True), Question(scene, 0.6, 0.9, is_safe=False)]
    right, high, low, missing = scores(asked, [method(value) for value in (0.6, 1.0, 0.1, math.nan)])
    assert not (right.wrong | right.no_answer | right.unsafe | right.alarm | right.silent).any()
    assert high.wrong.all()
    assert (high.unsafe.tolist(), high.alarm.tolist()) == ([False, True], [False, False])
    assert (low.unsafe.tolist(), low.alarm.tolist()) == ([False, False], [True, False])
    assert missing.no_answer.all()
    assert missing.silent.all()
    assert missing.quantile(0.99, failures=True) == math.inf


@pytest.mark.timeout(300)
def test_make_chart_writes_picture_tables_and_atlas(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("clarabel")
    command = [sys.executable, "-m", "chart", "--quick", "--into", str(tmp_path)]
    subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": MODULES}, timeout=280, capture_output=True)
    assert (tmp_path / "speed_accuracy.png").read_bytes().startswith(b"\x89PNG")
    report = (tmp_path / "speed_accuracy.md").read_text(encoding="utf-8")
    for method in METHODS:
        assert f"| {method.name} |" in report
    assert (tmp_path / "failure_atlas.md").stat().st_size > 0
