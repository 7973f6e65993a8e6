"""The WSG session with its emulator: what it asks and reads, its ranges, and the force on one pad."""

from __future__ import annotations

import math
from itertools import permutations

import pytest
from readings import Case, fields
from wsg_bench import GO, Bench, updates

from slipd.devices.shared.weiss_packets import Packet
from slipd.devices.wsg import Decoder, Session
from slipd.devices.wsg import wsg_messages as wire
from slipd.tools.sim import emulated_wsg as sim

ASKED = [wire.SYSTEM, wire.LIMITS, wire.OVERDRIVE, *wire.UPDATES]


@pytest.mark.parametrize("lost", [None, *ASKED])
def test_starting_sends_queries_and_repeats_one_that_is_lost_alone_and_moves_nothing(lost: int | None) -> None:
    bench = Bench(Session(overdrive=True))
    bench.swallow = lambda packet: packet.id == lost and bench.commands(all_ids=True).count(lost) == 1
    bench.start().run(2.0)
    assert bench.commands(all_ids=True) == [each for each in ASKED for _ in range(1 + (each == lost))]
    assert (bench.session.state, bench.session.identity) == ("active (overdrive)", "S/N 4711")
    assert bench.session.stop() == bytes.fromhex("AA AA AA 07 00 00 35 4C")
    assert (bench.session.state, bench.session.next_deadline(), bench.session.identity) == ("closed", None, "")


def test_updates_arrive_at_the_period_in_complete_rounds(bench: Bench) -> None:
    bench.samples.clear()
    bench.run(1.0)
    assert (len(bench.samples), bench.session.health.lost, bench.session.health.bad) == (50, 0, 0)
    last = bench.last
    assert (last.width_m, last.active, last.fault, last.echo_ok, last.current_a) == (0.06, True, "", None, None)


def test_warnings_of_the_gripper_follow_its_state(bench: Bench) -> None:
    bench.gripper.words |= {"temperature_warning", "script_running"}
    assert bench.run(0.1).session.state == "active (temperature_warning, script_running)"
    assert bench.last.fault == ""


def test_the_ranges_are_those_of_the_gripper_on_one_pad(bench: Bench) -> None:
    session = bench.session
    assert session.width_range_m == (0.0, pytest.approx(0.110))
    assert session.speed_range_mps == (pytest.approx(0.005), pytest.approx(0.420))
    assert session.force_range_n == (2.5, 40.0), "up to the nominal force, not the overdrive"
    assert not bench.gripper.overdrive
    session.stop()
    ranges = session.width_range_m, session.speed_range_mps, session.force_range_n
    assert ranges == ((0.0, math.inf), None, (0.0, math.inf))


def test_forces_above_the_nominal_one_need_the_option_and_the_command() -> None:
    bench = Bench(Session(overdrive=True)).start()
    assert bench.session.force_range_n == (2.5, 60.0)
    assert (bench.move(0.02, None, 55.0), bench.gripper.limit) == (55.0, 110.0)


def test_a_move_sets_the_force_before_it_goes_and_reads_it_back(bench: Bench) -> None:
    assert bench.move(0.02, None, 10.0, 0.5) == 10.0
    assert bench.commands() == list(GO)
    assert sim.parse_goal(bench.sent[1].payload) == (0, 20.0, 210.0)
    assert (bench.last.width_m, bench.last.object, bench.last.echo_ok) == (pytest.approx(0.02), "none", True)


def test_the_force_on_one_pad_is_half_of_what_the_gripper_receives_and_sends(holding: Bench) -> None:
    assert (holding.gripper.limit, holding.last.force_n) == (20.0, 10.0)
    assert holding.set_force(15.0) == 15.0
    assert holding.sent[0] == Packet(wire.SET_FORCE, wire.set_force(30.0)[6:-2])
    assert (holding.gripper.limit, holding.last.force_n) == (30.0, 15.0)


def test_a_force_while_holding_clamps_again_with_the_goal_that_made_the_grip(holding: Bench) -> None:
    holding.set_force(12.0, 0.3)
    assert holding.commands() == list(GO)
    assert sim.parse_goal(holding.sent[1].payload) == (0, 0.0, 200.0)
    assert (holding.last.width_m, holding.last.object) == (0.04, "contact_closing")


def test_a_force_after_a_restart_of_the_daemon_sets_the_limit_alone(holding: Bench) -> None:
    holding.write(holding.session.stop())
    holding.start()
    holding.sent.clear()
    assert (holding.session.force_sent_n, holding.set_force(12.0, 0.3)) == (None, 12.0)
    assert holding.commands() == [wire.SET_FORCE, wire.GET_FORCE]
    assert (holding.last.width_m, holding.last.force_n) == (0.04, 12.0)


def test_D5_a_force_limit_that_is_read_back_differently_is_reported_while_it_lasts(bench: Bench) -> None:
    bench.set_force(10.0)
    assert bench.last.echo_ok is True
    bench.swallow = lambda packet: packet.id == wire.SET_FORCE and not bench.deliver([sim.encode_reply(wire.SET_FORCE)])
    bench.samples.clear()
    bench.set_force(20.0, 1.0)
    assert [sample.echo_ok for sample in bench.samples[1:]] == [False] * (len(bench.samples) - 1)
    bench.swallow = lambda _: False
    bench.set_force(20.0)
    assert bench.last.echo_ok is True


def test_D5_a_limit_read_back_while_a_newer_one_waits_is_compared_with_its_own(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.GET_FORCE
    bench.set_force(10.0, 0.01)
    bench.set_force(20.0, 0.0)
    bench.deliver([sim.encode_number(wire.GET_FORCE, 20.0)])
    bench.run(0.03)
    assert bench.last.echo_ok is True


@pytest.mark.parametrize("order", [*permutations(range(4))])
def test_an_update_that_is_missing_costs_no_reading_and_a_missing_state_only_its_own(order: tuple[int, ...]) -> None:
    parts = [updates()[at] for at in order]
    for missing in range(4):
        torn = parts[:missing] + parts[missing + 1 :]
        samples = Decoder().receive(b"".join([*2 * parts, *torn, *3 * parts]), 0)
        joined_late = order[-1] != 3  # the first state arrived before the other updates
        assert len(samples) == 6 - joined_late - (order[missing] == 3), missing


def update(*words: str, grasping: str = "idle") -> bytes:
    width, force, _, state = updates(words=words)
    return b"".join((width, force, sim.encode_grasping(grasping), state))


FIRST, SECOND = updates(40.0), updates(41.0)
CASES = {
    "an update that is missing for two periods gives no reading": Case(
        b"".join([*FIRST, *2 * SECOND[1:], *SECOND]), fields("width_m", [0.040, 0.040, 0.041])
    ),
    "without a bit": Case(
        update(),
        [
            {
                "active": False,
                "object": "none",
                "moving": False,
                "fault": "",
                "force_n": 10.0,
                "width_m": 0.04,
                "echo_ok": None,
            }
        ],
    ),
    "referenced is active": Case(update("referenced"), fields("active", [True])),
    "moving": Case(update("moving"), [{"object": "moving", "moving": True}]),
    "a blocked axis is a contact": Case(update("blocked_minus"), fields("object", ["contact_closing"])),
    "holding is a contact": Case(update(grasping="holding"), fields("object", ["contact_closing"])),
    **{
        f"the fault of {word}": Case(update(word), fields("fault", [word if word in wire.FAULTS else ""]))
        for word in wire.STATE_BITS.values()
    },
}


@pytest.mark.parametrize("name", CASES)
def test_D4_a_stream_gives_these_readings(name: str) -> None:
    CASES[name].check(Decoder)
