"""Activation of a WSG: faults that it acknowledges, homing, its end, and how it is cancelled."""

from __future__ import annotations

import pytest
from permits import activate, halt, move, set_force
from wsg_bench import Bench

from slipd.devices.shared.command_queue import ATTEMPTS
from slipd.devices.wsg import HOMING_NS
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_commands import ANSWER_NS
from slipd.tools.sim import emulated_wsg as sim


def test_activation_homes_and_is_over_when_the_gripper_reports_it() -> None:
    bench = Bench()
    bench.gripper.words.clear()
    bench.start()
    assert (bench.session.state, bench.last.active, halt(bench.session)) == ("inactive", False, False)
    assert (move(bench.session, 0.0, None, 5.0), set_force(bench.session, 5.0)) == (None, None)
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    assert (bench.session.state, bench.last.active, move(bench.session, 0.0, None, 5.0)) == ("activating", False, None)
    bench.run(1.0)
    assert (bench.session.state, bench.last.active, bench.last.width_m) == ("active", True, pytest.approx(0.110))
    assert bench.commands() == [wire.HOME]


def test_homing_without_an_end_is_lost(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.write(bench.session.on_time(bench.now_ns))
    bench.gripper._goal = None
    bench.run(HOMING_NS * 1e-9 + 0.001)
    assert bench.session.state == "command lost: no end of homing"


@pytest.mark.parametrize("status", [None, 7])
def test_an_activation_that_was_lost_before_it_was_sent_blocks_nothing(bench: Bench, status: int | None) -> None:
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    bench.swallow = lambda packet: status is None and packet.id == wire.ACKNOWLEDGE
    bench.forge = lambda asked: status if asked == wire.ACKNOWLEDGE else None
    activate(bench.session, bench.now_ns)
    bench.run(ANSWER_NS * 1e-9 * ATTEMPTS + 0.1)
    assert bench.session.state.startswith("command lost: ")
    assert (bench.session.activating, wire.HOME in bench.commands()) == (False, False)
    bench.swallow, bench.forge = lambda _: False, lambda _: None
    bench.session.acknowledge()
    bench.run(0.1)
    assert move(bench.session, 0.02, None, 5.0) == 5.0


def test_a_first_activation_that_ends_while_a_second_waits_does_not_end_the_second(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    bench.deliver([sim.encode_reply(wire.HOME)])
    assert bench.session.activating
    assert bench.session.drop()
    assert (bench.session.activating, set_force(bench.session, 5.0)) == (False, None), "a reading shows the state again"
    bench.run(0.03)
    assert set_force(bench.session, 5.0) == 5.0
