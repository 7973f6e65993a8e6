"""Faults of the clocks, group C: the wall clock, the devices' clocks, a host that sleeps, lines that are late."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from engine_rig import WALL_NS
from nanoseconds import MS
from run_courses import ask, lease, status
from simulation.bed import SECOND
from simulation.edits import pad, wrench
from simulation.faults import Bunch, Chain, Delay, Edit, Split
from simulation.steps import (
    HELD,
    PAD,
    RAISE,
    STABLE,
    STALE,
    WRENCH,
    Course,
    changed,
    forget,
    play,
    recovers,
    replays,
    run,
    silent,
    strike,
    told,
)

from slipd.events import Tick

US_SPAN = 1 << 32


def clocks(change: Callable[[int, int], int], late_ms: int = 0):
    """Both devices of the left finger date their readings by another clock, on lines that are late.

    Args:
        change: ``change(us, begun_us)`` returns the time to send, µs.
        late_ms: How late.
    """

    def step(bed):
        begun_us = bed.said_ns // 1000
        for stream, edit in ((WRENCH, wrench), (PAD, pad)):
            clock = Edit(edit(clock_us=lambda us: change(us, begun_us) % US_SPAN), lies=False)
            bed.strike(Chain([clock, Delay(late_ms * MS)]) if late_ms else clock, stream)

    return step


def late(late_ns: int):
    """The lines add a time that nobody can know."""
    return lambda bed: setattr(bed.watch, "lateness_ns", late_ns)


def of_clock(clock: str, uncertain_s: float):
    """Check what is known of the clock of the force sensor: it is right to so many seconds."""
    near = pytest.approx(uncertain_s / 2, abs=uncertain_s / 2)
    return status(streams={WRENCH: {"clock": clock, "clock_uncertainty_s": near}})


def what_waits_is_lost(bed):
    for stream in (WRENCH, PAD):
        bed.line(stream).queue.clear()


def late_for_good(delay_ms: int, tick_us: int) -> Course:
    """Lines that are late for good stay stale until they are prompt again."""

    def coarse(us, _):
        return us // tick_us * tick_us

    return HELD, [
        clocks(coarse), run(0.2), clocks(coarse, delay_ms), run(0.1), forget,
        *[lease, RAISE, run(0.25 + delay_ms * 2e-4)] * 5,
        STALE, changed(), status(streams={PAD: {"clock": "delayed"}}),
        silent(f"are {delay_ms * 1e-3:.2f} s older", stream=PAD),
        clocks(coarse), what_waits_is_lost, run(0.3), status(streams={PAD: {"clock": "locked"}}),
        # otherwise the session of the force sensor gives up and configures the sensor again
        *[recovers()] * (delay_ms < 1000), replays,
    ]  # fmt: skip


COURSES: dict[str, Course] = {
    "C1 a wall clock that steps changes nothing": (
        HELD,
        [
            lease, *(
                step
                for moved_ns in (-3600 * SECOND, 3600 * SECOND)
                for step in (lambda bed, ns=moved_ns: bed.feed(Tick(wall_minus_monotonic_ns=WALL_NS + ns)), run(0.05))
            ),
            changed(), STABLE, status(lease={"held": True}), ask("grip.set", force_n=9.0), replays,
        ],
    ),
    "C2 a host that slept knows nothing and holds no lease": (
        HELD,
        [
            *(
                step
                for slept_s, shift_s in ((1, 1), (3600, 3601))
                for step in (
                    lease, lambda bed, s=slept_s: bed.suspend(s), clocks(lambda us, _, s=shift_s: us + s * 1_000_000),
                    forget, run(0.006), status(lease={"held": False}), told("left", "unknown"), recovers(),
                    ask("grip.set", ("no_lease", ""), force_n=9.0),
                )
            ),
            replays,
        ],
    ),
    **{
        f"C3 a clock that drifts by {ppm} ppm is learned and its readings keep their place": (
            HELD,
            [
                clocks(lambda us, begun_us, ppm=ppm: us + (us - begun_us) * ppm // 1_000_000), run(1.5), STABLE,
                of_clock("locked", 5e-3),
            ],
        )
        for ppm in (-500, 500)
    },
    "C3 a clock that begins anew is learned again within a second": (
        HELD, [clocks(lambda us, begun_us: us - begun_us), run(1.0), STABLE, of_clock("locked", 5e-3)],
    ),
    "L12 a bunched stream keeps its verdict and is dated by its device clock": (
        HELD,
        [
            strike(lambda rng: Chain([Bunch(), Split(rng, most=400)])), late(Bunch.period_ns), run(1.2), changed(),
            STABLE, of_clock("locked", 0.016),
        ],
    ),
    "F1 lines that are late by 60 ms for good": late_for_good(60, 1),
}  # fmt: skip
LONG = {f"F1 lines that are late by {ms} ms": late_for_good(ms, us) for ms, us in ((200, 1000), (500, 1), (3000, 1000))}


@pytest.mark.parametrize("name", [*COURSES, *(pytest.param(name, marks=pytest.mark.long) for name in LONG)])
def test_C1_C2_C3_F1_L12_a_fault_of_a_clock(name):
    play((COURSES | LONG)[name])
