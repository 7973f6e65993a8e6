"""Faults of the force sensors, group F: off, stuck, wrong, slow, late or intermittent; overload; disagreement."""

from __future__ import annotations

import pytest
from simulation.bed import Bed, assert_sound
from simulation.edits import Frozen, wrench
from simulation.faults import Bursts, Drop, Edit

SKIPPED = 1
DISTRUSTED = {2: "overload", 4: "invalid", 8: "raw"}


@pytest.mark.parametrize("seed", [1])
def test_F1_a_sensor_that_is_off_is_reported_as_stale(held, seed):
    held.line("left.wrench").fault = Drop(held.rng)
    held.run(0.04)
    assert (held.level(), held.reasons()) == ("unknown", ["stale"])
    assert held.health("left.wrench")["health"] == 3
    assert held.level("right") == "stable"
    held.line("left.wrench").fault = None
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_F1_a_stuck_sensor_is_reported_within_100_ms(held, seed):
    held.line("left.wrench").fault = Edit(wrench(Frozen().reading))
    held.run(0.13)
    assert held.level() == "unknown"
    assert "stuck" in held.reasons()
    assert held.health("left.wrench")["health"] >= 1
    held.line("left.wrench").fault = None
    assert held.recovery_s("stable") <= 1.0


@pytest.mark.parametrize("seed", [1])
def test_F1_an_intermittent_sensor_is_never_trusted_in_its_gaps(held, seed):
    held.line("left.wrench").fault = Bursts(held.rng)
    held.run(1.0)
    assert "unknown" in {level for _, finger, level in held.watch.changes if finger == "left"}
    held.line("left.wrench").fault = None
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
def test_F1_a_slow_sensor_is_reported(held, seed):
    held.line("left.wrench").fault = Drop(held.rng, share=0.6)
    held.run(1.1)
    assert held.health("left.wrench")["health"] == 1
    assert "Hz instead of" in held.health("left.wrench")["message"]
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_F1_streams_that_fall_silent_one_after_the_other_are_each_noticed_in_time(held, seed):
    held.line("left.pad").fault = Drop(held.rng)
    held.run(0.015)
    held.line("left.wrench").fault = Drop(held.rng)
    held.run(0.04)
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("stream", ["left.wrench"])
def test_F1_no_grip_is_raised_on_a_stale_sensor(held, seed, stream):
    held.ask("lease.acquire", ttl_ms=200)
    held.line(stream).fault = Drop(held.rng)
    held.run(0.1)
    reply = held.ask("grip.set", force_n=10.0)
    assert not reply["ok"]
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_F2_a_reading_that_the_sensor_itself_distrusts_is_no_verdict(held, seed):
    for bit, reason in DISTRUSTED.items():
        held.line("left.wrench").fault = Edit(wrench(status=bit))
        held.run(0.05)
        assert held.level() == "unknown"
        assert reason in held.reasons()
        held.line("left.wrench").fault = None
        assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_F2_status_bits_of_the_sensor_show_in_the_health_of_its_stream(held, seed):
    for bit, reason in DISTRUSTED.items():
        held.line("left.wrench").fault = Edit(wrench(status=bit))
        held.run(0.05)
        assert held.health("left.wrench")["health"] >= 1
        assert reason in held.health("left.wrench")["message"]


@pytest.mark.parametrize("seed", [1])
def test_F2_a_status_that_leaves_the_reading_usable_changes_no_level(held, seed):
    held.line("left.wrench").fault = Edit(wrench(status=SKIPPED), lies=False)
    held.run(0.1)
    assert held.level() == "stable"
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_F3_a_force_sensor_that_disagrees_with_the_image_makes_the_verdict_unknown(held, seed):
    shift_nm = 0.12

    def shifted(six, _):
        return [*six[:3], six[3] + shift_nm, six[4] + shift_nm, six[5]]

    held.line("left.wrench").fault = Edit(wrench(shifted))
    held.run(0.5)
    assert held.level() == "unknown"
    assert "disagreement" in held.reasons()
    held.line("left.wrench").fault = None
    assert held.recovery_s("stable") <= 1.0


@pytest.mark.parametrize("seed", [1])
def test_F4_a_tare_in_contact_is_refused_and_changes_nothing(held, seed):
    before = held.watch.slip["left"]["tare_id"]
    reply = held.ask("tare", finger="left", seconds=0.1)
    assert (reply["ok"], reply["error"]["code"]) == (False, "in_contact")
    held.run(0.3)
    assert held.watch.slip["left"]["tare_id"] == before
    assert held.watch.slip["left"]["normal_n"] == pytest.approx(8.0, abs=0.3)
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_F4_a_tare_that_a_contact_interrupts_is_given_up(seed):
    bed = Bed(seed).free()
    before = bed.watch.slip["left"]["tare_id"]
    assert bed.ask("tare", finger="left", seconds=0.5)["ok"]
    bed.close()
    assert bed.watch.slip["left"]["tare_id"] == before
    assert bed.watch.slip["left"]["normal_n"] == pytest.approx(8.0, abs=0.3)
    assert_sound(bed)
