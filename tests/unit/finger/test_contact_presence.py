"""Whether something presses on the pad: yes, no, or unknown. Unknown is never reported as free."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import EMPTY, FULL, Press, make_finger, read_force
from fixture_types import Image, Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.types.samples import TactileSample


@pytest.mark.parametrize(
    ("force_known", "pad_known", "normal_n", "counts", "age_ms", "known"),
    [
        (True, True, 0.1, EMPTY, 0, (False, False, False, False, False, True, True)),
        (True, True, 5.0, EMPTY, 0, (True, True, True, True, True, False, True)),
        # the image overrides a force sensor that reads no contact, but an old one does not
        (True, True, 0.1, FULL, 0, (True, False, True, False, True, False, False)),
        (True, True, 0.1, FULL, 31, (False, False, False, False, False, True, False)),
        # an untared force sensor reads its own bias: the pad counts
        (False, True, 30.0, EMPTY, 0, (False, None, False, None, False, None, True)),
        (False, True, 0.0, FULL, 0, (True, None, True, None, True, None, False)),
        (False, True, 0.0, EMPTY, 31, (*(None,) * 6, False)),
        (False, False, 0.0, EMPTY, 0, (*(None,) * 6, False)),
        (False, False, 30.0, FULL, 0, (*(None,) * 6, False)),
    ],
)
def test_what_presses_by_force_and_image(
    untared: Finger, wrench: Wrench, image: Image, force_known: bool, pad_known: bool, normal_n: float,
    counts: np.ndarray, age_ms: int, known: tuple[bool | None, ...],
) -> None:  # fmt: skip
    assert untared.presence.is_pressed() is None, "before the first reading"
    for channel, has_zero in ((untared.force, force_known), (untared.image, pad_known)):
        if has_zero:
            channel.tare.observe(T0)
    untared.update_image(image(T0, counts))
    read_force(untared, wrench(T0 + age_ms * MS, normal_n))
    found = (
        untared.presence.is_pressed(),
        untared.presence.is_pressed_by_force(),
        untared.presence.is_pressed_without({"wrench": 0}),
        untared.presence.is_pressed_without({"pad": 0}),
        untared.presence.is_pressed_without({"wrench": 0, "pad": 0}),
        untared.presence.may_learn_zero(disagreement=False),
        untared.presence.is_free_by_image(),
    )
    assert found == known
    assert untared.presence.may_learn_zero(disagreement=True) is None


def test_without_a_pad_the_force_alone_shows_a_contact(left: str, parse: Parse, wrench: Wrench) -> None:
    padless = make_finger(left.partition("[finger.left.pad]")[0], parse)
    for normal_n, pressed in ((5.0, True), (0.1, False)):
        read_force(padless, wrench(T0, normal_n))
        found = padless.presence.is_pressed(), padless.presence.is_pressed_without({"wrench": 0})
        assert found == (pressed, pressed)
        assert not padless.presence.is_free_by_image()


@pytest.mark.parametrize(("normal_n", "known"), [(5.0, True), (0.0, None)])
def test_silent_or_overloaded_sensor_never_shows_a_free_finger(
    finger: Finger, wrench: Wrench, normal_n: float, known: bool | None
) -> None:
    read_force(finger, wrench(T0, normal_n))
    read_force(finger, wrench(T0 + MS, 0.0, status=("overload",)))
    assert finger.presence.is_pressed() is known
    finger.disconnect(T0 + 100 * MS)
    assert finger.presence.is_pressed() is None


def test_three_axis_taxels_count_once_tared(right: str, parse: Parse) -> None:
    rest, press = np.full((4, 3), 1000.0), np.tile((1000.0, 1000.0, 3000.0), (4, 1))
    for text, known in ((right, [False, True]), (right.partition("tare =")[0], [None, None])):
        finger = make_finger(text, parse, "right", zeros=False)
        found = []
        for k, counts in enumerate((rest, press)):
            finger.update_image(TactileSample(T0 + k * MS, None, counts, source="2"))
            found.append(finger.presence.is_pressed())
        assert found == known


def test_contact_force_is_that_of_a_sensor_with_a_known_zero_that_is_trusted(
    finger: Finger, untared: Finger, press: Press, wrench: Wrench
) -> None:
    read_force(untared, wrench(T0, 5.1))
    assert untared.presence.contact_force_n(T0) is None, "without a tare it may be bias"
    assert finger.presence.contact_force_n(press(0.0, counts=EMPTY).t_ns) is None
    t_ns = press(5.0).t_ns
    found = [finger.presence.contact_force_n(t_ns + later_ns) for later_ns in (0, 51 * MS)]
    assert found == [pytest.approx(5.0, abs=0.1), None], "too old"


def test_charge_pad_held_at_zero_by_the_force_sensor_does_not_count(
    left: str, parse: Parse, make_press: Callable[[Finger], Press]
) -> None:
    finger = make_finger(left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0"), parse, zeros=False)
    press = make_press(finger)
    for _ in range(5):
        press(0.0)
    assert finger.presence.is_pressed() is None
