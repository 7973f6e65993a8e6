"""Faults of the lines, group L: bytes that arrive split, noisy, bunched, late, in excess or not at all."""

from __future__ import annotations

import pytest
from simulation.bed import READY_S, Bed
from simulation.faults import Flood, Noise, Split

STREAMS = ("left.wrench", "left.pad")


def test_L1_a_split_stream_gives_the_same_as_a_whole_one():
    whole, torn = Bed(1), Bed(1)
    torn.strike(Split(torn.rng))
    for bed in (whole, torn):
        bed.hold()
    assert torn.watch.changes == whole.watch.changes
    assert [stream["bad_bytes"] for stream in torn.watch.status["streams"].values()] == [0] * 5
    assert torn.watch.faults == []
    assert torn.replays()


@pytest.mark.parametrize("seed", [1, 2])
def test_L2_L4_noise_on_every_line_is_counted_and_never_believed(held):
    held.strike(Noise(held.rng, per_thousand=3.0))
    held.run(0.5)
    for stream in STREAMS:
        assert held.health(stream)["health"] >= 1
        assert held.health(stream)["bad_bytes"] > 0
    held.recover()
    levels = {level for _, _, level in held.watch.changes[-20:]}
    assert levels <= {"stable", "unknown", "no_contact", "warning", "slipping"}
    assert held.replays()


@pytest.mark.parametrize("stream", STREAMS)
def test_L5_L6_an_unplugged_sensor_is_reported_at_once_and_read_again_when_it_is_back(held, stream):
    held.unplug(stream)
    assert held.level() == ("stable" if stream == "left.pad" else "unknown")
    held.run(0.03)
    assert (held.level(), held.level("right")) == ("unknown", "stable")
    assert (held.health(stream)["health"], held.health(stream)["message"]) == (2, "unplugged")
    held.plug(stream)
    held.recover()
    assert held.health(stream)["reconnects"] == 1
    assert held.replays()


def test_L6_another_device_on_the_path_is_refused():
    bed = Bed(1, streams={"left.wrench": 'hardware_id = "S/N 2"'})
    for line in bed.lines.values():
        bed.plug(line.link)
    bed.run(READY_S)
    assert bed.ask("tare", finger="right", seconds=0.1)["ok"]
    bed.run(0.5)
    assert (bed.level(), bed.health("left.wrench")["health"], bed.level("right")) == ("unknown", 2, "no_contact")
    assert bed.watch.faults == []


def test_L7_a_port_that_cannot_be_opened_is_reported_and_the_other_links_go_on(held):
    held.unplug("left.wrench", "no such file or directory")
    for _ in range(5):
        held.run(0.05)
        held.unplug("left.wrench", "permission denied")
    assert held.health("left.wrench")["message"] == "permission denied"
    assert (held.level(), held.level("right")) == ("unknown", "stable")


def test_L9_a_flood_is_counted(held):
    held.strike(Flood(held.rng), *STREAMS)
    held.run(0.6)
    assert [held.health(stream)["health"] for stream in STREAMS] == [1, 1]
    held.recover()
