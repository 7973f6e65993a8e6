"""Commands to a Robotiq: activation, and commands that are dropped, replaced, repeated or lost."""

from __future__ import annotations

import pytest
from permits import activate, forget, halt
from robotiq_bench import ACTIVATE, CLEAR, MS, Bench


def test_activation_clears_then_activates_and_waits_until_the_gripper_reports_it() -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    assert bench.move(1, 2, 3) is None
    bench.steps(3)
    assert bench.commands() == [CLEAR, ACTIVATE]
    assert (bench.session.state, bench.samples[-1].active, bench.samples[-1].moving) == ("activating", False, True)
    bench.steps(1)
    assert (bench.session.state, bench.samples[-1].active) == ("active", True)


def test_activation_asked_for_while_a_poll_is_out_is_not_undone_by_its_reply(active: Bench) -> None:
    active.now_ns += 20 * MS
    reply = active.gripper.respond(active.session.on_time(active.now_ns))
    activate(active.session, active.now_ns)
    active.session.receive(reply, active.now_ns)
    assert active.move(1, 2, 3) is None
    active.steps(2)
    assert active.commands() == [CLEAR, ACTIVATE]


def test_a_command_is_dropped_when_the_gripper_turns_out_to_be_inactive(active: Bench) -> None:
    active.now_ns += 20 * MS
    poll = active.session.on_time(active.now_ns)
    active.move(200, 128, 60)
    active.gripper.stage = 0
    active.session.receive(active.gripper.respond(poll), active.now_ns)
    active.steps(5)
    assert (active.commands(), active.session.command_lost, active.session.state) == ([], True, "command lost")


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_a_status_received_during_a_queued_activation_counts_after_its_cancellation(how: str) -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    bench.gripper.output, bench.gripper.stage = (0x0100, 0, 0), 3  # another master activated it
    poll = bench.session._line.poll(bench.now_ns)
    bench.session.receive(bench.gripper.respond(poll), bench.now_ns)
    assert (bench.session.state, bench.session.activating) == ("activating", True)
    assert forget(bench.session, how)
    assert (bench.session.state, bench.session.activating) == ("active", False)


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
