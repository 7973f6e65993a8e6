"""Commands to a WSG: activation, faults, and commands that are dropped, replaced, refused, repeated or lost."""

from __future__ import annotations

import pytest
from permits import activate, halt, move, set_force
from wsg_bench import GO, Bench

from slipd.devices.shared.command_queue import ATTEMPTS
from slipd.devices.wsg import HOMING_NS
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_commands import ANSWER_NS
from slipd.tools.sim import emulated_wsg as sim

LOST_S = ANSWER_NS * 1e-9 * ATTEMPTS + 0.1
"""Longer than a command waits for its answers."""


def test_homing_without_an_end_is_lost(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.write(bench.session.on_time(bench.now_ns))
    bench.gripper._goal = None
    assert bench.run(HOMING_NS * 1e-9 - 0.001).session.state == "activating"
    assert bench.run(0.002).session.state == "command lost: no end of homing"


@pytest.mark.parametrize("status", [None, 7])
def test_an_activation_that_was_lost_before_it_was_sent_blocks_nothing(bench: Bench, status: int | None) -> None:
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    bench.swallow = lambda packet: status is None and packet.id == wire.ACKNOWLEDGE
    bench.forge = lambda asked: status if asked == wire.ACKNOWLEDGE else None
    activate(bench.session, bench.now_ns)
    assert bench.run(LOST_S).session.state.startswith("command lost: ")
    assert (bench.session.activating, wire.HOME in bench.commands()) == (False, False)
    bench.swallow, bench.forge = lambda _: False, lambda _: None
    bench.session.acknowledge()
    assert move(bench.run(0.1).session, 0.02, None, 5.0) == 5.0


def test_a_first_activation_that_ends_while_a_second_waits_does_not_end_the_second(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    bench.deliver([sim.encode_reply(wire.HOME)])
    assert (bench.session.activating, bench.session.drop()) == (True, True)
    assert (bench.session.activating, bench.set_force(5.0)) == (False, None), "a reading shows the state again"
    assert bench.set_force(5.0) == 5.0


@pytest.mark.parametrize("fault", wire.FAULTS)
def test_D4_a_fault_is_named_and_nothing_is_tried_against_it(holding: Bench, fault: str) -> None:
    holding.gripper.words.add(fault)
    holding.run(0.5)
    assert (holding.last.fault, holding.last.active, holding.commands()) == (fault, True, [])
    refused = move(holding.session, 0.0, None, 5.0), set_force(holding.session, 5.0)
    assert (holding.session.state, refused) == (fault, (None, None))
    holding.session.acknowledge()
    holding.session.acknowledge()
    holding.run(0.1)
    assert (holding.commands(), holding.last.fault, holding.set_force(12.0)) == ([wire.ACKNOWLEDGE], "", 12.0)


def test_a_connection_that_broke_is_a_fault_of_the_gripper(holding: Bench) -> None:
    holding.start()
    assert (holding.last.fault, holding.move(0.0, None, 5.0)) == ("fast_stop", None)


@pytest.mark.parametrize("blocked", ["blocked_plus", "blocked_minus"])
@pytest.mark.parametrize("width_m", [0.0, 0.1])
def test_a_force_never_opens_or_resumes_after_a_stop(bench: Bench, blocked: str, width_m: float) -> None:
    bench.move(width_m, 0.05, 10.0)
    if width_m:  # an obstacle blocks the opening
        bench.gripper.receive(wire.encode(wire.STOP), bench.now_ns)
    else:
        halt(bench.session)
    bench.gripper._blocked = blocked
    bench.run(0.1)
    stood_m = bench.last.width_m
    bench.sent.clear()
    assert bench.set_force(12.0, 1.0) == 12.0
    assert bench.commands() == [wire.SET_FORCE, wire.GET_FORCE]
    assert (bench.last.width_m, bench.gripper.limit) == (stood_m, 24.0)


@pytest.mark.parametrize("status", [*range(1, 26), *range(27, 31)])
@pytest.mark.parametrize("refused", GO)
def test_A6_every_refusal_is_reported_by_its_word_and_not_repeated(bench: Bench, refused: int, status: int) -> None:
    bench.forge = lambda asked: status if asked == refused else None
    bench.move(0.02, None, 10.0)
    well = refused == wire.PREPOSITION and status in (wire.ABORTED, wire.AXIS_BLOCKED)
    assert bench.session.command_lost is not well
    assert well or bench.commands()[-1] == refused
    assert well or bench.session.state.startswith("command lost: ")


@pytest.mark.parametrize(("status", "lost"), [(0, False), (19, False), (29, False), (7, True), (18, True)])
def test_the_end_of_a_motion_may_come_at_any_time(bench: Bench, status: int, lost: bool) -> None:
    for reply_id, name, also_lost in ((wire.PREPOSITION, "pre-position", False), (wire.HOME, "homing", status > 7)):
        bench.session.acknowledge()
        bench.deliver([sim.encode_reply(reply_id, status)])
        assert bench.session.command_lost is (lost or also_lost)
        assert not bench.session.command_lost or bench.session.state.startswith(f"command lost: {name}: ")


def test_unrequested_answers_change_nothing(bench: Bench) -> None:
    bench.deliver([sim.encode_reply(reply_id) for reply_id in (wire.STOP, wire.SET_FORCE, wire.ACKNOWLEDGE)])
    limits = sim.encode_limits(sim.LIMITS._replace(nominal_force=90.0))
    bench.deliver([sim.encode_number(wire.GET_FORCE, 3.0), limits])
    assert (bench.session.state, bench.session.force_range_n[1]) == ("active", 40.0)


def test_the_abort_of_an_older_motion_does_not_answer_the_newer(bench: Bench) -> None:
    bench.move(0.0, 0.01, 10.0)
    bench.move(0.05, 0.1, 10.0, 0.5)
    assert bench.commands() == [*GO, *GO]
    assert (bench.last.width_m, bench.session.state) == (pytest.approx(0.05), "active")


def test_a_refused_query_is_repeated() -> None:
    bench = Bench(forge=lambda asked: 10 if asked == wire.LIMITS else None).start()
    assert bench.session.state == "refused limits: insufficient resources"
    bench.forge = lambda _: None
    assert bench.run(2.0).session.state == "active"
