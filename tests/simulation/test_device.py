"""Faults of the devices, group D: boot text, counters that jump, grippers in trouble."""

from __future__ import annotations

import struct

import pytest
from simulation.edits import gripper, rows_of, sealed
from simulation.faults import Drop, Edit, Text


def test_D1_boot_text_is_no_reading_and_no_harm(held):
    held.unplug("left.wrench")
    held.strike(Text(), "left.wrench")
    held.plug("left.wrench")
    held.run(0.5)
    assert held.level() == "unknown"
    held.strike(None, "left.wrench")
    held.plug("left.wrench")
    held.recover()
    assert held.replays()


def test_D3_a_gap_in_the_scans_is_counted(held):
    lost = held.health("left.pad")["lost"]
    held.struck("left.pad", Drop(held.rng), 0.1)
    held.run(0.01)
    assert held.health("left.pad")["lost"] - lost == pytest.approx(20, abs=2)
    assert held.health("left.pad")["restarts"] == 0


def test_D3_a_pad_that_restarts_its_count_is_reported_as_a_restart_and_loses_nothing_else(held):
    def restarted(data, _):
        frames = []
        for row in rows_of(data):
            (scan,) = struct.unpack_from("<H", row, 4)
            struct.pack_into("<H", row, 4, (scan - first) % 65_536)
            frames.append(sealed(row))
        return b"".join(frames)

    first, lost = held.said_ns // 5_000_000, held.health("left.pad")["lost"]
    held.strike(Edit(restarted, lies=False), "left.pad")
    held.run(0.2)
    assert (held.level(), held.health("left.pad")["restarts"]) == ("stable", 1)
    assert held.health("left.pad")["lost"] - lost <= 1


def test_D4_a_gripper_that_does_not_answer_is_not_moved(held):
    held.strike(Drop(held.rng), "gripper")
    held.run(0.5)
    held.ask("lease.acquire", ttl_ms=200)
    assert not held.ask("grip.set", force_n=10.0)["ok"]
    assert held.health("gripper")["health"] >= 1
    assert held.level() == "stable"
    held.strike(None, "gripper")
    held.run(0.5)
    assert held.ask("lease.acquire", ttl_ms=200)["ok"]
    assert held.ask("grip.set", force_n=10.0)["error"]["code"] == "fault_latched"
    assert held.ask("fault.ack")["result"] == {"fault": "no_answer"}
    assert held.ask("grip.set", force_n=10.0)["ok"]


def test_A6_a_command_that_never_reaches_the_gripper_is_reported(held):
    assert held.ask("lease.acquire", ttl_ms=200)["ok"]
    held.line("gripper").deaf = True
    held.ask("grip.set", force_n=10.0)
    held.run(0.5)
    assert held.health("gripper")["health"] >= 1
    assert not held.ask("grip.set", force_n=10.0)["ok"]


FAULT, ECHO = 2, 3
CODES = (5, 7, 8, 9, 10, 11, 12, 13, 14, 15)


def test_D4_every_fault_of_the_gripper_is_shown_and_refuses_what_moves_it(held):
    for code in CODES:
        held.strike(Edit(gripper(lambda status, code=code: status.__setitem__(FAULT, code)), lies=False), "gripper")
        held.run(0.06)
        held.ask("lease.acquire", ttl_ms=200)
        assert held.watch.gripper["fault"], code
        for refusal in ("fault_latched", "gripper_fault"):
            for op in ("grip.set", "gripper.close"):
                error = held.ask(op, force_n=9.0)["error"]
                assert error["code"] == refusal
                assert held.watch.gripper["fault"] in error["message"]
            assert held.ask("fault.ack")["ok"]
    held.strike(None, "gripper")
    held.run(0.06)
    assert held.watch.gripper["fault"] == ""
    assert held.ask("grip.set", force_n=9.0)["ok"]


def test_D5_a_gripper_that_echoes_another_command_is_reported_within_three_polls(held):
    wrong = Edit(gripper(lambda status: status.__setitem__(ECHO, status[ECHO] ^ 0x10)), lies=False)
    for fault, echo_ok in ((None, True), (wrong, False), (None, True)):
        held.strike(fault, "gripper")
        held.run(0.06)
        assert held.watch.gripper["echo_ok"] is echo_ok
