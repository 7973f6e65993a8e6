"""Level and reasons of one reading."""

from __future__ import annotations

import math

import numpy as np
import pytest
from finger_bench import (
    EMPTY,
    FULL,
    T0,
    Image,
    NoisyFinger,
    Parse,
    Press,
    Wrench,
    limit_nm,
    make_finger,
    pull,
    read_force,
    verdict,
)
from hypothesis import given
from hypothesis import strategies as st

from slipd.finger.finger import Finger
from slipd.finger.verdict import danger_reasons
from slipd.fusion.rows import LOAD_DROP_BIT
from slipd.types.samples import WrenchSample

RISING = np.linspace(3.0, 4.8, 150)
"""A pull that grows, N, on a contact that is pressed with 10 N and has a μ of 0.5."""


def test_pad_without_normal_force_is_no_contact(press: Press) -> None:
    assert verdict(press(0.0)) == ("no_contact", ())
    assert verdict(press(-1.4)) == ("no_contact", ())


def test_even_pressure_with_little_tangential_force_is_stable(press: Press) -> None:
    state = press(10.0, (1.0, 0.5))
    assert verdict(state) == ("stable", ())
    assert state.model == "exact"
    assert state.utilisation is not None
    assert state.utilisation.value == pytest.approx(math.hypot(1.0, 0.5) / (0.5 * 10.0), rel=1e-6)
    assert state.load_distribution is not None
    assert state.contact.normal_n * state.load_distribution.loads.loads.sum() == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("share", "level"), [(0.69, "stable"), (0.72, "caution"), (0.84, "caution"), (0.86, "warning")]
)
def test_tangential_force_alone_raises_the_level_for_translation(press: Press, share: float, level: str) -> None:
    state = press(10.0, (share * 5.0, 0.0))
    assert verdict(state) == (level, () if level == "stable" else ("translation",))


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(("share", "level"), [(0.69, "stable"), (0.72, "caution"), (0.86, "warning"), (1.5, "warning")])
def test_spin_torque_alone_raises_the_level_for_rotation(
    finger: Finger, press: Press, share: float, level: str, sense: float
) -> None:
    state = press(10.0, (0.0, 0.0), sense * share * limit_nm(finger, 10.0))
    assert verdict(state) == (level, () if level == "stable" else ("rotation",))


def test_force_and_spin_together_are_worse_than_either(finger: Finger, press: Press) -> None:
    twist = 0.6 * limit_nm(finger, 10.0)
    assert press(10.0, (3.0, 0.0)).verdict.level == "stable"
    assert press(10.0, (0.0, 0.0), twist).verdict.level == "stable"
    level, reasons = verdict(press(10.0, (3.0, 0.0), twist))
    assert level in ("caution", "warning")
    assert "rotation" in reasons


def test_spin_on_a_single_taxel_is_unsupportable(press: Press) -> None:
    one = np.zeros((4, 4))
    one[1, 1] = 100
    at = (-0.002, -0.002)
    level, reasons = verdict(press(10.0, (0.0, 0.0), 0.01, at, counts=one))
    assert level == "warning"
    assert reasons[:2] == ("unsupportable", "rotation")


def test_centroid_outside_the_image_is_tipping(press: Press) -> None:
    """The hull of the taxels ends at 6 mm; it is uncertain by half a pitch, 2 mm."""
    assert verdict(press(10.0, (0.0, 0.0), 0.0, (0.0059, 0.0))) == ("stable", ())
    assert verdict(press(10.0, (0.0, 0.0), 0.0, (0.0070, 0.0))) == ("caution", ("tipping",))
    assert verdict(press(10.0, (0.0, 0.0), 0.0, (0.0090, 0.0))) == ("warning", ("tipping",))


def test_noise_of_the_centroid_is_not_tipping(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    noisy = make_finger(left.replace("torque_std_nm = 0.0", "torque_std_nm = 0.005"), parse)
    noisy.update_image(image(T0, FULL))
    assert verdict(read_force(noisy, wrench(T0, 10.0, (0.0, 0.0), 0.0, (0.0065, 0.0)))) == ("stable", ())


def test_tangential_force_that_falls_near_the_limit_is_a_slip(press: Press) -> None:
    assert pull(press, RISING)[-1] == "warning"
    assert pull(press, [3.9] * 8)[-1] == "slipping"
    state = press(10.0, (3.9, 0.0))
    assert state.verdict.reasons[0] == "slip_detected"
    assert state.assessment is not None
    assert state.assessment.evidence == LOAD_DROP_BIT
    assert state.assessment.peak_required == pytest.approx(0.48, rel=0.05)
    assert state.assessment.plateau_required == pytest.approx(0.39, rel=0.01)


def test_a_slip_is_reported_until_the_object_stops(press: Press) -> None:
    pull(press, RISING)
    assert pull(press, [3.9] * 100)[10:] == ["slipping"] * 90
    assert "slipping" not in pull(press, [3.0] * 10)[3:], "friction that slides does not fall"


def test_a_slip_is_reported_for_hold_s_at_most(press: Press) -> None:
    pull(press, RISING)
    assert "slipping" not in pull(press, [3.9] * 330)[-10:], "hold_s is 3 s"


def test_spin_that_falls_near_the_limit_is_a_slip(finger: Finger, press: Press) -> None:
    most = limit_nm(finger, 10.0)
    for share in np.linspace(0.4, 0.95, 60):
        press(10.0, (0.0, 0.0), share * most)
    for _ in range(8):
        state = press(10.0, (0.0, 0.0), 0.75 * most)
    assert state.verdict.level == "slipping"


def test_tightening_the_grip_is_not_a_slip(press: Press) -> None:
    """R falls as fast as in a slip, but the pull stays."""
    assert "slipping" not in pull(press, [4.8] * 6, [10.0, 10.0, 12.0, 14.0, 17.0, 20.0])


def test_setting_an_object_down_is_not_a_slip(press: Press) -> None:
    assert "slipping" not in pull(press, np.linspace(4.8, 0.0, 60))


def test_light_load_that_vanishes_is_not_a_slip(press: Press) -> None:
    assert "slipping" not in pull(press, [2.0, 2.0, 0.5, 0.0])


def test_contact_without_mu_is_unknown(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    finger = make_finger(left.replace("mu = 0.5\n", ""), parse)
    finger.update_image(image(T0, FULL))
    assert verdict(read_force(finger, wrench(T0, 10.0, (9.0, 0.0)))) == ("unknown", ("no_mu",))
    assert verdict(read_force(finger, wrench(T0, 0.0))) == ("no_contact", ())


@pytest.mark.parametrize("counts", [None, EMPTY])
def test_contact_without_image_is_unsafe_or_unknown(press: Press, counts: np.ndarray | None) -> None:
    for share, expected in (
        (0.1, ("unknown", ("rotation_unobserved",))),
        (0.8, ("unknown", ("rotation_unobserved",))),
        (0.86, ("warning", ("translation",))),
        (1.2, ("warning", ("translation",))),
    ):
        state = press(10.0, (share * 5.0, 0.0), counts=counts)
        assert verdict(state) == expected
        assert state.model == "translation"
        assert state.utilisation is None


def test_slip_is_reported_without_image(press: Press) -> None:
    for force in (*RISING, *[3.9] * 40):
        state = press(10.0, (force, 0.0), counts=None)
    assert verdict(state) == ("slipping", ("slip_detected", "rotation_unobserved"))


def test_contact_without_torque_is_unsafe_or_unknown(finger: Finger, image: Image) -> None:
    for pulled_n, level in ((1.0, ("unknown", ("rotation_unobserved",))), (4.8, ("warning", ("translation",)))):
        finger.update_image(image(T0, FULL))
        state = read_force(finger, WrenchSample(T0, None, np.array((pulled_n, 0.0, -10.0)), None))
        assert verdict(state) == level
        assert state.model == "translation"
        assert math.isnan(state.tipping_margin_m)
    assert verdict(read_force(finger, WrenchSample(T0, None, np.zeros(3), None))) == ("no_contact", ())


def test_contact_without_pad_is_unsafe_or_unknown(left: str, parse: Parse, wrench: Wrench) -> None:
    finger = make_finger(left.partition("[finger.left.pad]")[0], parse)
    assert verdict(read_force(finger, wrench(T0, 10.0, (1.0, 0.0)))) == ("unknown", ("rotation_unobserved",))
    assert verdict(read_force(finger, wrench(T0, 10.0, (4.8, 0.0)))) == ("warning", ("translation",))
    assert math.isnan(finger.state.tipping_margin_m)


def test_level_drops_a_hysteresis_below_its_threshold_after_a_while(press: Press) -> None:
    before = 0.72
    for share, level in ((0.72, "caution"), (0.66, "caution"), (0.64, "stable"), (0.86, "warning"), (0.79, "caution")):
        shares = np.concatenate((np.linspace(before, share, 100), np.full(30, share)))  # a slow load is no slip
        levels, before = pull(press, 0.5 * 10.0 * shares), share
        assert levels[-1] == level
        assert len(set(levels)) <= 3


@pytest.mark.parametrize(("pull_n", "spin_nm", "reason"), [(0.0, 9e5, "rotation"), (9e5, 0.0, "translation")])
def test_N3_load_beyond_any_grip_is_a_warning(noisy: NoisyFinger, pull_n: float, spin_nm: float, reason: str) -> None:
    noisy.look(8.0)
    noisy.send(np.array((pull_n, 0.0, -8.0)), np.array((0.0, 0.0, spin_nm)))
    assert noisy.verdict == ("warning", (reason,))


def test_reasons_name_what_uses_up_the_friction() -> None:
    assert danger_reasons(0.8, 0.79, 0.7) == ("translation",)
    assert danger_reasons(0.8, 0.1, 0.7) == ("rotation",)
    assert danger_reasons(0.95, 0.75, 0.7) == ("rotation", "translation")
    assert danger_reasons(math.inf, 0.1, 0.7) == ("unsupportable", "rotation")


@given(st.floats(0.0, 3.0), st.floats(0.0, 1.0))
def test_danger_has_a_reason(utilisation: float, share: float) -> None:
    assert danger_reasons(utilisation, share * utilisation, 0.7)
