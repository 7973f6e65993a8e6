"""Whether something presses on the pad: yes, no, or unknown. Unknown is never reported as free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from finger_bench import EMPTY, FULL, MS, T0, Image, NoisyFinger, Parse, Press, Wrench, make_finger, read_force

from slipd.finger.finger import Finger
from slipd.types.samples import TactileSample, WrenchSample


class TestIsPressed:
    """Whether something presses: unknown is not free."""

    def tared(self, finger: Finger, wrench: Wrench, *, t_ns: int = T0 - 100 * MS) -> None:
        finger.begin_tare(t_ns, 0.01, "someone")
        for k in range(20):
            read_force(finger, wrench(t_ns + k * MS, 0.0))
        assert finger.tare.current.id == 1

    def test_unknown_before_the_first_reading(self, finger: Finger) -> None:
        assert finger.presence.is_pressed() is None

    def test_force_sensor_without_tare_does_not_count(self, untared: Finger, wrench: Wrench, image: Image) -> None:
        for normal_n in (0.0, 30.0):
            read_force(untared, wrench(T0, normal_n))
            assert untared.presence.is_pressed() is None
        untared.image.tare.observe(T0)
        for counts, pressed in ((EMPTY, False), (FULL, True)):
            untared.update_image(image(T0, counts))
            assert untared.presence.is_pressed() is pressed, "the pad with a known zero counts"

    def test_tared_force_sensor_counts(self, finger: Finger, wrench: Wrench) -> None:
        self.tared(finger, wrench)
        read_force(finger, wrench(T0, 0.1))
        assert finger.presence.is_pressed() is False
        read_force(finger, wrench(T0, 5.0))
        assert finger.presence.is_pressed() is True

    def test_fresh_image_counts_by_itself(self, finger: Finger, press: Press) -> None:
        press(0.0, counts=EMPTY)
        assert finger.presence.is_pressed() is False
        press(0.0, counts=FULL)
        assert finger.presence.is_pressed() is True

    def test_old_image_does_not_count(self, untared: Finger, wrench: Wrench, image: Image) -> None:
        untared.image.tare.observe(T0)
        untared.update_image(image(T0, EMPTY))
        read_force(untared, wrench(T0 + 31 * MS, 0.0))
        assert untared.presence.is_pressed() is None

    def test_image_overrides_a_force_sensor_that_reads_no_contact(
        self, finger: Finger, press: Press, wrench: Wrench
    ) -> None:
        self.tared(finger, wrench)
        press(0.1, counts=FULL)
        assert finger.presence.is_pressed() is True

    def test_finger_is_not_free_while_its_force_sensor_is_silent(self, finger: Finger, wrench: Wrench) -> None:
        self.tared(finger, wrench)
        read_force(finger, wrench(T0, 0.0))
        finger.disconnect(T0 + 100 * MS)
        assert finger.presence.is_pressed() is None

    @pytest.mark.parametrize(("normal_n", "known"), [(5.0, True), (0.0, None)])
    def test_overloaded_sensor_never_shows_a_free_finger(
        self, finger: Finger, wrench: Wrench, normal_n: float, known: bool | None
    ) -> None:
        self.tared(finger, wrench)
        read_force(finger, wrench(T0, normal_n))
        read_force(finger, wrench(T0 + MS, 0.0, status=("overload",)))
        assert finger.presence.is_pressed() is known

    def test_charge_pad_held_at_zero_by_the_force_sensor_does_not_count(
        self, left: str, parse: Parse, wrench: Wrench, image: Image
    ) -> None:
        text = left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0")
        finger = make_finger(text, parse, zeros=False)
        for k in range(5):
            read_force(finger, wrench(T0 + 10 * k * MS, 0.0))
            finger.update_image(image(T0 + 10 * k * MS, FULL))
        assert finger.presence.is_pressed() is None

    def test_three_axis_taxels_count_once_tared(self, right: str, parse: Parse) -> None:
        rest, press = np.full((4, 3), 1000.0), np.tile((1000.0, 1000.0, 3000.0), (4, 1))
        for text, known in ((right, [False, True]), (right.partition("tare =")[0], [None, None])):
            finger = make_finger(text, parse, "right", zeros=False)
            found = []
            for k, counts in enumerate((rest, press)):
                finger.update_image(TactileSample(T0 + k * MS, None, counts, source="2"))
                found.append(finger.presence.is_pressed())
            assert found == known


@pytest.mark.parametrize("normal_n", [0.0, 0.3])
def test_finger_is_not_free_while_its_weight_may_hide_a_contact(
    make_noisy: Callable[..., NoisyFinger], normal_n: float
) -> None:
    noisy = make_noisy("mass_kg = 0.1\n")
    noisy.finger.begin_tare(noisy.t_ns, 0.01, "someone")
    for _ in range(20):
        noisy.read(0.0)
    assert noisy.finger.tare.current.id == 1
    noisy.read(normal_n)
    assert noisy.verdict == ("unknown", ("weight_unknown",))
    assert noisy.finger.presence.is_pressed() is None
    force = noisy.finger.force
    force.set_gravity([0.0, 0.0, -9.8], noisy.t_ns)
    force.begin_tare(noisy.t_ns, 0.01, "someone")
    for _ in range(20):
        noisy.read(0.0)
    assert noisy.verdict == ("no_contact", ())
    assert noisy.finger.presence.is_pressed() is False
    force.gravity.forget()
    noisy.read(normal_n)
    assert noisy.verdict == ("unknown", ("weight_unknown",)), "after the host slept, the orientation is unknown"


def test_free_finger_of_unknown_weight_is_free_where_its_pad_shows_that(
    make_noisy: Callable[..., NoisyFinger],
) -> None:
    hidden = ("unknown", ("weight_unknown",))
    for pad, expected in (("", hidden), (f"tare = {[0.0] * 16}\n", ("no_contact", ()))):
        noisy = make_noisy("mass_kg = 0.1\n", pad)
        noisy.finger.image.tare.put(replace(noisy.finger.image.tare.current, origin="config"))
        noisy.finger.begin_tare(noisy.t_ns, 0.01, "someone")
        for _ in range(20):
            noisy.read(0.0)
        noisy.look(0.0)
        noisy.read(0.2)
        assert noisy.verdict == expected, "a pad that was never tared shows nothing"
        assert noisy.finger.presence.is_pressed() is (False if pad else None)
        noisy.look(2.0)
        noisy.read(0.0)
        assert noisy.verdict == hidden, "the weight may hide what the pad shows"
        noisy.look(0.0)
        for _ in range(200):
            noisy.read(0.0)
        assert noisy.verdict == hidden, "the image is too old"


def test_held_load_that_the_pad_does_not_show_is_not_drift(make_noisy: Callable[..., NoisyFinger]) -> None:
    noisy = make_noisy("drift_tau_s = 20.0\n")
    force = noisy.finger.force
    for _ in range(1200):
        noisy.t_ns += 99 * MS
        noisy.read(1.5)
        noisy.look(0.0)
    assert force.drift.value[2] == pytest.approx(0.0, abs=0.01)
    assert noisy.verdict[1][0] == "disagreement"


def test_drift_is_learned_while_untouched_with_and_without_image(left: str, parse: Parse) -> None:
    text = left.replace('port = "/dev/left-wrench"', 'port = "/dev/left-wrench"\ndrift_tau_s = 1.0')
    finger = make_finger(text, parse)
    for ms in range(0, 200_000, 100):
        finger.update_image(TactileSample(T0 + ms * MS, None, np.zeros(16)))
        read_force(finger, WrenchSample(T0 + ms * MS, None, np.array((0.2, 0.0, 0.0)), np.zeros(3)))
    assert finger.force.drift.value[0] == pytest.approx(0.2, abs=0.01)
    alone = make_finger(text, parse)
    for ms in range(0, 200_000, 100):
        read_force(alone, WrenchSample(T0 + ms * MS, None, np.array((0.2, 0.0, 0.0)), np.zeros(3)))
    assert alone.force.drift.value[0] == pytest.approx(0.2, abs=0.01)


def test_contact_force_is_that_of_a_tared_and_trusted_sensor(
    finger: Finger, untared: Finger, press: Press, wrench: Wrench
) -> None:
    assert untared.presence.contact_force_n(read_force(untared, wrench(T0, 5.1)).t_ns) is None, (
        "without a tare it may be bias"
    )
    press(0.0)
    finger.begin_tare(T0, 0.05, "someone")
    for k in range(10):
        press(0.01 * k, counts=EMPTY)
    assert finger.tare.current.id == 1
    assert finger.presence.contact_force_n(press(0.0, counts=EMPTY).t_ns) is None
    t_ns = press(5.0).t_ns
    assert finger.presence.contact_force_n(t_ns) == pytest.approx(5.0, abs=0.1)
    assert finger.presence.contact_force_n(t_ns + 51 * MS) is None, "too old"
