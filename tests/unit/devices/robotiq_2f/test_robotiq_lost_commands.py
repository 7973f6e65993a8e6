"""Commands to a Robotiq that are dropped, replaced, repeated or lost."""

from __future__ import annotations

from itertools import pairwise

from permits import halt
from robotiq_bench import GO, MS, Bench


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
