"""Force readings that wait for the image of their time after the daemon stood still from T0 on; silence and age."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest
from finger_bench import read_force
from fixture_types import Image, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.freshness import PROMPT, Arrival, Freshness, Read

STALE_MS, IMAGE_STALE_MS = 20, 30
Step = Callable[["Stalled"], object]


class Stalled:
    """A finger that held with a stable grip at T0; times are in ms after that."""

    def __init__(self, finger: Finger, wrench: Wrench, image: Image) -> None:
        self.finger, self.wrench, self.image = finger, wrench, image
        look(0.0, 0.0)(self)
        assert read_force(finger, wrench(T0, 10.0)).verdict.level == "stable"


def ns(ms: float) -> int:
    return round(ms * MS)


def said(states: Iterable[FingerState]) -> list[tuple[float, str, float]]:
    """Return when each reading was acquired, its level or first reason, and its age, ms."""
    return [
        ((state.t_ns - T0) / MS, (*state.verdict.reasons, state.verdict.level)[0], pytest.approx(1e3 * state.age_s))
        for state in states
    ]


def read(
    read_ms: float, acquired_ms: float, *expected: tuple[float, str, float], waited_ms: float | None = None,
    late_ms: float | None = None, dated: bool = True,
) -> Step:  # fmt: skip
    """Read a force that waited, since T0 if nothing else is said; check the verdicts that it brings at once."""

    def step(stalled: Stalled) -> None:
        waited = ns(read_ms if waited_ms is None else waited_ms)
        arrival = Arrival(waited, waited if late_ms is None else ns(late_ms), dated)
        sample = stalled.wrench(T0 + ns(read_ms), 10.0)
        batches = stalled.finger.decide(Read([sample], [T0 + ns(acquired_ms)], arrival))
        assert said(state for batch in batches for state in batch) == list(expected)

    return step


def look(read_ms: float, acquired_ms: float, waited_ms: float | None = None, *, dated: bool = True) -> Step:
    """Read an image."""
    arrival = Arrival() if waited_ms is None else Arrival(ns(waited_ms), ns(waited_ms), dated)
    return lambda stalled: stalled.finger.update_image(stalled.image(T0 + ns(read_ms)), T0 + ns(acquired_ms), arrival)


def release(ms: float, *expected: tuple[float, str, float], unread_ms: float | None = None) -> Step:
    """Check the verdicts on readings that wait no longer."""

    def step(stalled: Stalled) -> None:
        batches = stalled.finger.decide_delayed(T0 + ns(ms), None if unread_ms is None else ns(unread_ms))
        assert said(state for batch in batches for state in batch) == list(expected)

    return step


def quiet(ms: float) -> Step:
    """Check that no silence is noticed while readings wait."""

    def step(stalled: Stalled) -> None:
        assert stalled.finger.check_silence(T0 + ns(ms), ns(ms)) is None
        assert stalled.finger.quiet_until_ns(T0 + ns(ms)) == -1

    return step


def prompt(first_ms: int, last_ms: int) -> Step:
    """Read a force each millisecond, at once."""
    return lambda stalled: [
        read_force(stalled.finger, stalled.wrench(T0 + ns(k), 10.0)) for k in range(first_ms, last_ms)
    ]


def not_raised(stalled: Stalled) -> None:
    assert not stalled.finger.trust.for_raise(T0 + 200 * MS)


def no_gap(stalled: Stalled) -> None:
    assert stalled.finger.force.fault == ""


BLIND = "rotation_unobserved"
COURSES: dict[str, list[Step]] = {
    "a reading of the time of the image is not delayed": [read(200, 30, (30, "stable", 170))],
    "later readings wait for their image in their order, and a prompt one overtakes none": [
        read(200, 100), read(201, 120), release(202, unread_ms=202), quiet(202), look(203, 75, 203),
        release(203, (100, "stable", 103), unread_ms=203),
        read(210, 210, (120, BLIND, 90), (210, "stable", 0), waited_ms=0.0),
    ],
    "a reading is decided without image once the lines are empty, and dropped with its stream": [
        read(200, 100), release(202, (100, BLIND, 102)), look(203, 203), read(300, 250, waited_ms=90),
        lambda stalled: stalled.finger.disconnect(T0 + 301 * MS), release(302),
    ],
    "a reading does not wait for a pad that was silent before": [
        prompt(1, 40), read(200, 100, (100, BLIND, 100), waited_ms=160),
    ],
    "an image without device time serves the readings that were received with it": [
        read(200, 100), look(201, 1, 201, dated=False), release(201, (100, "stable", 101), unread_ms=201),
    ],
    # the daemon is overloaded: its lines are not empty, and are waited for no longer
    "a reading is not decided on an image too old for it": [
        look(20, 0), read(45, 30, (30, "stable", 15), waited_ms=45, late_ms=0),
        read(45, 31, (31, BLIND, 14), waited_ms=45, late_ms=0),
    ],
    "a stall does not excuse an image that was too old before": [
        look(1, -IMAGE_STALE_MS - 1e-6), read(200, 20, (20, BLIND, 180)), look(201, 100, 201),
        read(202, 101, (101, BLIND, 101)),
    ],
    "C4 a reading older than its wait explains is stale, and the stream recovers with its first prompt one": [
        read(100, -STALE_MS, (-STALE_MS, "stable", 120)),
        read(100, -STALE_MS - 1e-6, (-STALE_MS - 1e-6, "stale", 120)), read(100, 0, (0, "stale", 100)),
    ],
    # time seems to stand still for its readings, and then to jump
    "C4 the wait of a stream without clock is no gap of it": [
        step
        for ms in range(1, 800, 200)
        for step in (
            lambda stalled, ms=ms: list(stalled.finger.decide(Read(
                [stalled.wrench(T0 + ns(ms + 100), 10.0)], [T0 + ns(ms)], Arrival(ns(99), 0, dated=False)))),
            prompt(ms + 101, ms + 200), no_gap,
        )
    ],
    # nothing shows that it was late itself, and an overloaded daemon may not see its lines empty for long
    "C4 a stream without clock recovers before the lines are empty, but raises no grip": [
        look(200, 100, 100, dated=False),
        read(200, 100, (100, "stable", 100), waited_ms=100, late_ms=0, dated=False), not_raised,
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_C4_a_course_of_reads_after_a_stall(finger: Finger, wrench: Wrench, image: Image, name: str) -> None:
    stalled = Stalled(finger, wrench, image)
    for step in COURSES[name]:
        step(stalled)


@pytest.mark.parametrize(
    ("arrival", "came_ms", "late"),
    [(PROMPT, 0, True), (Arrival(500 * MS), -80, False), (Arrival(500 * MS, dated=False), 0, False)],
)
def test_a_reading_that_waited_came_within_the_limit_of_its_acquisition(
    arrival: Arrival, came_ms: int, late: bool
) -> None:
    freshness, limit_ns = Freshness(STALE_MS * MS), STALE_MS * MS
    assert (freshness.is_stale(T0), freshness.silent_ns(T0)) == (True, 0), "stale, but not silent, before the first"
    freshness.update(T0, T0 - 100 * MS, arrival)
    came_ns = T0 + came_ms * MS
    assert (freshness.came_ns, freshness.silent_ns(T0)) == (came_ns, T0 - came_ns), "its line is empty"
    assert freshness.late == late, "by more than it waited"
    assert [freshness.is_stale(came_ns + limit_ns + more) for more in (0, 1)] == [False, True]
    for unread_ns in (0, 300 * MS):  # readings that wait are not late before they are read
        assert freshness.silent_ns(T0 + unread_ns, unread_ns) == 0
        assert [freshness.is_stale(T0 + unread_ns + limit_ns + k, unread_ns) for k in (0, 1)] == [False, True]
