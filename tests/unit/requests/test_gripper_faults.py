"""A fault of the gripper is latched until it is acknowledged; a lease has one holder, and its end moves nothing."""

from __future__ import annotations

from typing import Any

import pytest
from engine_rig import LEFT, MOVES, RIG, Run
from motions.cell_steps import until
from nanoseconds import MS
from run_courses import (
    Step,
    ask,
    bring_up,
    commanded,
    count,
    down,
    feel,
    follow,
    grip,
    gripper,
    lease,
    let_lease_be,
    newest,
    play,
    serve,
    sleep,
    status,
    tick,
    up,
    wait,
    wrote,
)

from slipd.requests.handlers import MOST_CLIENTS, PER_CLIENT

BEN: dict[str, Any] = {"by": b"ben"}
NO_LEASE, LATCHED = ("no_lease", ""), ("fault_latched", "")
CLOSE = {"force_n": 5.0}
HELD: list[Step] = [bring_up, grip(5.0)]
CLOSED: list[Step] = [bring_up, ask("gripper.close", **CLOSE)]


def latched(fault: str) -> Step:
    """Check the latched fault in ``gripper`` and in ``status``."""

    def step(run: Run) -> None:
        newest("gripper", latched_fault=fault)(run)
        found = run.ask("status")["result"]
        assert found["gripper"]["latched_fault"] == fault
        assert ("is latched" in found["streams"]["gripper"]["message"]) == bool(fault)

    return step


COURSES: dict[str, tuple[str, list[Step]]] = {
    # a latched fault refuses every motion until it is acknowledged
    "the first fault blocks every motion until it is acknowledged": (
        RIG,
        [
            *HELD,
            *(step for fault in (8, 10, 0) for step in (gripper(fault=fault), serve(50))),
            latched("over_temperature"),
            feel(5.0),
            wrote(),
            *(ask(op, LATCHED, **MOVES[op]) for op in sorted(set(MOVES) - {"gripper.stop", "grip.hold"})),
            serve(50),
            wrote(0),
            ask("grip.hold"),
            ask("gripper.stop"),
            serve(50),
            wrote(1),
            ask("fault.ack", NO_LEASE, **BEN),
            ask("fault.ack", {"fault": "over_temperature"}),
            ask("fault.ack", {"fault": None}),
            serve(50),
            latched(""),
            ask("grip.adjust", delta_n=-0.5),
        ],
    ),
    **{
        f"D4 fault {fault} of the gripper blocks": (
            RIG,
            [
                bring_up,
                gripper(fault=fault),
                serve(50),
                lambda run: latched(run.published("gripper")[-1]["fault"])(run),
                ask("gripper.close", LATCHED, **CLOSE),
            ],
        )
        for fault in (5, 7, *range(8, 16))
    },
    "D4 reports during an activation are no fault": (
        RIG,
        [
            bring_up,
            ask("gripper.activate", drop=True),
            gripper(activates=True, fault=5),
            serve(100),
            latched(""),
            gripper(activates=False, stage=3, fault=0),
            serve(50),
            latched(""),
            ask("gripper.close", **CLOSE),
        ],
    ),
    "D4 a lost activation is latched": (
        RIG,
        [
            *HELD,
            serve(1000),
            gripper(stage=0),
            serve(50),
            latched("activation_lost"),
            newest("gripper", force_command_n=None),
        ],
    ),
    "D5 an echo that differs is latched, and again while it lasts": (
        RIG,
        [
            *HELD,
            gripper(echo=7),
            serve(200),
            latched("echo_mismatch"),
            lambda run: check_first_echoes(run),
            ask("fault.ack"),
            serve(100),
            latched("echo_mismatch"),
        ],
    ),
    "A6 an unanswered command is latched, and does not stand in the way of the next": (
        RIG,
        [
            *HELD,
            gripper(silent=True),
            ask("grip.adjust", delta_n=2.0),
            until(lambda run: run.published("gripper")[-1]["latched_fault"], [serve(5)]),
            newest("gripper", latched_fault="command_lost"),
            newest("status", gripper={"latched_fault": "command_lost"}),
            lambda run: (
                None if '"force_n":5.0,' in run.engine.kept.text(run.t_ns) else pytest.fail("kept a lost force")
            ),
            gripper(silent=False),
            serve(100),
            ask("fault.ack", {"fault": "command_lost"}),
            serve(50),
            ask("grip.adjust", "within 2 N of the 5 N that the gripper acknowledged last", delta_n=0.2),
            ask("grip.set", force_n=5.0),
        ],
    ),
    "silence of a holding gripper is latched": (RIG, [*HELD, gripper(silent=True), serve(400), latched("no_answer")]),
    "a link lost during a grip is latched, and one of a free gripper is not": (
        RIG,
        [
            bring_up,
            down("gripper"),
            latched(""),
            up("gripper"),
            lease,
            serve(100),
            grip(5.0),
            down("gripper"),
            latched("link_lost"),
            newest("gripper", active=None),
        ],
    ),
    # the lease
    "one client holds the lease until its last nanosecond": (
        RIG,
        [
            ask("lease.acquire", {"ttl_ms": 200}, ttl_ms=200),
            ask("lease.acquire", ("lease_held", ""), ttl_ms=200, **BEN),
            ask("lease.acquire", ("out_of_range", "ttl_ms"), ttl_ms=1001),
            wait(150),
            ask("lease.renew", {}),
            wait(200 - 1e-6),
            status(lease={"held": True, "expires_in_s": pytest.approx(1e-9)}),
            ask("lease.renew", NO_LEASE, **BEN),
            wait(1e-6),
            ask("lease.renew", NO_LEASE),
            ask("lease.acquire", ttl_ms=200, **BEN),
            ask("lease.release", {}, **BEN),
        ],
    ),
    "a lease ends before the next client gets it, and its end moves nothing": (
        RIG,
        [
            lease,
            wait(201),
            ask("lease.acquire", ttl_ms=200, **BEN),
            count("gripper", 1),
            newest("gripper", lease={"held": False}),
            ask("lease.release", **BEN),
            bring_up,
            wrote(),
            ask("gripper.close", force_n=10.0),
            serve(50),
            wrote(1),
            ask("lease.release"),
            serve(2000),
            wrote(0),
        ],
    ),
    "urgent requests of the holder are served in a crowd of clients": (
        RIG,
        [
            ask("lease.acquire", ttl_ms=200),
            ask("tare.get", finger="left", deadline_ns=100_400_000_000, times=PER_CLIENT - 1),
            *(
                ask("tare.get", finger="left", deadline_ns=100_400_000_000, by=b"%d" % number)
                for number in range(MOST_CLIENTS - 1)
            ),
            ask("tare.get", ("busy", ""), finger="left", by=b"newcomer"),
            ask("tare.get", ("busy", ""), finger="left"),
            ask("gripper.stop", ("busy", ""), by=b"newcomer"),
            ask("lease.renew"),
            ask("grip.hold", ("no_gripper", "")),
            ask("gripper.stop", ("no_gripper", "")),
        ],
    ),
}


def check_first_echoes(run: Run) -> None:
    found = [body["latched_fault"] for body in run.published("gripper")]
    end = found.index("echo_mismatch") + 1
    assert [body["echo_ok"] for body in run.published("gripper")[end - 4 : end]] == [True, False, False, False]


@pytest.mark.parametrize("name", COURSES)
def test_A6_D4_D5_a_course_of_faults_and_leases(name: str) -> None:
    play(*COURSES[name])


@pytest.mark.parametrize(("ms", "suspended_ns"), [(200, 0), (5, 10**9)])
def test_a_rig_without_gripper_publishes_the_end_of_a_lease_at_once(ms: int, suspended_ns: int) -> None:
    run = play(LEFT + "[rates]\nstatus_hz = 0.001\n", [tick, ask("lease.acquire", ttl_ms=200)])
    before = len(run.published("status"))
    for wait_ms, slept_ns, ends in ((5, 0, []), (ms, suspended_ns, [False]), (5, suspended_ns, [False])):
        follow(run, [wait(wait_ms), sleep(slept_ns)])
        assert [body["lease"]["held"] for body in run.published("status")[before:]] == ends


@pytest.mark.parametrize("lease_end", ["hold", "stop"])
@pytest.mark.parametrize("moving", [True, False])
def test_A5_the_end_of_a_lease_is_published_within_a_tick_and_opens_nothing(lease_end: str, moving: bool) -> None:
    course = [*CLOSED, gripper(found=0 if moving else 2), serve(100), wrote(), let_lease_be, ask("lease.renew")]
    run, stops = play(RIG + f'lease_end = "{lease_end}"\n', course), lease_end == "stop" and moving
    ends_ns, before = run.t_ns + 200 * MS, len(run.published("gripper"))
    run.serve_gripper(205)
    ended = next(body for body in run.published("gripper")[before:] if not body["lease"]["held"])
    assert 0 <= ended["t_ns"] - ends_ns < 5 * MS
    released = newest("status", lease={"held": False, "expires_in_s": None})
    follow(run, [released, serve(100), wrote(int(stops)), commanded(position=255, go=not stops)])
