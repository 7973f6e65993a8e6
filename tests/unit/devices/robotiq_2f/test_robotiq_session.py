"""The Robotiq session against a simple gripper on a line that loses, delays, damages and refuses."""

from __future__ import annotations

from itertools import pairwise

import pytest
from permits import activate, move
from robotiq_bench import FORCE, GO, MS, OLD_POLL, OPEN, POLL, Bench, Gripper

from slipd.devices import robotiq_2f
from slipd.devices.shared import modbus
from slipd.tools.sim import emulated_robotiq_2f as sim


def test_starting_only_polls_and_moves_nothing() -> None:
    bench = Bench().start()
    bench.steps(200)
    assert (bench.commands(), bench.session.state) == ([], "inactive")
    gaps = {later[0] - earlier[0] for earlier, later in pairwise(bench.sent)}
    assert gaps == {20 * MS}
    assert (bench.session.stop(), bench.session.next_deadline()) == (b"", None)


def test_move_and_force_are_the_published_bytes_and_go_before_the_next_poll(active: Bench) -> None:
    assert active.move(200, 128, 60)
    assert active.session.next_deadline() == active.now_ns + 5 * MS
    active.steps(1)
    assert active.set_force(90)
    active.steps(2)
    assert active.move(0, 255, 255)
    active.steps(1)
    assert [data for _, data in active.sent] == [GO, FORCE, POLL, OPEN]
    assert sim.parse_output(active.gripper.output).position == 0


def test_commands_keep_five_milliseconds_from_the_last_reply_and_one_transaction_at_a_time(active: Bench) -> None:
    active.now_ns += 20 * MS
    assert active.session.on_time(active.now_ns) == POLL
    active.move(200, 128, 60)
    assert active.session.on_time(active.now_ns + 50 * MS) == b""
    active.session.receive(active.gripper.respond(POLL), active.now_ns + 50 * MS)
    assert active.session.on_time(active.now_ns + 55 * MS - 1) == b""
    assert active.session.on_time(active.now_ns + 55 * MS) == GO


def test_the_ranges_are_those_of_the_tables(active: Bench) -> None:
    session = active.session
    active.gripper.position = 55
    active.steps(1)
    assert active.samples[-1].width_m == pytest.approx(0.2)
    ranges = session.width_range_m, session.speed_range_mps, session.force_range_n
    assert ranges == ((0.0, 0.255), (0.0, 0.255), (1.0, 256.0))
    without = robotiq_2f.Session(speed_table=None)
    assert without.speed_range_mps is None
    with pytest.raises(ValueError, match="the speed must be left out"):
        move(without, 0.0, 0.1, 30.0)


@pytest.mark.parametrize("mute_first", [False, True])
def test_a_gripper_with_the_older_status_function_is_found(mute_first: bool) -> None:
    bench = Bench(gripper=Gripper(refuses=() if mute_first else (modbus.READ_INPUT,), mute=mute_first)).start()
    if mute_first:
        bench.steps(3)
        assert bench.sent[-1][1] == OLD_POLL
        bench.gripper.mute = False
    bench.steps(3)
    assert (bench.sent[-1][1], bench.session.state) == (OLD_POLL, "inactive")


def test_D5_an_echo_that_differs_from_the_position_last_sent_shows_while_it_lasts(active: Bench) -> None:
    assert active.samples[-1].echo_ok is None
    active.move(200, 128, 60)
    active.steps(2)
    assert active.samples[-1].echo_ok is True
    active.gripper.echo = 199
    active.steps(3)
    active.set_force(90)
    active.steps(2)
    assert [sample.echo_ok for sample in active.samples[-4:]] == [False] * 4
    active.gripper.echo = None
    active.steps(1)
    assert active.samples[-1].echo_ok is True
    activate(active.session, active.now_ns)
    active.steps(3)
    assert active.samples[-1].echo_ok is None


@pytest.mark.parametrize("stage", [0, 1, 3])
@pytest.mark.parametrize("fault", [*range(5, 16), 0x30])
def test_D4_a_fault_is_shown_and_nothing_is_tried_against_it(active: Bench, fault: int, stage: int) -> None:
    active.move(200, 128, 60)
    active.steps(2)
    active.gripper.fault = fault
    for _ in range(10):
        active.gripper.stage = stage
        active.steps(1)
    assert active.commands() == [GO]
    assert {(sample.fault == "", sample.active) for sample in active.samples[-10:]} == {(False, stage == 3)}
    assert (active.set_force(90) is None) == (stage != 3)
    active.session.acknowledge()
    active.steps(3)
    assert active.commands()[1:] == ([FORCE] if stage == 3 else [])


def test_a_flood_of_commands_leaves_every_third_turn_to_the_poll(active: Bench) -> None:
    active.now_ns += 20 * MS
    for force in range(9):
        active.set_force(force)
        active.steps(1)
    assert [data == POLL for _, data in active.sent] == [False, False, True] * 3


def test_noise_is_counted_between_the_replies_and_before_one(active: Bench) -> None:
    active.session.receive(b"\x09\x04", active.now_ns)
    active.now_ns += 20 * MS
    reply = active.gripper.respond(active.session.on_time(active.now_ns))
    assert len(active.session.receive(b"\x00" + reply, active.now_ns)) == 1
    assert active.session.health.bad_bytes == 3
