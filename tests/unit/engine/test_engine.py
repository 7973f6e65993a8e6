"""What follows from an event: courses of the whole engine, with the bytes that real devices send."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from arm_rig import ARM, ArmRun
from arm_rig import RIG as ARM_RIG
from engine_rig import LEFT, RIG, RIGHT, WALL_NS, Run, wrench_of
from grasp_table import grasp_table
from nanoseconds import MS
from run_courses import (
    Step,
    ask,
    bring_up,
    count,
    down,
    feel,
    follow,
    grip,
    gripper,
    image,
    let_lease_be,
    level,
    newest,
    play,
    serve,
    skin,
    sleep,
    status,
    tick,
    wait,
    wrench,
    wrote,
)

from slipd.compile_kernels import warm_up
from slipd.devices import bota
from slipd.devices.wsg import wsg_messages
from slipd.events import NEVER_NS, Bytes, HostNotice, IncidentsChanged, Publish, Request, Tick, WallClock, Write
from slipd.tools.sim.emulated_pads import encode_message
from slipd_client.messages import Health

GRASP = RIG + grasp_table()
TWINS = RIGHT + RIGHT.replace("finger.right", "finger.third").replace('"2"', '"1"')
WSG = LEFT + '[gripper]\ndevice = "wsg"\nport = "tcp://127.0.0.1:1000"\nrate_hz = 50.0\nmax_force_n = 25.0\n'
STALE, HELD_LIGHTLY = ("unknown", "stale"), wrench(10.0, (1.0, 0.0))
NEAR = wrench(10.0, (4.6, 0.0))


def states(*expected: str) -> Step:
    """Check the last states of the grasp, without repetitions."""

    def step(run: Run) -> None:
        found = [body["state"] for body in run.published("grasp")]
        different = [word for before, word in zip([None, *found], found, strict=False) if word != before]
        assert tuple(different[-len(expected) :]) == expected

    return step


def told(event: Any) -> Step:
    return lambda run: run.feed(event)


def clocked(moved_ns: int) -> Step:
    """The host sets its wall clock."""
    return lambda run: run.feed(Tick(wall_minus_monotonic_ns=WALL_NS + moved_ns))


def dated(moved_ns: int = 0) -> Step:
    """Check that messages and recordings have the wall time of now."""

    def step(run: Run) -> None:
        wall_ns = run.t_ns + WALL_NS + moved_ns
        assert run.published("slip.left")[-1]["timestamp"] == pytest.approx(wall_ns * 1e-9, abs=1e-5)
        assert WallClock(0).stamp(wall_ns) in run.ask("record.start")["result"]["name"]
        run.ask("record.stop")

    return step


FELT: list[Step] = [feel(5.0), serve(5)] * 20
GONE: list[Step] = [feel(0.0), serve(5)] * 20
LIFTED: list[Step] = [bring_up, grip(5.0), *FELT, states("held")]
COURSES: dict[str, tuple[str, list[Step]]] = {
    # streams that end
    "a lost force sensor makes its finger unknown at once, with nil for what is not known": (
        RIG,
        [
            image(),
            HELD_LIGHTLY,
            down("left.wrench"),
            level(*STALE),
            newest("status", streams={"left.wrench": {"message": "unplugged"}}),
            newest("slip.left", normal_n=None, tangential_n=None, utilisation=None, pole_m=None, grip_needed_n=None),
        ],
    ),
    "a lost server makes every finger on it unknown": (
        TWINS,
        [
            told(Bytes("right.pad", encode_message(1, dict.fromkeys("12", np.full((4, 3), 1000)), 1.7e9))),
            level("no_contact", finger="right"),
            level("no_contact", finger="third"),
            down("right.pad"),
            level(*STALE, finger="right"),
            level(*STALE, finger="third"),
        ],
    ),
    "without its pad a finger judges translation alone": (
        RIG,
        [
            image(),
            HELD_LIGHTLY,
            down("left.pad"),
            HELD_LIGHTLY,
            level("unknown", "rotation_unobserved"),
            NEAR,
            level("warning", "translation"),
        ],
    ),
    "silence of a force sensor is noticed at a tick, once": (
        RIG,
        [
            image(),
            HELD_LIGHTLY,
            wait(20),
            tick,
            level("stable"),
            wait(1),
            tick,
            level(*STALE),
            newest("slip.left", age_s=pytest.approx(0.021)),
            count("warning", 2),
            wait(100),
            tick,
            count("warning", 2),
        ],
    ),
    "L11 bytes that trickle in are no stream": (
        RIG,
        [
            image(),
            HELD_LIGHTLY,
            image(),
            level("stable"),
            *(
                step
                for byte in bota.encode_frame(*wrench_of(10.0), 0)[:-1]
                for step in (wait(5), image(), told(Bytes("left.wrench", bytes((byte,)))), tick)
            ),
            level(*STALE),
        ],
    ),
    # a host that sleeps
    "a sleep makes every stream stale, and ends leases": (
        RIG,
        [
            sleep(7 * 10**9),
            image(),
            HELD_LIGHTLY,
            skin(5.0),
            ask("lease.acquire", ttl_ms=200),
            wait(5),
            sleep(7 * 10**9 + 50 * MS),  # that may be two clocks read one after the other
            level("stable"),
            ask("lease.renew"),
            wait(5),
            sleep(10 * 10**9),
            level(*STALE),
            level(*STALE, finger="right"),
            ask("lease.renew", ("no_lease", "")),
        ],
    ),
    "images from before a sleep are stale, although they look 6 ms old": (
        RIG,
        [
            tick,
            image(),
            HELD_LIGHTLY,
            sleep(3600 * 10**9),
            wrench(10.0, (1.0, 0.0), ms=5.0),
            level("unknown", "rotation_unobserved"),
            image(),
            HELD_LIGHTLY,
            level("stable"),
        ],
    ),
    "the first tick is no sleep": (RIG, [image(), HELD_LIGHTLY, sleep(10**15), level("stable")]),
    "a sleep ends a tare": (
        RIG,
        [
            tick,
            wrench(0.0),
            ask("tare", finger="left", seconds=0.05),
            sleep(10**12),
            ask("tare.get", {"busy": False}, finger="left"),
        ],
    ),
    **{
        f"timestamps follow a wall clock that moved by {moved_ns} ns": (
            RIG,
            [wrench(0.0), dated(), *[wait(5), clocked(moved_ns)] * 2, wrench(0.0), dated(moved_ns)],
        )
        for moved_ns in (8 * 3600 * 10**9, -5 * 10**9)
    },
    # the line to the gripper
    "the gripper is polled as soon as its line opens": (
        RIG,
        [
            lambda run: set_equal((out.link for _, out in run.out if isinstance(out, Write)), "gripper"),
            serve(200),
            count("gripper", 5, 99),
            newest("gripper", width_m=pytest.approx(0.085), active=False, echo_ok=None),
        ],
    ),
    "loss of the line to the gripper is published, and ends the lease": (
        RIG,
        [
            serve(100),
            ask("lease.acquire", ttl_ms=200),
            down("gripper"),
            newest("gripper", active=None),
            status(lease={"held": False}),
        ],
    ),
    "what relies on a session that fails forgets it until it reports again": (
        RIG,
        [
            bring_up,
            grip(5.0),
            serve(2000),
            lambda run: setattr(run.engine._links["gripper"].session, "receive", raising),
            serve(20),
            newest("gripper", width_m=None, latched_fault="link_lost", lease={"held": False}),
            lambda run: delattr(run.engine._links["gripper"].session, "receive"),
            let_lease_be,
            serve(1100),
            lambda run: newest("gripper", width_m=pytest.approx(run.published("gripper")[-1]["width_m"]))(run),
            wrote(0),
        ],
    ),
    # the state of the grasp
    "an object that falls is lost, and one that is gripped again is held": (
        GRASP,
        [*LIFTED, *GONE, states("held", "lost"), feel(5.0), serve(5), states("lost", "held")],
    ),
    "an object that is put down is not lost": (
        GRASP,
        [
            *LIFTED,
            ask("gripper.open", drop=True),
            gripper(found=3),
            serve(50),
            *GONE,
            states("empty"),
            lambda run: set_equal({"lost"} & {body["state"] for body in run.published("grasp")}, ""),
        ],
    ),
    "a pad without readings makes the state unknown, and a fall meanwhile is a loss": (
        GRASP,
        [
            *LIFTED,
            down("left.wrench", "left.pad"),
            states("held"),  # the change is published with the next event
            tick,
            states("unknown"),
            skin(0.0, times=2),
            states("lost"),
        ],
    ),
    # the host
    "a notice of the host is shown until it ends, and incidents only where they are kept": (
        LEFT,
        [
            told(HostNotice("config", "a\nfault")),
            newest("status", notices={"config": r"a\nfault"}),
            told(HostNotice("config", "")),
            lambda run: set_equal(run.published("status")[-1]["notices"], ""),
            lambda run: set_equal({"incidents"} & set(run.published("status")[-1]), ""),
            told(IncidentsChanged(0, 0, 0, 0, "", "")),
            newest("status", incidents={"saved": 0, "not_saved": 0, "lost": 0, "dropped": 0, "path": None}),
            newest("status", incidents={"failure": None}),
            told(IncidentsChanged(2, 1, 3, 4, "/state/a.mcap", "disk full")),
            newest("status", incidents={"saved": 2, "not_saved": 1, "lost": 3, "dropped": 4}),
            newest("status", incidents={"path": "/state/a.mcap", "failure": "disk full"}),
        ],
    ),
}


def raising(*_: object) -> list[Any]:
    raise KeyError("speed")


def set_equal(found: Any, words: str) -> None:
    assert set(found) == set(words.split())


@pytest.mark.parametrize("name", COURSES)
def test_L11_a_course_of_events(name: str) -> None:
    play(*COURSES[name])


def test_farewell_is_sent_to_devices_with_commands_and_moves_nothing(run: Run) -> None:
    """A WSG treats a connection that breaks as a fault, and stops."""
    assert run.engine.farewell() == [Write("left.wrench", bota.CONFIGURE)]
    wsg = Run(WSG)
    wsg.up("gripper")
    assert wsg.engine.farewell() == [Write("gripper", wsg_messages.encode(wsg_messages.DISCONNECT))]


def test_C1_a_line_is_not_late_because_the_host_clock_is_slewed(run: Run) -> None:
    """NTP makes CLOCK_MONOTONIC run 8 % fast for a second."""
    begun_ns = run.t_ns
    for k in range(2600):
        run.t_ns = begun_ns + k * MS + min(max(0, k - 700), 1000) * MS // 12
        if k % 5 == 0:
            run.feed(Tick(raw_ns=begun_ns + k * MS))
        run.feed(Bytes("left.wrench", bota.encode_frame((0.0, 0.0, -k * 1e-6), (0.0, 0.0, 0.0), k * 1000)))
    status(streams={"left.wrench": {"clock": "locked"}})(run)
    assert run.published("slip.left")[-1]["age_s"] < 0.002


def test_D6_without_its_stream_the_weight_is_unknown_again_and_a_rig_without_an_arm_has_none() -> None:
    known, unknown = (
        status(streams={"left.wrench": {"gravity": word}}) for word in ("compensated", "unknown_orientation")
    )
    silent = newest("status", streams={"arm": {"health": Health.STALE}})
    run, bare = ArmRun(), ArmRun(ARM_RIG.replace(ARM, ""))
    run.carry_for(1100)
    follow(run, [wrench(0.0), known, wait(21), tick, unknown, wait(1000), tick, silent, ArmRun.carry, known])
    follow(bare, [wrench(0.0), unknown])
    assert "an arm stream ([grasp.arm]) removes it" in bare.stream("left.wrench")["message"]
    assert "arm" not in bare.engine.links


def test_a_command_is_written_in_the_call_that_brings_its_request_and_a_reading_is_published_in_its_own(
    run: Run,
) -> None:
    follow(run, [serve(100), ask("lease.acquire", ttl_ms=200), wait(6)])  # no poll is under way
    envelope = {"v": 1, "id": "once", "boot": "b00t", "deadline_ns": run.t_ns + MS}
    out = run.feed(Request(b"ann", envelope | {"op": "gripper.activate", "drop": True}))
    assert [type(output).__name__ for output in out] == ["Reply", "Write"]
    run.image()
    published = [output for output in run.wrench(10.0, (1.0, 0.0)) if isinstance(output, Publish)]
    assert [message.topic for message in published] == ["warning", "slip.left", "wrench.left"]
    assert {message.body["t_ns"] for message in published} == {run.t_ns}
    lost = [output.topic for output in run.down("left.wrench") if isinstance(output, Publish)]
    assert lost[0] == "warning"


def test_the_engine_lists_the_links_to_open_and_gives_a_verdict_after_the_warm_up(run: Run) -> None:
    assert {name: (spec.transport, spec.address) for name, spec in run.engine.links.items()} == {
        "left.wrench": ("serial", "/dev/left-wrench"),
        "left.pad": ("serial", "/dev/left-pad"),
        "right.pad": ("websocket", "ws://127.0.0.1:5000"),
        "gripper": ("serial", "/dev/gripper"),
    }
    warm_up()
    follow(run, [image(), wrench(10.0, (1.0, 0.0), 0.001), level("stable")])


def test_while_a_line_is_unread_after_a_stall_each_tick_looks_at_everything(run: Run) -> None:
    run.feed(Tick())
    run.engine.handle(Tick(unread=True), run.t_ns + 100 * MS)
    for deadline in run.engine._deadlines:
        deadline.due_ns = NEVER_NS
    run.engine.handle(Tick(unread=True), run.t_ns + 105 * MS)
    assert min(deadline.due_ns for deadline in run.engine._deadlines) < NEVER_NS
