"""Commands to a WSG that are dropped, replaced, refused, repeated or lost."""

from __future__ import annotations

import pytest
from permits import halt, move, set_force
from wsg_bench import GO, Bench

from slipd.devices.shared.command_queue import ATTEMPTS
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_commands import ANSWER_NS
from slipd.tools.sim import emulated_wsg as sim
from slipd.tools.sim.emulated_wsg import LIMITS


@pytest.mark.parametrize("blocked", ["blocked_plus", "blocked_minus"])
@pytest.mark.parametrize("width_m", [None, 0.1])
def test_a_force_never_opens_or_resumes_after_a_stop(bench: Bench, blocked: str, width_m: float | None) -> None:
    if width_m is not None:  # an obstacle blocks the opening
        move(bench.session, width_m, 0.05, 10.0)
        bench.run(0.1)
        bench.gripper.receive(wire.encode(wire.STOP), bench.now_ns)
    else:
        move(bench.session, 0.0, 0.05, 10.0)
        bench.run(0.1)
        halt(bench.session)
    bench.gripper._blocked = blocked
    bench.run(0.1)
    stood_m = bench.last.width_m
    bench.sent.clear()
    assert set_force(bench.session, 12.0) == 12.0
    bench.run(1.0)
    assert bench.commands() == [wire.SET_FORCE, wire.GET_FORCE]
    assert (bench.last.width_m, bench.gripper.limit) == (stood_m, 24.0)


def test_D4_a_goal_from_before_a_fault_is_not_resumed(bench: Bench) -> None:
    move(bench.session, 0.1, 0.05, 5.0)
    bench.run(0.1)
    bench.gripper.receive(wire.encode(wire.STOP), bench.now_ns)
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    bench.session.acknowledge()
    bench.run(0.1)
    width_m = bench.last.width_m
    assert set_force(bench.session, 10.0)
    bench.run(1.0)
    assert bench.last.width_m == width_m


@pytest.mark.parametrize("lost", GO)
def test_A6_an_unanswered_command_is_repeated_twice_and_then_lost(bench: Bench, lost: int) -> None:
    bench.swallow = lambda packet: packet.id == lost
    move(bench.session, 0.02, None, 10.0)
    bench.run(ANSWER_NS * 1e-9 * ATTEMPTS + 0.1)
    assert bench.commands() == [*GO[: GO.index(lost)], *[lost] * ATTEMPTS]
    assert bench.session.command_lost
    assert bench.session.state.startswith("command lost: no answer to ")
    assert bench.session.health.lost == ATTEMPTS
    bench.swallow = lambda _: False
    move(bench.session, 0.02, None, 10.0)
    bench.run(0.1)
    assert not bench.session.command_lost


@pytest.mark.parametrize("status", [*range(1, 26), *range(27, 31)])
@pytest.mark.parametrize("refused", GO)
def test_A6_every_refusal_is_reported_by_its_word_and_not_repeated(bench: Bench, refused: int, status: int) -> None:
    bench.forge = lambda asked: status if asked == refused else None
    move(bench.session, 0.02, None, 10.0)
    bench.run(0.1)
    well = refused == wire.PREPOSITION and status in (wire.ABORTED, wire.AXIS_BLOCKED)
    assert bench.session.command_lost is not well
    assert well or bench.commands()[-1] == refused
    assert well or bench.session.state.startswith("command lost: ")


def test_unrequested_answers_change_nothing(bench: Bench) -> None:
    bench.deliver([sim.encode_reply(reply_id) for reply_id in (wire.STOP, wire.SET_FORCE, wire.ACKNOWLEDGE)])
    bench.deliver(
        [
            sim.encode_number(wire.GET_FORCE, 3.0),
            sim.encode_limits(LIMITS._replace(nominal_force=90.0)),
        ]
    )
    assert (bench.session.state, bench.session.force_range_n[1]) == ("active", 40.0)


def test_the_abort_of_an_older_motion_does_not_answer_the_newer(bench: Bench) -> None:
    move(bench.session, 0.0, 0.01, 10.0)
    bench.run(0.1)
    move(bench.session, 0.05, 0.1, 10.0)
    bench.run(0.5)
    assert bench.commands() == [*GO, *GO]
    assert (bench.last.width_m, bench.session.state) == (pytest.approx(0.05), "active")


def test_a_refused_query_is_repeated() -> None:
    bench = Bench(forge=lambda asked: 10 if asked == wire.LIMITS else None).start()
    assert bench.session.state == "refused limits: insufficient resources"
    assert move(bench.session, 0.0, None, 5.0) is None
    bench.forge = lambda _: None
    bench.run(2.0)
    assert bench.session.state == "active"
