"""Faulty streams, and sensors that contradict each other: the verdict is unknown until all is well again."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import MS, T0, NoisyFinger, Parse, Press, make_finger, read_force, taxel_faults, verdict

from slipd.finger.finger import Finger
from slipd.finger.stream_health import finger_conditions
from slipd.types.arrays import Array
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import Health

STILL = np.array((0.1, 0.0, -8.0))
STABLE, UNSEEN = ("stable", ()), ("unknown", ("rotation_unobserved",))


@pytest.mark.parametrize("stuck_after", [None, 0])
def test_F1_force_sensor_that_repeats_is_stuck_until_it_changes_unless_it_may_rest(
    make_noisy: Callable[..., NoisyFinger], stuck_after: int | None
) -> None:
    noisy = make_noisy("" if stuck_after is None else f"stuck_after = {stuck_after}")
    for _ in range(61):
        noisy.look(8.0)
        noisy.send(STILL, np.zeros(3))
    stuck = stuck_after is None
    assert noisy.verdict == (("unknown", ("stuck",)) if stuck else STABLE)
    assert [level for level, _ in noisy.conditions("wrench")] == [Health.ERROR] * stuck
    noisy.read(8.0)
    assert (noisy.verdict, noisy.conditions("wrench")) == (STABLE, [])


def test_F1_intermittent_stream_is_reported_and_used_while_it_runs(noisy: NoisyFinger) -> None:
    for _ in range(4):
        for _ in range(20):
            noisy.read(0.0)
        noisy.t_ns += 300 * MS
    noisy.read(0.0)
    assert noisy.verdict == ("no_contact", ())
    assert (Health.WARN, "it failed several times within 10 s") in noisy.conditions("wrench")


@pytest.mark.parametrize(("force_n", "torque_nm"), [(500.0, 0.0), (-3e38, 0.0), (0.0, 3e38), (1e120, 1e120)])
@pytest.mark.parametrize("more", ["", "range_n = 80.0", "range_nm = 5.0"])
def test_F1_single_reading_beyond_the_sensor_is_garbage(
    make_noisy: Callable[..., NoisyFinger], force_n: float, torque_nm: float, more: str
) -> None:
    noisy = make_noisy(f"stuck_after = 0\nrange_n = 100.0\n{more}" if "range_n " not in more else more)
    for _ in range(3):
        noisy.look(8.0)
        noisy.read(8.0)
        assert noisy.verdict == STABLE
        noisy.send(np.array((0.0, 0.0, force_n - 8.0)), np.array((0.0, 0.0, torque_nm)))
        assert noisy.verdict == ("unknown", ("garbage",))
        level, message = noisy.conditions("wrench")[0]
        assert (level, "out of range_n or range_nm" in message) == (Health.ERROR, True)
        for _ in range(40):
            noisy.read(8.0)


@pytest.mark.parametrize(
    ("taxels", "counts", "masked", "verdict", "health"),
    [
        (slice(5, 6), 0.0, {"dead": [5]}, STABLE, (Health.WARN, "taxels are masked: dead 5")),
        (slice(10, 11), 4095.0, {"saturated": [10]}, STABLE, (Health.WARN, "taxels are masked: saturated 10")),
        (slice(8), 4095.0, {"row": [0, 1]}, UNSEEN, (Health.ERROR, "too many taxels are masked: row 0, 1")),
        (
            slice(16), 50.0, {}, ("unknown", ("stuck", "rotation_unobserved")),
            (Health.ERROR, "its images repeat while the force moves: it hangs"),
        ),
    ],
)  # fmt: skip
def test_T1_T3_bad_taxels_are_masked_and_a_pad_that_hangs_is_not_used(
    make_noisy: Callable[..., NoisyFinger], taxels: slice, counts: float, masked: dict[str, list[int]],
    verdict: tuple[str, tuple[str, ...]], health: tuple[Health, str],
) -> None:  # fmt: skip
    noisy = make_noisy(pad="full_scale = 4095.0\n")
    noisy.hold(1.2, lambda image: image.__setitem__(taxels, counts))
    assert (taxel_faults(noisy.finger), noisy.verdict) == (masked, verdict)
    ((level, text),) = noisy.conditions("pad")
    assert (level, text[: len(health[1])]) == health
    if verdict == STABLE:
        assert 0.3 < noisy.finger.image.pressure[taxels][0] < 1.0, "replaced by its neighbours"
    if not masked:
        noisy.hold(0.3)
        assert noisy.verdict == STABLE


def test_tare_that_was_given_up_is_reported(right: str, parse: Parse) -> None:
    finger = make_finger(right, parse, "right")
    finger.begin_tare(T0, 0.1, "someone")
    finger.disconnect(T0)
    assert finger_conditions(finger, "pad", T0) == [(Health.OK, "the last tare was given up: the stream ended")]


@pytest.mark.parametrize(
    ("word", "level", "used"),
    [("overload", Health.ERROR, False), ("invalid", Health.ERROR, False), ("skipped", Health.WARN, True)],
)
def test_F2_status_of_the_device_shows_in_the_health_of_its_stream(
    noisy: NoisyFinger, word: str, level: Health, used: bool
) -> None:
    for image, force in (((), (word,)), ((word,), ())):
        noisy.t_ns += MS
        noisy.finger.update_image(TactileSample(noisy.t_ns, None, np.full(16, 50.0), image))
        for batch in noisy.finger.decide([WrenchSample(noisy.t_ns, None, STILL, np.zeros(3), force)], [noisy.t_ns]):
            assert batch[-1].verdict.level == ("stable" if used else "unknown")
        for stream, words in (("pad", image), ("wrench", force)):
            assert noisy.conditions(stream) == ([(level, f"the device reports: {word}")] if words else [])


def test_N1_readings_that_are_not_finite_are_reported_as_such(noisy: NoisyFinger) -> None:
    for _ in range(10):
        noisy.send(np.full(3, math.nan), np.zeros(3))
        assert noisy.verdict == ("unknown", ("not_finite",))
    assert noisy.conditions("wrench") == [(Health.ERROR, "its readings are not finite numbers")]


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
