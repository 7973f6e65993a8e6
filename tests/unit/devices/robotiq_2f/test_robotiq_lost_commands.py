"""Commands to a Robotiq that are dropped, replaced, repeated or lost."""

from __future__ import annotations

from itertools import pairwise

from permits import halt
from robotiq_bench import FORCE, GO, MS, Bench

from slipd.devices.shared import modbus


def test_a_newer_command_replaces_one_that_was_not_sent_yet(active: Bench) -> None:
    active.move(10, 1, 1)
    active.move(200, 128, 9)
    active.set_force(60)
    active.steps(1)
    assert active.sent[-1][1] == GO
    active.set_force(1)
    active.set_force(90)
    active.steps(2)
    assert active.commands() == [GO, FORCE]


def test_a_halt_keeps_a_force_that_waits(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.set_force(90)
    halt(active.session)
    active.steps(3)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_a_halt_drops_a_move_that_never_began_with_its_force(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.move(0, 255, 0)
    halt(active.session)
    active.steps(2)
    assert active.gripper.output == (0x0100, 200, 0x803C)


def test_the_force_sent_is_that_of_a_force_that_is_repeated_after_a_halt(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(90)
    active.steps(1)
    active.move(0, 255, 0)
    halt(active.session)
    active.gripper.mute = False
    for _ in range(4):
        assert active.session.force_sent_n == 91.0
        active.steps(1)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_dropped_commands_are_not_sent_and_sent_ones_are_not_repeated(active: Bench) -> None:
    active.gripper.mute = True
    active.move(200, 128, 60)
    active.steps(1)
    active.move(0, 255, 255)
    assert active.session.drop()
    assert active.session.drop() is False
    active.gripper.mute = False
    active.steps(5)
    assert (active.commands(), active.session.state) == ([GO], "command lost")
    assert (active.gripper.position, active.session.force_sent_n) == (3, 61.0)
    active.move(200, 128, 60)
    active.gripper.mute = True
    active.steps(1)
    active.gripper.mute = False
    active.steps(1)
    assert (active.commands(), active.session.command_lost) == ([GO] * 3, False), "a later one is repeated"


def test_a_move_dropped_while_a_poll_was_out_is_not_made_by_a_later_force(active: Bench) -> None:
    active.gripper.mute = True
    active.steps(1)
    active.move(200, 128, 60)
    assert active.session.drop()
    active.gripper.mute = False
    active.set_force(90)
    halt(active.session)
    active.steps(3)
    assert active.gripper.output[1] == 0
    assert active.gripper.output[2] & 0xFF == 90
    assert (active.session.force_sent_n, active.session.command_lost) == (91.0, False)


def test_a_move_that_is_not_repeated_is_not_made_by_a_later_force(active: Bench) -> None:
    active.gripper.mute = True
    active.move(200, 128, 60)
    active.steps(1)
    active.session.drop()
    active.set_force(90)
    active.gripper.mute = False
    active.steps(3)
    assert active.gripper.output == (0x0100, 0, 0x805A)


def test_a_halt_is_not_dropped_and_is_repeated(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    halt(active.session)
    assert active.session.drop() is False
    active.gripper.mute = True
    active.steps(1)
    active.session.drop()
    active.gripper.mute = False
    active.steps(1)
    assert (active.gripper.output[0], active.session.command_lost) == (0x0100, False)


def test_a_move_that_was_lost_before_it_was_sent_is_not_a_goal(active: Bench) -> None:
    active.gripper.mute = True
    active.steps(3)
    active.move(200, 128, 60)
    active.steps(1)
    assert (active.commands(), active.session.command_lost, active.session.force_sent_n) == ([], True, None)
    active.gripper.mute = False
    active.steps(4)
    active.set_force(90)
    halt(active.session)
    active.steps(2)
    assert active.gripper.output[2] & 0xFF == 90


def test_A6_an_unanswered_command_is_repeated_twice_and_then_lost(active: Bench) -> None:
    active.gripper.mute = True
    active.move(200, 128, 60)
    active.steps(3)
    assert active.session.state == "active"
    active.steps(4)
    assert active.commands() == [GO] * 3
    assert active.session.state == "no reply"
    assert active.session.command_lost
    assert active.session.health.lost == 6
    times = [time for time, _ in active.sent]
    assert all(later - earlier == 100 * MS for earlier, later in pairwise(times))


def test_D4_after_a_loss_of_power_nothing_is_sent_before_a_new_status(active: Bench) -> None:
    active.gripper.mute = True
    active.steps(5)
    assert active.session.state == "no reply"
    assert active.move(1, 2, 3) is None
    active.gripper.mute = False
    active.steps(2)
    assert active.session.state == "active"
    assert active.move(200, 128, 60)
    active.steps(1)
    assert active.commands() == [GO]
    assert not active.session.command_lost


def test_an_unanswered_force_is_not_repeated_after_a_newer_one(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(1)
    active.steps(1)
    halt(active.session)
    active.set_force(90)
    active.gripper.mute = False
    active.steps(4)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_A6_a_refused_command_is_not_repeated(active: Bench) -> None:
    active.gripper.refuses = (modbus.WRITE,)
    active.move(200, 128, 60)
    active.steps(4)
    assert active.commands() == [GO]
    assert active.session.state == "command lost"
    active.gripper.refuses = ()
    active.set_force(90)
    active.steps(1)
    assert active.session.state == "active"


def test_A6_a_command_lost_after_an_acknowledgement_is_reported_again(active: Bench) -> None:
    for _ in range(2):
        active.gripper.mute = True
        active.move(200, 128, 60)
        active.steps(8)
        assert active.session.command_lost
        active.session.acknowledge()
        assert not active.session.command_lost
        active.gripper.mute = False
        active.steps(8)


def test_a_second_halt_keeps_the_force_that_is_repeated_after_the_first(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(90)
    active.steps(1)
    active.move(0, 255, 0)
    halt(active.session)
    active.gripper.mute = False
    active.steps(1)
    assert (halt(active.session), active.session.force_sent_n) == (True, 91.0)
    active.steps(3)
    assert active.gripper.output == (0x0100, 200, 0x805A)
