"""Force sensor and image that contradict each other."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from finger_bench import MS, NoisyFinger, Press, read_force, verdict

from slipd.finger.finger import Finger
from slipd.types.arrays import Array
from slipd.types.samples import WrenchSample


def test_old_image_does_not_end_a_disagreement(finger: Finger, press: Press) -> None:
    corner = np.zeros((4, 4))
    corner[0, 0] = 400
    for _ in range(100):
        state = press(5.0, (0.1, 0.0), 0.0, (0.006, 0.006), counts=corner)
    state = press(5.0, (0.1, 0.0), 0.0, (0.006, 0.006), ms=25.0, counts=None)
    assert state.load_distribution is not None
    assert not finger.trust.newest
    finger.check_silence(state.t_ns + 6 * MS)
    assert not finger.trust.for_raise(state.t_ns + 6 * MS)
    assert verdict(finger.state) == verdict(state)


def test_F3_centroid_that_the_image_does_not_show_is_a_disagreement(noisy: NoisyFinger) -> None:
    noisy.hold(0.3)
    assert noisy.verdict == ("stable", ())
    noisy.hold(0.3, at_m=(0.005, 0.0))
    assert noisy.verdict == ("unknown", ("disagreement", "disagreement_centroid"))
    noisy.hold(0.5)
    assert noisy.verdict == ("stable", ())


def test_F3_force_that_a_calibrated_image_does_not_show_is_a_disagreement(
    make_noisy: Callable[..., NoisyFinger],
) -> None:
    noisy = make_noisy(pad="gain_error = 0.05\n")
    noisy.hold(0.3)
    assert noisy.verdict == ("stable", ())

    def halve(counts: Array) -> None:
        counts *= 0.3

    noisy.hold(0.3, halve)
    assert noisy.verdict == ("unknown", ("disagreement", "disagreement_force"))
    noisy.finger.disconnect_image()
    noisy.read(8.0)
    assert noisy.verdict == ("unknown", ("rotation_unobserved",)), "the comparison starts anew"


def test_force_without_torque_has_no_centroid_to_compare(noisy: NoisyFinger) -> None:
    for k in range(40):
        normal_n = 8.0 + 2.0 * math.sin(0.5 * k)
        noisy.t_ns += 10 * MS
        force = np.array((0.1, 0.0, -normal_n)) + noisy.rng.normal(0.0, 0.002, 3)
        noisy.state = read_force(noisy.finger, WrenchSample(noisy.t_ns, None, force, None))
        noisy.look(normal_n)
    assert noisy.verdict == ("unknown", ("rotation_unobserved",))
