"""Faults of the devices, group D: boot text, counters that jump, grippers in trouble."""

from __future__ import annotations

import struct

import pytest
from simulation.bed import assert_sound
from simulation.edits import gripper, pad, wrench
from simulation.faults import Drop, Edit, Text

from slipd.devices.shared import checksums


@pytest.mark.parametrize("seed", [1])
def test_D1_boot_text_is_no_reading_and_no_harm(held, seed):
    held.unplug("left.wrench")
    held.line("left.wrench").fault = Text()
    held.plug("left.wrench")
    held.run(0.5)
    assert held.level() == "unknown"
    held.line("left.wrench").fault = None
    held.plug("left.wrench")
    assert held.recovery_s("stable") <= 1.0
    assert_sound(held)
    assert held.replays()


@pytest.mark.parametrize("seed", [1])
def test_D2_another_version_of_the_format_is_no_reading(held, seed):
    def newer(data, _):
        frames = [bytearray(data[at : at + 46]) for at in range(0, len(data), 46)]
        for frame in frames:
            frame[2] = 2
            frame[44:] = checksums.x25(bytes(frame[2:44])).to_bytes(2, "little")
        return b"".join(frames)

    held.line("left.pad").fault = Edit(newer)
    held.run(0.1)
    assert held.level() == "unknown"
    assert held.health("left.pad")["health"] >= 1
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_D3_a_gap_in_the_scans_is_counted(held, seed):
    lost = held.health("left.pad")["lost"]
    held.line("left.pad").fault = Drop(held.rng)
    held.run(0.1)
    held.line("left.pad").fault = None
    assert held.recovery_s("stable") <= 1.0
    held.run(0.01)
    assert held.health("left.pad")["lost"] - lost == pytest.approx(20, abs=2)
    assert held.health("left.pad")["restarts"] == 0
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_D3_a_pad_that_restarts_its_count_is_reported_as_a_restart_and_loses_nothing_else(held, seed):
    def restarted(data, _):
        frames = []
        for at in range(0, len(data), 46):
            frame = bytearray(data[at : at + 44])
            (scan,) = struct.unpack_from("<H", frame, 4)
            struct.pack_into("<H", frame, 4, (scan - first) % 65_536)
            frames += bytes(frame), checksums.x25(bytes(frame[2:])).to_bytes(2, "little")
        return b"".join(frames)

    first = held.said_ns // 5_000_000
    lost = held.health("left.pad")["lost"]
    held.line("left.pad").fault = Edit(restarted, lies=False)
    held.run(0.2)
    assert held.level() == "stable"
    assert held.health("left.pad")["restarts"] == 1
    assert held.health("left.pad")["lost"] - lost <= 1
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_D4_a_gripper_that_does_not_answer_is_not_moved(held, seed):
    held.line("gripper").fault = Drop(held.rng)
    held.run(0.5)
    reply = held.ask("lease.acquire", ttl_ms=200)
    reply = held.ask("grip.set", force_n=10.0)
    assert not reply["ok"]
    assert held.health("gripper")["health"] >= 1
    assert held.level() == "stable"
    held.line("gripper").fault = None
    held.run(0.5)
    assert held.ask("lease.acquire", ttl_ms=200)["ok"]
    assert held.ask("grip.set", force_n=10.0)["error"]["code"] == "fault_latched"
    assert held.ask("fault.ack")["result"] == {"fault": "no_answer"}
    assert held.ask("grip.set", force_n=10.0)["ok"]
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_A6_a_command_that_never_reaches_the_gripper_is_reported(held, seed):
    assert held.ask("lease.acquire", ttl_ms=200)["ok"]
    held.line("gripper").deaf = True
    held.ask("grip.set", force_n=10.0)
    held.run(0.5)
    assert held.health("gripper")["health"] >= 1
    assert not held.ask("grip.set", force_n=10.0)["ok"]
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_D3_readings_that_come_twice_change_nothing(held, seed):
    held.line("left.pad").fault = Edit(lambda data, _: data + data, lies=False)
    held.run(0.2)
    assert held.level() == "stable"
    held.line("left.wrench").fault = Edit(lambda data, _: wrench()(data, 0), lies=False)
    held.line("left.pad").fault = Edit(pad(), lies=False)
    held.run(0.1)
    assert held.level() == "stable"
    assert_sound(held)


FAULT, ECHO = 2, 3
CODES = (5, 7, 8, 9, 10, 11, 12, 13, 14, 15)


@pytest.mark.parametrize("seed", [1])
def test_D4_every_fault_of_the_gripper_is_shown_and_refuses_what_moves_it(held, seed):
    for code in CODES:
        held.line("gripper").fault = Edit(
            gripper(lambda status, code=code: status.__setitem__(FAULT, code)), lies=False
        )
        held.run(0.06)
        held.ask("lease.acquire", ttl_ms=200)
        assert held.watch.gripper["fault"], code
        for refusal in ("fault_latched", "gripper_fault"):
            for op in ("grip.set", "gripper.close"):
                reply = held.ask(op, force_n=9.0)
                assert (reply["ok"], reply["error"]["code"]) == (False, refusal)
                assert held.watch.gripper["fault"] in reply["error"]["message"]
            assert held.ask("fault.ack")["ok"]
    held.line("gripper").fault = None
    held.run(0.06)
    assert held.watch.gripper["fault"] == ""
    assert held.ask("grip.set", force_n=9.0)["ok"]
    assert_sound(held)


@pytest.mark.parametrize("seed", [1])
def test_D5_a_gripper_that_echoes_another_command_is_reported_within_three_polls(held, seed):
    assert held.watch.gripper["echo_ok"] is True
    held.line("gripper").fault = Edit(gripper(lambda status: status.__setitem__(ECHO, status[ECHO] ^ 0x10)), lies=False)
    held.run(0.06)
    assert held.watch.gripper["echo_ok"] is False
    held.line("gripper").fault = None
    held.run(0.06)
    assert held.watch.gripper["echo_ok"] is True
    assert_sound(held)
