"""Activation of a Robotiq: its two steps, its end, and how it is cancelled."""

from __future__ import annotations

import pytest
from permits import activate, forget, halt
from robotiq_bench import ACTIVATE, CLEAR, FORCE, GO, MS, Bench

from slipd.devices.shared import modbus


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


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_an_unsent_activation_is_cancelled(active: Bench, how: str) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    activate(active.session, active.now_ns)
    assert (active.session.force_sent_n, active.set_force(90)) == (None, None)
    assert forget(active.session, how)
    active.steps(4)
    assert CLEAR not in active.commands()
    assert active.gripper.output[0] == (0x0100 if how == "halt" else 0x0900), "its previous motion is stopped"
    assert (active.session.state, active.session.force_sent_n) == ("active", 61.0)


def test_half_an_activation_is_cancelled_by_a_halt_though_the_first_half_is_unanswered() -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    bench.gripper.mute = True
    bench.steps(1)
    assert halt(bench.session)
    assert halt(bench.session) is False
    bench.gripper.mute = False
    bench.steps(5)
    assert (bench.commands(), bench.gripper.stage) == ([CLEAR], 0)


def test_a_gripper_whose_activation_was_cancelled_halfway_accepts_nothing(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    activate(active.session, active.now_ns)
    active.steps(1)
    assert halt(active.session)
    assert (active.session.force_sent_n, active.move(1, 2, 3), halt(active.session)) == (None, None, False)
    active.steps(3)
    assert (active.commands(), active.session.state) == ([GO, CLEAR], "inactive")


@pytest.mark.parametrize("how", ["activated", "power lost"])
def test_a_gripper_that_was_inactive_meanwhile_has_no_force(active: Bench, how: str) -> None:
    active.move(200, 128, 60)
    active.steps(2)
    if how == "activated":
        activate(active.session, active.now_ns)
    else:
        active.gripper.stage = 0
    active.steps(1)
    assert active.session.force_sent_n is None
    active.gripper.stage = 3
    active.steps(5)
    assert (active.session.state, active.session.force_sent_n) == ("active", None)


def test_a_command_is_dropped_when_the_gripper_turns_out_to_be_inactive(active: Bench) -> None:
    active.now_ns += 20 * MS
    poll = active.session.on_time(active.now_ns)
    active.move(200, 128, 60)
    active.gripper.stage = 0
    active.session.receive(active.gripper.respond(poll), active.now_ns)
    active.steps(5)
    assert active.commands() == []
    assert active.session.command_lost
    assert active.session.state == "command lost"


def test_a_lost_clear_never_leads_to_a_bare_activation() -> None:
    bench = Bench().start()
    bench.gripper.mute = True
    activate(bench.session, bench.now_ns)
    bench.steps(5)
    assert bench.commands() == [CLEAR] * 3
    bench.gripper.mute = False
    bench.steps(5)
    assert bench.commands() == [CLEAR] * 3
    assert bench.session.command_lost


def test_an_unanswered_force_is_not_repeated_after_an_activation(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(90)
    active.steps(1)
    activate(active.session, active.now_ns)
    active.gripper.mute = False
    active.steps(8)
    assert active.commands() == [GO, FORCE, CLEAR, ACTIVATE]
    assert (active.session.state, active.session.force_sent_n) == ("active", None)


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


def test_an_activation_that_the_gripper_refuses_is_over(active: Bench) -> None:
    activate(active.session, active.now_ns)
    active.steps(1)
    active.gripper.refuses = (modbus.WRITE,)
    active.steps(1)
    assert (active.session.activating, active.session.state) == (False, "command lost")
    active.steps(1)
    assert active.commands() == [CLEAR, ACTIVATE]
