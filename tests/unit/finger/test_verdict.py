"""Level and reasons of one reading."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import EMPTY, FULL, Press, limit_nm, make_finger, pull, verdict
from finger_bench import read_force as read
from fixture_types import Image, Parse, Wrench
from hypothesis import given
from hypothesis import strategies as st
from nanoseconds import T0

from slipd.finger.finger import Finger
from slipd.finger.verdict import danger_reasons
from slipd.fusion import grip_needed_n, torque_limit
from slipd.fusion.rows import LOAD_DROP_BIT
from slipd.fusion.streaming import assessment_at
from slipd.publish.finger_messages import slip_body
from slipd.types.samples import WrenchSample

RISING = np.linspace(3.0, 4.8, 150)
"""A pull that grows, N, on a contact that is pressed with 10 N and has a μ of 0.5."""
ONE = np.where(np.arange(16) == 5, 100, 0).reshape(4, 4)
"""An image of one taxel, at (-2, -2) mm."""
FREE, HOLDS, UNOBSERVED = ("no_contact",), ("stable",), ("unknown", "rotation_unobserved")


@pytest.mark.parametrize(
    ("normal_n", "share", "turn", "at_mm", "counts", "expected"),
    [
        (0.0, 0.0, 0.0, (0.0, 0.0), FULL, FREE),
        (-1.4, 0.0, 0.0, (0.0, 0.0), FULL, FREE),
        (10.0, 0.69, 0.0, (0.0, 0.0), FULL, HOLDS),
        (10.0, 0.72, 0.0, (0.0, 0.0), FULL, ("caution", "translation")),
        (10.0, 0.84, 0.0, (0.0, 0.0), FULL, ("caution", "translation")),
        (10.0, 0.86, 0.0, (0.0, 0.0), FULL, ("warning", "translation")),
        (10.0, 0.0, 0.69, (0.0, 0.0), FULL, HOLDS),
        (10.0, 0.0, -0.72, (0.0, 0.0), FULL, ("caution", "rotation")),
        (10.0, 0.0, 0.86, (0.0, 0.0), FULL, ("warning", "rotation")),
        (10.0, 0.0, -1.5, (0.0, 0.0), FULL, ("warning", "rotation")),
        (10.0, 0.6, 0.6, (0.0, 0.0), FULL, ("warning", "rotation")),
        (10.0, 0.0, 1.0, (-2.0, -2.0), ONE, ("warning", "unsupportable", "rotation")),
        # The hull of the taxels ends at 6 mm; it is uncertain by half a pitch, 2 mm.
        (10.0, 0.0, 0.0, (5.9, 0.0), FULL, HOLDS),
        (10.0, 0.0, 0.0, (7.0, 0.0), FULL, ("caution", "tipping")),
        (10.0, 0.0, 0.0, (9.0, 0.0), FULL, ("warning", "tipping")),
        # Without an image, translation alone can prove a grip unsafe, never safe.
        (10.0, 0.1, 0.0, (0.0, 0.0), None, UNOBSERVED),
        (10.0, 0.8, 0.0, (0.0, 0.0), EMPTY, UNOBSERVED),
        (10.0, 0.86, 0.0, (0.0, 0.0), None, ("warning", "translation")),
        (10.0, 1.2, 0.0, (0.0, 0.0), EMPTY, ("warning", "translation")),
    ],
)
def test_level_and_reasons_of_a_contact(
    finger: Finger, press: Press, normal_n: float, share: float, turn: float, at_mm: tuple[float, float],
    counts: np.ndarray | None, expected: tuple[str, ...],
) -> None:  # fmt: skip
    """``share`` of the friction is used by a tangential force, ``turn`` of the torque limit by a spin."""
    at_m = at_mm[0] * 1e-3, at_mm[1] * 1e-3
    state = press(normal_n, (share * 0.5 * normal_n, 0.0), turn * limit_nm(finger, 10.0), at_m, counts=counts)
    level, reasons = verdict(state)
    assert (level, *reasons)[: len(expected)] == expected
    assert bool(reasons) is (len(expected) > 1)
    if normal_n > 0.0:
        seen = counts is FULL or counts is ONE
        model = slip_body(finger, state)["model"]
        assert (model, state.utilisation is not None) == ("exact" if seen else "translation", seen)
        if turn == 0.0 and seen:
            assert state.utilisation.value == pytest.approx(share, rel=1e-6)


@pytest.mark.parametrize("spin", [0.006, -0.006])
def test_the_force_and_the_torque_that_a_contact_needs_and_holds(
    left: str, parse: Parse, make_press: Callable[[Finger], Press], spin: float
) -> None:
    finger = make_finger(left.replace("mu = 0.5", "mu = 0.5\ncontact_growth = 0.2"), parse)
    press = make_press(finger)
    assert finger.state.needed_normal_n(finger.config) is slip_body(finger, finger.state)["torque_limit_nm"] is None
    state = press(10.0, (1.0, 0.5), spin, (0.001, 0.0))
    loads = state.load_distribution.shares * 10.0
    taxels = state.load_distribution.x, state.load_distribution.y, loads, 0.5
    needed_n = grip_needed_n(*taxels, (1.0, 0.5), spin, (0.001, 0.0), growth=0.2, safety=finger.config.grip_safety)
    limit_nm = torque_limit(*taxels, (1.0, 0.5), (0.001, 0.0), 1 if spin > 0.0 else -1).torque_nm
    assert state.needed_normal_n(finger.config) == pytest.approx(needed_n, rel=1e-6)
    assert slip_body(finger, state)["torque_limit_nm"] == pytest.approx(limit_nm, rel=1e-6)
    unseen = press(10.0, (1.0, 0.5), spin, counts=EMPTY)
    assert unseen.needed_normal_n(finger.config) is slip_body(finger, unseen)["torque_limit_nm"] is None


def test_noise_of_the_centroid_is_not_tipping(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    noisy = make_finger(left.replace("torque_std_nm = 0.0", "torque_std_nm = 0.005"), parse)
    noisy.update_image(image(T0, FULL))
    assert verdict(read(noisy, wrench(T0, 10.0, (0.0, 0.0), 0.0, (0.0065, 0.0)))) == ("stable", ())


@pytest.mark.parametrize("counts", [FULL, None])
def test_a_slip_is_reported_until_the_object_stops_and_for_hold_s_at_most(
    press: Press, counts: np.ndarray | None
) -> None:
    for force in (*RISING, *[3.9] * 40):
        state = press(10.0, (force, 0.0), counts=counts)
    assert state.verdict.reasons[0] == "slip_detected"
    found = assessment_at(state.reading, 0)
    assert found.evidence == LOAD_DROP_BIT
    if counts is not None:
        assert found.peak_required == pytest.approx(0.48, rel=0.05)
        assert found.plateau_required == pytest.approx(0.39, rel=0.01)
        assert "slipping" not in pull(press, [3.9] * 290)[-10:], "hold_s is 3 s"
        pull(press, RISING)
        assert pull(press, [3.9] * 20)[-1] == "slipping"
        assert "slipping" not in pull(press, [3.0] * 10)[3:], "friction that slides does not fall"


def test_spin_that_falls_near_the_limit_is_a_slip(finger: Finger, press: Press) -> None:
    most = limit_nm(finger, 10.0)
    for share in (*np.linspace(0.4, 0.95, 60), *[0.75] * 8):
        state = press(10.0, (0.0, 0.0), share * most)
    assert state.verdict.level == "slipping"


@pytest.mark.parametrize(
    ("pulls", "normals"),
    [
        ([4.8] * 6, [10.0, 10.0, 12.0, 14.0, 17.0, 20.0]),  # the grip tightens: R falls as fast as in a slip
        (np.linspace(4.8, 0.0, 60), None),  # the object is set down
        ([2.0, 2.0, 0.5, 0.0], None),  # a light load vanishes
    ],
)
def test_what_is_no_slip(press: Press, pulls: list[float], normals: list[float] | None) -> None:
    assert "slipping" not in pull(press, pulls, normals)


def test_contact_without_mu_is_unknown(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    finger = make_finger(left.replace("mu = 0.5\n", ""), parse)
    finger.update_image(image(T0, FULL))
    assert verdict(read(finger, wrench(T0, 10.0, (9.0, 0.0)))) == ("unknown", ("no_mu",))
    assert verdict(read(finger, wrench(T0, 0.0))) == ("no_contact", ())


@pytest.mark.parametrize("lacks", ["torque", "pad"])
def test_contact_without_torque_or_pad_is_unsafe_or_unknown(left: str, parse: Parse, image: Image, lacks: str) -> None:
    finger = make_finger(left if lacks == "torque" else left.partition("[finger.left.pad]")[0], parse)
    torque = None if lacks == "torque" else np.zeros(3)
    finger.update_image(image(T0, FULL))
    for pulled_n, expected in ((1.0, ("unknown", ("rotation_unobserved",))), (4.8, ("warning", ("translation",)))):
        state = read(finger, WrenchSample(T0, None, np.array((pulled_n, 0.0, -10.0)), torque))
        assert (verdict(state), slip_body(finger, state)["model"]) == (expected, "translation")
        assert slip_body(finger, state)["tipping_margin_m"] is None
    assert verdict(read(finger, WrenchSample(T0, None, np.zeros(3), torque))) == ("no_contact", ())


def test_level_drops_a_hysteresis_below_its_threshold_after_a_while(press: Press) -> None:
    before = 0.72
    for share, level in ((0.72, "caution"), (0.66, "caution"), (0.64, "stable"), (0.86, "warning"), (0.79, "caution")):
        shares = np.concatenate((np.linspace(before, share, 100), np.full(30, share)))  # a slow load is no slip
        levels, before = pull(press, 0.5 * 10.0 * shares), share
        assert levels[-1] == level
        assert len(set(levels)) <= 3


@given(st.one_of(st.floats(0.0, 3.0), st.just(math.inf)), st.floats(0.0, 1.0))
def test_danger_has_a_reason_which_names_what_uses_up_the_friction(utilisation: float, share: float) -> None:
    translation = 0.0 if math.isinf(utilisation) else share * utilisation
    reasons = danger_reasons(utilisation, translation, 0.7)
    if math.isinf(utilisation):
        assert reasons == ("unsupportable", "rotation")
    else:
        assert ("rotation" in reasons) is (translation < 0.9 * utilisation)
        assert ("translation" in reasons) is (translation >= 0.7 or "rotation" not in reasons)
