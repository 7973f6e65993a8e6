"""Faulty streams: the verdict becomes unknown, the fault is reported, and the stream is used again once it is well."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import MS, T0, NoisyFinger, Parse, make_finger, read_force, taxel_faults

from slipd.types.arrays import Array
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import Health


def test_F1_force_sensor_that_repeats_is_stuck_until_it_changes(noisy: NoisyFinger) -> None:
    noisy.look(8.0)
    assert noisy.read(8.0).verdict.level == "stable"
    for _ in range(60):
        noisy.send(np.array((0.1, 0.0, -8.0)), np.zeros(3))
    assert noisy.verdict == ("unknown", ("stuck",))
    assert noisy.conditions("wrench")[0][0] == Health.ERROR
    noisy.look(8.0)
    noisy.read(8.0)
    assert noisy.verdict == ("stable", ())
    assert noisy.conditions("wrench") == []


def test_repeats_are_accepted_with_stuck_after_0(make_noisy: Callable[..., NoisyFinger]) -> None:
    noisy = make_noisy("stuck_after = 0")
    noisy.look(8.0)
    for _ in range(70):
        noisy.send(np.array((0.1, 0.0, -8.0)), np.zeros(3))
    assert noisy.verdict[0] == "unknown", "its image is too old by now"
    noisy.look(8.0)
    noisy.send(np.array((0.1, 0.0, -8.0)), np.zeros(3))
    assert noisy.verdict == ("stable", ())


def test_F1_readings_out_of_range_are_garbage(make_noisy: Callable[..., NoisyFinger]) -> None:
    noisy = make_noisy("range_n = 100.0")
    noisy.look(8.0)
    for _ in range(5):
        noisy.read(500.0)
    assert noisy.verdict == ("unknown", ("garbage",))
    assert "out of range_n" in noisy.conditions("wrench")[0][1]


def test_F1_intermittent_stream_is_reported_and_used_while_it_runs(noisy: NoisyFinger) -> None:
    for _ in range(4):
        for _ in range(20):
            noisy.read(0.0)
        noisy.t_ns += 300 * MS
    noisy.read(0.0)
    assert noisy.verdict == ("no_contact", ())
    assert (Health.WARN, "it failed several times within 10 s") in noisy.conditions("wrench")


def test_T3_pad_that_repeats_while_the_force_moves_is_frozen(noisy: NoisyFinger) -> None:
    def freeze(counts: Array) -> None:
        counts[:] = 50.0

    noisy.hold(0.3, freeze)
    assert noisy.verdict == ("unknown", ("stuck", "rotation_unobserved"))
    assert (Health.ERROR, "its images repeat while the force moves: it hangs") in noisy.conditions("pad")
    noisy.hold(0.3)
    assert noisy.verdict == ("stable", ())


def test_T1_dead_taxel_is_masked_and_reported_within_a_second(noisy: NoisyFinger) -> None:
    def kill(counts: Array) -> None:
        counts[5] = 0.0

    noisy.hold(1.0, kill)
    assert noisy.finger.image is not None
    assert taxel_faults(noisy.finger) == {"dead": [5]}
    assert noisy.finger.image.pressure[5] > 0.3, "replaced by its neighbours"
    assert (Health.WARN, "taxels are masked: dead 5") in noisy.conditions("pad")
    assert noisy.verdict == ("stable", ())


def test_T1_taxel_at_full_scale_is_reported_as_saturated(make_noisy: Callable[..., NoisyFinger]) -> None:
    noisy = make_noisy(pad="full_scale = 4095.0\n")

    def saturate(counts: Array) -> None:
        counts[10] = 4095.0

    noisy.hold(1.2, saturate)
    assert noisy.finger.image is not None
    assert taxel_faults(noisy.finger) == {"saturated": [10]}


def test_T1_image_with_too_many_bad_taxels_is_not_used(make_noisy: Callable[..., NoisyFinger]) -> None:
    noisy = make_noisy(pad="full_scale = 4095.0\n")

    def saturate(counts: Array) -> None:
        counts[:8] = 4095.0

    noisy.hold(1.2, saturate)
    assert noisy.verdict == ("unknown", ("rotation_unobserved",))
    level, message = noisy.conditions("pad")[0]
    assert level == Health.ERROR
    assert message.startswith("too many taxels are masked")


@pytest.mark.parametrize(("force_n", "torque_nm"), [(3e38, 0.0), (-3e38, 0.0), (0.0, 3e38), (1e120, 1e120)])
@pytest.mark.parametrize("more", ["", "range_n = 80.0", "range_nm = 5.0"])
def test_F1_single_reading_beyond_any_sensor_is_garbage(
    make_noisy: Callable[..., NoisyFinger], force_n: float, torque_nm: float, more: str
) -> None:
    noisy = make_noisy(f"stuck_after = 0\n{more}")
    for _ in range(3):
        noisy.look(8.0)
        noisy.read(8.0)
        assert noisy.verdict == ("stable", ())
        noisy.send(np.array((0.0, 0.0, force_n - 8.0)), np.array((0.0, 0.0, torque_nm)))
        assert noisy.verdict == ("unknown", ("garbage",))
        level, message = noisy.finger.conditions("wrench", noisy.t_ns)[0]
        assert level == Health.ERROR
        assert "out of range_n or range_nm" in message
        for _ in range(40):
            noisy.read(8.0)


def test_tare_that_was_given_up_is_reported(right: str, parse: Parse) -> None:
    finger = make_finger(right, parse, "right")
    finger.begin_tare(T0, 0.1, "someone")
    finger.disconnect(T0)
    assert finger.conditions("pad", T0) == [(Health.OK, "the last tare was given up: the stream ended")]


def test_F2_status_of_the_device_shows_in_the_health_of_its_stream(noisy: NoisyFinger) -> None:
    reading = np.array((0.0, 0.0, -8.0)), np.zeros(3)
    read_force(noisy.finger, WrenchSample(T0, None, *reading, ("overload",)))
    assert noisy.conditions("wrench") == [(Health.ERROR, "the device reports: overload")]
    read_force(noisy.finger, WrenchSample(T0 + MS, None, *reading, ("skipped",)))
    assert noisy.conditions("wrench") == [(Health.WARN, "the device reports: skipped")]
    noisy.finger.update_image(TactileSample(T0, None, np.full(16, 50.0), ("saturated",)))
    assert noisy.conditions("pad") == [(Health.WARN, "the device reports: saturated")]


def test_image_marked_invalid_is_not_used(noisy: NoisyFinger) -> None:
    noisy.finger.update_image(TactileSample(T0, None, np.full(16, 50.0), ("invalid",)))
    noisy.read(8.0)
    assert noisy.verdict == ("unknown", ("rotation_unobserved",))
    assert noisy.conditions("pad") == [(Health.ERROR, "the device reports: invalid")]


def test_N1_readings_that_are_not_finite_are_reported_as_such(noisy: NoisyFinger) -> None:
    for _ in range(10):
        noisy.send(np.full(3, math.nan), np.zeros(3))
        assert noisy.verdict == ("unknown", ("not_finite",))
    assert noisy.conditions("wrench") == [(Health.ERROR, "its readings are not finite numbers")]
