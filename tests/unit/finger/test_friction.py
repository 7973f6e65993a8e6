"""Coefficients of friction: from the config or a request, and which ones are more lenient."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from finger_bench import MS, T0, Image, NoisyFinger, Parse, Wrench, make_finger, read_force, teach

from slipd.finger.finger import Finger
from slipd.publish.finger_messages import slip_body

RISING = np.linspace(4.0, 4.8, 150).tolist()
FALLS = {fall: [*RISING, *[4.8 * (1.0 - fall)] * 10] for fall in (0.02, 0.05)}


def levels(finger: Finger, wrench: Wrench, image: Image, pulls: Iterable[float]) -> list[str]:
    """Levels of readings 10 ms apart, pressed with 10 N and pulled."""
    reported = []
    for k, pull_n in enumerate(pulls):
        finger.update_image(image(T0 + k * 10 * MS))
        reported.append(read_force(finger, wrench(T0 + k * 10 * MS, 10.0, (pull_n, 0.0))).verdict.level)
    return reported


def test_mu_of_config_holds_until_a_request_sets_another(finger: Finger, wrench: Wrench, image: Image) -> None:
    assert (finger.friction.state.mu, finger.friction.state.source) == (0.5, "config")
    assert levels(finger, wrench, image, [4.5]) == ["warning"]
    finger.set_friction(1.0, None)
    assert (finger.friction.state.mu, finger.friction.state.source) == (1.0, "request")
    body = slip_body(finger, finger.state)
    assert (body["mu"], body["mu_source"]) == (0.5, "config"), "of the reading before the request"
    assert levels(finger, wrench, image, [4.5]) == ["stable"], "λ is 0.45 now"
    body = slip_body(finger, finger.state)
    assert (body["mu"], body["mu_source"]) == (1.0, "request")
    assert finger.state.utilisation.value == pytest.approx(0.45)


def test_request_sets_mu_where_config_has_none(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    finger = make_finger(left.replace("mu = 0.5\n", ""), parse)
    assert (finger.friction.state.mu, finger.friction.state.source) == (None, "none")
    assert levels(finger, wrench, image, [1.0]) == ["unknown"]
    finger.set_friction(0.5, None)
    assert (finger.friction.state.mu, finger.friction.state.source) == (0.5, "request")
    assert levels(finger, wrench, image, [1.0]) == ["stable"]


@pytest.mark.parametrize(
    ("mu_d", "expected"),
    [
        (None, [False, True]),  # as the config has it: 0.03
        (0.2, [False, True]),  # dynamic friction far below does not hide smaller falls
        (0.485, [True, True]),  # 3 %, of which half must be seen
    ],
)
def test_fall_that_counts_as_slip_follows_dynamic_friction(
    finger: Finger, wrench: Wrench, image: Image, mu_d: float | None, expected: list[bool]
) -> None:
    slips = []
    for fall in (0.02, 0.05):
        hand = copy.deepcopy(finger)
        hand.set_friction(0.5, mu_d)
        slips.append(levels(hand, wrench, image, FALLS[fall])[-1] == "slipping")
    assert slips == expected


def test_static_friction_alone_keeps_the_fall_set_before(finger: Finger, wrench: Wrench, image: Image) -> None:
    finger.set_friction(0.5, 0.485)
    finger.set_friction(0.5, None)
    assert finger.friction.drop == pytest.approx(0.5 * 0.03)
    assert levels(finger, wrench, image, FALLS[0.02])[-1] == "slipping"


def nothing(_: Finger) -> None:
    """What the config states holds."""


def slippery_before(finger: Finger) -> None:
    """A named object slipped, and another one is in the grip now."""
    finger.friction.set_object("soap")
    teach(finger, 0.3, slips=True)
    finger.friction.set_object("rubber")
    assert finger.friction.state.mu == 0.5


@pytest.mark.parametrize(
    ("stated", "before", "given", "lenient"),
    [
        *((True, nothing, given, False) for given in ((0.5, None), (0.4, None), (0.5, 0.4), (0.4, 0.1))),
        (True, nothing, (0.6, None), True),
        (False, nothing, (0.1, None), True),
        # a larger fall than one set before
        (True, lambda finger: finger.set_friction(0.5, 0.49), (0.5, 0.4), True),
        (True, lambda finger: finger.set_friction(0.5, 0.49), (0.5, 0.49), False),
        # what a grasp taught beyond the stated mu ends with it, what it taught below counts, and so does another object
        (True, lambda finger: teach(finger, 0.6), (0.55, None), True),
        (True, lambda finger: teach(finger, 0.6), (0.5, None), False),
        (True, lambda finger: teach(finger, 0.3, slips=True), (0.5, None), True),
        (True, lambda finger: teach(finger, 0.3, slips=True), (0.2, None), False),
        (False, lambda finger: teach(finger, 0.5, slips=True), (0.1, None), True),
        (True, slippery_before, (0.5, None), True),
        (True, slippery_before, (0.2, None), False),
    ],
)
def test_what_is_more_lenient(
    left: str,
    parse: Parse,
    stated: bool,
    before: Callable[[Finger], None],
    given: tuple[float, float | None],
    lenient: bool,
) -> None:
    finger = make_finger(left if stated else left.replace("mu = 0.5\n", ""), parse)
    before(finger)
    assert finger.friction.is_more_lenient(*given) is lenient


def test_a_grasp_whose_force_and_image_disagree_teaches_nothing_of_its_object(
    make_noisy: Callable[..., NoisyFinger],
) -> None:
    """Its readings were wrong already before that was noticed."""
    noisy = make_noisy(pad="gain_error = 0.05\n")
    friction = noisy.finger.friction
    noisy.finger.friction.set_object("mug")
    noisy.hold(0.3)
    teach(noisy.finger, 0.8)
    assert friction.state.mu == pytest.approx(0.8)
    noisy.hold(0.3, lambda counts: np.multiply(counts, 0.3, out=counts))
    assert noisy.verdict == ("unknown", ("disagreement", "disagreement_force"))
    assert (friction.state.mu, friction.state.object_name) == (0.5, "mug")
    noisy.send(np.zeros(3), np.zeros(3))
    assert friction.state.mu == 0.5, "the next grasp of the object begins with what is stated"
