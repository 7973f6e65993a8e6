"""Faults of the lines, group L: bytes that arrive split, noisy, bunched, late, in excess or not at all."""

from __future__ import annotations

import pytest
from simulation.bed import READY_S, Bed, assert_sound
from simulation.faults import Bunch, Chain, Drop, Flood, Garbage, Noise, Split, Trickle
from simulation.size import size_of

STREAMS = ("left.wrench", "left.pad")


@pytest.mark.parametrize("seed", [1])
def test_L1_a_split_stream_gives_the_same_as_a_whole_one(seed):
    whole, torn = Bed(seed), Bed(seed)
    for line in torn.lines.values():
        line.fault = Split(torn.rng)
    for bed in (whole, torn):
        bed.hold()
    assert torn.watch.changes == whole.watch.changes
    assert [stream["bad_bytes"] for stream in torn.watch.status["streams"].values()] == [0] * 5
    assert_sound(torn)
    assert torn.replays()


@pytest.mark.parametrize("seed", [1, 2])
def test_L2_L4_noise_on_every_line_is_counted_and_never_believed(held, seed):
    for line in held.lines.values():
        line.fault = Noise(held.rng, per_thousand=3.0)
    held.run(0.5)
    assert all(held.health(stream)["health"] >= 1 for stream in STREAMS)
    assert all(held.health(stream)["bad_bytes"] > 0 for stream in STREAMS)
    for line in held.lines.values():
        line.fault = None
    for finger in ("left", "right"):
        assert held.recovery_s("stable", finger) <= 1.0
    assert {level for _, _, level in held.watch.changes[-20:]} <= {
        "stable",
        "unknown",
        "no_contact",
        "warning",
        "slipping",
    }
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
def test_L3_L4_a_wrong_baud_rate_is_no_reading(held, seed):
    for stream in STREAMS:
        held.line(stream).fault = Garbage(held.rng)
        held.run(0.3)
        assert held.level() == "unknown"
        assert held.health(stream)["health"] >= 1
        assert held.health(stream)["message"]
        held.line(stream).fault = None
        assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_L5_L6_an_unplugged_sensor_is_reported_at_once_and_read_again_when_it_is_back(held, seed):
    for stream in STREAMS:
        held.unplug(stream)
        assert held.level() == "unknown" or stream == "left.pad"
        held.run(0.03)
        assert held.level() == "unknown"
        assert held.health(stream)["health"] == 2
        assert held.health(stream)["message"] == "unplugged"
        assert held.level("right") == "stable"
        held.plug(stream)
        assert held.recovery_s("stable") <= 1.0
        assert held.health(stream)["reconnects"] == 1
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
def test_L6_another_device_on_the_path_is_refused(seed):
    bed = Bed(seed, streams={"left.wrench": 'hardware_id = "S/N 2"'})
    for line in bed.lines.values():
        bed.plug(line.link)
    bed.run(READY_S)
    assert bed.ask("tare", finger="right", seconds=0.1)["ok"]
    bed.run(0.5)
    assert bed.level() == "unknown"
    assert bed.health("left.wrench")["health"] == 2
    assert bed.level("right") == "no_contact"
    assert_sound(bed)


@pytest.mark.parametrize("seed", [1])
def test_L7_a_port_that_cannot_be_opened_is_reported_and_the_other_links_go_on(held, seed):
    held.unplug("left.wrench", "no such file or directory")
    for _ in range(5):
        held.run(0.05)
        held.unplug("left.wrench", "permission denied")
    assert held.health("left.wrench")["message"] == "permission denied"
    assert (held.level(), held.level("right")) == ("unknown", "stable")
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_L9_a_flood_is_counted_and_costs_no_memory(held, seed):
    held.run(0.2)
    before = size_of(held.engine)
    for stream in STREAMS:
        held.line(stream).fault = Flood(held.rng)
    held.run(0.6)
    assert size_of(held.engine) < before + 64_000
    assert all(held.health(stream)["health"] == 1 for stream in STREAMS)
    for stream in STREAMS:
        held.line(stream).fault = None
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_L11_a_trickle_of_bytes_is_no_stream(held, seed):
    for stream in STREAMS:
        held.line(stream).fault = Trickle()
        held.run(0.1)
        assert held.level() == "unknown"
        assert held.health(stream)["health"] == 3
        held.line(stream).fault = None
        assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_L5_a_frame_cut_by_an_unplug_is_not_completed_afterwards(held, seed):
    held.line("left.pad").fault = Drop(held.rng)
    held.run(0.05)
    held.unplug("left.pad")
    held.line("left.pad").fault = None
    held.plug("left.pad")
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_L12_reads_bunched_to_16_ms_keep_the_verdict(held, seed):
    for line in held.lines.values():
        line.fault = Chain([Bunch(), Split(held.rng, most=400)])
    held.watch.lateness_ns = Bunch.period_ns
    changes = len(held.watch.changes)
    held.run(0.5)
    assert held.watch.changes[changes:] == []
    assert held.level() == "stable"
    assert_sound(held)
