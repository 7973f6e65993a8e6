"""A stalled daemon is distinguished from a sensor that really falls silent."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable

import pytest
from nanoseconds import MS
from run_courses import Step, ask, follow, health, lease, status
from simulation.bed import FINGERS
from simulation.edits import wrench
from simulation.faults import Delay, Drop, Edit
from simulation.slow_reader import SlowReader
from simulation.steps import (
    BLIND,
    OTHER_STABLE,
    PAD,
    STABLE,
    STALE,
    WRENCH,
    Course,
    changed,
    excuse,
    forget,
    hold,
    play,
    replays,
    run,
    strike,
    told,
    unwell,
)
from simulation.watch import STALE_NS

from slipd.finger.freshness import LEAST_CATCH_UP_NS
from slipd_client.messages import Health

STALLS_MS = [5, 12, 21, 30, 60, 150, 500]
LOST = changed(("left", "unknown"))
"""The other finger's sensor went on."""


@functools.cache
def held() -> SlowReader:
    """A bed that holds the box, its clocks learned."""
    bed = SlowReader(1)
    follow(bed, [hold, run(0.3), status(streams={WRENCH: {"clock": "locked"}}), forget])
    return bed


def slow(**how: bool) -> Callable[[], SlowReader]:
    """Return what makes a bed whose loop reads so, see `SlowReader`."""

    def make() -> SlowReader:
        bed = copy.deepcopy(held())
        vars(bed).update(how)
        return bed

    return make


catch_up: Step = SlowReader.catch_up
go_on: Step = SlowReader.go_on


def stop(ms: float) -> Step:
    return lambda bed: bed.stop(ms)


def stall(ms: float) -> Step:
    return lambda bed: bed.stall(ms / 1000)


def never_catches_up(seconds: float, *, while_known: bool = False) -> Step:
    """The loop is late again and again; the left finger becomes unknown before the end, or does not."""

    def step(bed: SlowReader) -> None:
        until_ns = bed.t_ns + seconds * 1e9
        while bed.t_ns < until_ns and not (while_known and bed.level()[0] == "unknown"):
            bed.stall(0.015)
            bed.step()
        assert (bed.t_ns < until_ns) is while_known

    return step


STALLS: list[Step] = [step for ms in STALLS_MS for step in (stall(ms), run(0.1), changed())]
# a clock that runs backwards is no clock; readings with such a clock count as untrue
NO_CLOCK = strike(Edit(wrench(clock_us=lambda us: 2**32 - us)), *(f"{finger}.wrench" for finger in FINGERS))
ORDERS = [{"tick_first": tick, "force_first": force} for tick in (False, True) for force in (False, True)]
LATE, LATER = "the daemon was late", (WRENCH, "right.pad")
CATCH_UP_S = LEAST_CATCH_UP_NS * 1e-9
COURSES: dict[str, Course] = {
    **{
        f"C4 a daemon that stood still does not call its sensors silent: {order}": (
            slow(**order), [*STALLS, *[replays] * (order == ORDERS[-1])],
        )
        for order in ORDERS
    },
    "C4 the same holds for devices without a clock": (
        slow(),
        [
            NO_CLOCK, run(0.2), status(streams={WRENCH: {"clock": "not_a_clock"}}), forget, *STALLS, unwell(LATE),
            health(WRENCH, severity=Health.WARN, without="failed"),  # it is no sensor that comes and goes
            excuse,
        ],
    ),
    **{
        f"C4 F1 {stream} that stopped in {ms} ms is missed as soon as its line is empty: {tick_first}, {force_first}": (
            slow(tick_first=tick_first, force_first=force_first),
            [
                # how long the last reading took to the host, nobody knows
                lambda bed, ms=ms: setattr(bed.watch, "lateness_ns", STALE_NS if ms < 50 else 0), stop(ms * 0.1),
                strike(Drop, stream), stop(ms * 0.9), go_on, catch_up,
                run(0.005 if stream == WRENCH and ms > 50 else 0.03), found, LOST,
            ],
        )
        for stream, found, ms, tick_first in (
            (WRENCH, STALE, 30, False), (WRENCH, STALE, 150, True), (WRENCH, STALE, 500, False),
            (PAD, BLIND, 60, False), (PAD, BLIND, 500, False),
        )
        for force_first in (False, True)
    },
    **{
        f"C4 F1 A7 no grip is raised on what a late daemon has not read: {ms} ms": (
            slow(),
            [
                *broken, stop(ms), lease, ask("grip.set", "left", force_n=9.0),
                ask("grip.set", ("not_ready", "force_n"), force_n=9.0),
                STABLE,  # whether readings are missing is not known yet
                go_on, run(0.2), lease, ask("grip.set", refused, force_n=9.0),
            ],
        )
        for ms, broken, refused in (
            (30, [], None), (150, [strike(Drop, WRENCH)], ("not_ready", "force_n")),
        )
    },
    "C4 a line that was late already is not excused": (
        slow(),
        [
            strike(Delay(150 * MS), WRENCH), run(0.5), STALE, forget, stall(300), catch_up,
            told("left", "stable", ever=False),
        ],
    ),
    "C4 P3 a daemon that never catches up calls no sensor silent whose readings it reads": (
        slow(overloaded=True), [never_catches_up(6 * CATCH_UP_S), changed()],
    ),
    **{
        f"C4 P3 a dead sensor does not hide behind a daemon that never catches up: {stream}": (
            slow(overloaded=True),
            [strike(Drop, stream), never_catches_up(2 * CATCH_UP_S, while_known=True), found, OTHER_STABLE],
        )
        for stream, found in ((WRENCH, STALE), (PAD, BLIND))
    },
    "C4 the health of a stream names the late daemon and not the sensor": (
        slow(),
        [
            stall(300), run(0.1),
            *(unwell(f"{LATE} by 0.30 s: readings waited, the sensor went on", stream=name) for name in LATER),
            run(2.0), status(streams={WRENCH: {"health": Health.OK, "message": ""}}),
        ],
    ),
    "C4 a lease is judged by the time that passed": (
        slow(), [lease, stall(300), catch_up, ask("grip.set", ("no_lease", ""), force_n=9.0)],
    ),
    "C2 C4 after a suspend all is unknown even if readings wait": (
        slow(tick_first=True),
        [
            stop(50), lambda bed: bed.suspend(10.0), go_on, changed(("left", "unknown"), ("right", "unknown")), STALE,
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_A7_C2_C4_F1_P3_a_course_of_a_late_daemon(name: str) -> None:
    play(COURSES[name])
