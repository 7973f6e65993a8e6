"""Commands that are dropped, cancelled or never answered: what the session then sends, and which force is in effect."""

from __future__ import annotations

import pytest
from external_gripper_bench import Bench
from permits import activate, forget, halt, set_force

from slipd.devices.external_gripper.external_gripper_message import (
    Report,
)
from slipd.devices.external_gripper.external_gripper_session import ANSWER_MS, SILENCE_NS
from slipd.devices.shared.command_queue import ATTEMPTS


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
