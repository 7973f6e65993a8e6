"""Commands that are dropped, cancelled or never answered: what the session then sends, and which force is in effect."""

from __future__ import annotations

import pytest
from external_gripper_bench import Bench
from permits import activate, forget, halt, move, set_force

from slipd.devices.external_gripper.external_gripper_message import (
    Report,
)
from slipd.devices.external_gripper.external_gripper_session import ANSWER_MS, SILENCE_NS
from slipd.devices.shared.command_queue import ATTEMPTS


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_the_force_sent_is_the_one_in_effect_once_waiting_commands_are_dropped(holding: Bench, how: str) -> None:
    holding.driver.mute = True
    set_force(holding.session, 12.0)
    holding.run(0.01)
    set_force(holding.session, 15.0)
    assert (holding.session.force_sent_n, forget(holding.session, how)) == (15.0, True)
    assert holding.session.force_sent_n == 12.0
    assert holding.session.drop() is False


def test_dropped_commands_are_not_sent_and_sent_ones_are_not_repeated(bench: Bench) -> None:
    bench.driver.mute = True
    set_force(bench.session, 10.0)
    bench.run(0.01)
    move(bench.session, 0.0, None, 10.0)
    assert bench.session.drop()
    bench.run(1.0)
    assert (bench.operations(), bench.session.state) == (["force"], "command lost: no answer to force")


def test_a_stop_is_not_dropped(bench: Bench) -> None:
    halt(bench.session)
    assert bench.session.drop() is False
    bench.run(0.1)
    assert bench.operations() == ["stop"]


@pytest.mark.parametrize("active", [False, True])
@pytest.mark.parametrize("how", ["halt", "drop"])
def test_an_unsent_activation_is_cancelled(bench: Bench, how: str, active: bool) -> None:
    bench.driver.report = Report(0.08, active=active)
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    assert forget(bench.session, how)
    bench.run(0.1)
    assert bench.operations() == ["stop"] * (active and how == "halt")


def test_stopping_with_an_unanswered_set_point_sends_nothing(holding: Bench) -> None:
    set_force(holding.session, 12.0)
    assert (holding.session.stop(), holding.session.next_deadline()) == (b"", None)


def test_no_motion_is_taken_until_the_driver_has_answered_the_activation(bench: Bench) -> None:
    activate(bench.session)
    for _ in range(2):  # queued, and sent
        assert (bench.session.activating, bench.session.state) == (True, "activating")
        assert (move(bench.session, 0.02, None, 5.0), set_force(bench.session, 5.0)) == (None, None)
        bench.driver.mute = True
        bench.run(0.03)
    bench.driver.mute = False
    bench.run(0.2)
    assert (bench.session.activating, bench.operations()[-1]) == (False, "activate")
    assert move(bench.session, 0.02, None, 5.0) == 5.0


@pytest.mark.parametrize("active", [False, True])
def test_an_activation_that_was_sent_is_stopped(bench: Bench, active: bool) -> None:
    bench.driver.report = Report(0.08, active=active)
    bench.driver.mute = True
    bench.run(0.1)
    activate(bench.session)
    bench.run(0.01)
    assert halt(bench.session)
    bench.run(0.05)
    assert (bench.operations(), bench.session.activating) == (["activate", "stop"], False)
    assert bench.session.state == ("active" if active else "inactive")


def test_an_activation_that_is_never_answered_ends_when_it_is_lost(bench: Bench) -> None:
    bench.driver.mute = True
    activate(bench.session)
    bench.run(ANSWER_MS * ATTEMPTS / 1000 + 0.1)
    assert bench.operations() == ["activate"] * ATTEMPTS
    assert (bench.session.activating, bench.session.state) == (False, "command lost: no answer to activate")
    assert set_force(bench.session, 5.0) == 5.0


def test_a_closed_session_sends_nothing(bench: Bench) -> None:
    bench.session.stop()
    assert bench.session.on_time(bench.now_ns + SILENCE_NS) == b""
