"""Coefficients of friction: from the config or a request, and which ones are more lenient."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from finger_bench import FULL, Press, make_finger, pull, read_force, teach
from fixture_types import Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.publish.finger_messages import slip_body
from slipd.types.samples import TactileSample, WrenchSample


@pytest.mark.parametrize(
    ("stated", "before", "set_to", "after", "pull_n"),
    [
        ("mu = 0.5\n", (0.5, "config", "warning"), 1.0, "stable", 4.5),  # λ is 0.45 then
        ("", (None, "none", "unknown"), 0.5, "stable", 1.0),
    ],
)
def test_mu_of_config_holds_until_a_request_sets_another(
    left: str, parse: Parse, make_press: Callable[[Finger], Press], stated: str,
    before: tuple[float | None, str, str], set_to: float, after: str, pull_n: float,
) -> None:  # fmt: skip
    finger = make_finger(left.replace("mu = 0.5\n", stated), parse)
    press = make_press(finger)

    def published() -> tuple[float | None, str]:
        body = slip_body(finger, finger.state)
        return body["mu"], body["mu_source"]

    assert (*finger.friction.state[:1], finger.friction.state.source, *pull(press, [pull_n])) == before
    finger.set_friction(set_to, None)
    assert (finger.friction.state.mu, finger.friction.state.source) == (set_to, "request")
    assert published() == before[:2], "of the reading before the request"
    assert (pull(press, [pull_n]), published()) == ([after], (set_to, "request"))


@pytest.mark.parametrize(
    ("set_to", "expected"),
    [
        ([], [False, True]),  # as the config has it: 0.03
        ([0.2], [False, True]),  # dynamic friction far below does not hide smaller falls
        ([0.485], [True, True]),  # 3 %, of which half must be seen
        ([0.485, None], [True, True]),  # static friction alone keeps the fall set before
    ],
)
def test_fall_that_counts_as_slip_follows_dynamic_friction(
    finger: Finger, make_press: Callable[[Finger], Press], set_to: list[float | None], expected: list[bool]
) -> None:
    for mu_d in set_to:
        finger.set_friction(0.5, mu_d)
    rising = np.linspace(4.0, 4.8, 150).tolist()
    hands = {fall: copy.deepcopy(finger) for fall in (0.02, 0.05)}
    falls = [pull(make_press(hand), [*rising, *[4.8 * (1.0 - fall)] * 10])[-1] for fall, hand in hands.items()]
    assert [level == "slipping" for level in falls] == expected


def test_friction_against_rotation_is_learned_from_the_spin_before_a_turn_and_forgotten_with_the_contact(
    left: str, parse: Parse, wrench: Wrench
) -> None:
    finger = make_finger(left.replace("mu = 0.5", "mu = 0.5\nmu_rotation = 0.4"), parse)
    rotation, turned_s = finger.friction.rotation, T0 * 1e-9 + 1.0
    read_force(finger, wrench(T0, 10.0, (0.0, 0.0), 0.02))
    rotation.slip(turned_s)
    assert rotation.learned is None, "without an image no spin has a lever"
    finger.update_image(TactileSample(T0, None, FULL.ravel()))
    read_force(finger, wrench(T0 + MS, 10.0, (0.0, 0.0), 0.02))
    rotation.slip(turned_s)
    assert rotation.learned is not None
    read_force(finger, wrench(T0 + 2 * MS, 0.0))
    assert rotation.learned is None


def test_another_zero_of_a_sensor_ends_what_is_more_lenient_and_a_lost_pad_nothing(finger: Finger) -> None:
    teach(finger, 0.6)
    finger.disconnect_image()
    assert finger.friction.state.mu == pytest.approx(0.6)
    for tare in (finger.image.tare, finger.tare):
        tare.put(replace(tare.current, id=7))
        assert finger.friction.state.mu == 0.5
        teach(finger, 0.6)


def test_without_mu_and_torque_there_is_no_utilisation(left: str, parse: Parse) -> None:
    finger = make_finger(left.replace("mu = 0.5\n", ""), parse)
    state = read_force(finger, WrenchSample(T0, None, np.array((1.0, 0.0, -10.0)), None))
    assert (state.verdict.reasons, state.utilisation) == (("no_mu",), None)
    assert slip_body(finger, state)["model"] == "none"
