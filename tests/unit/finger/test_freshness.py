"""Silence and age of one stream, and readings that wait for the image of their time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from force_readings import read_force

from slipd.config import Config, Levels
from slipd.finger.finger import Finger
from slipd.finger.freshness import PROMPT, Arrival, Freshness
from slipd.samples import TactileSample, WrenchSample

MS = 1_000_000
T0 = 100_000_000_000
STALE_NS = 20 * MS
IMAGE_STALE_NS = 30 * MS

Wrench = Callable[..., WrenchSample]
Image = Callable[..., TactileSample]


def test_before_the_first_reading_a_stream_is_stale_and_not_silent() -> None:
    freshness = Freshness(STALE_NS)
    assert freshness.is_stale(T0)
    assert freshness.silent_ns(T0) == 0


@pytest.mark.parametrize(
    ("arrival", "came_ns"),
    [
        (PROMPT, T0),
        (Arrival(500 * MS), T0 - 80 * MS),
        (Arrival(500 * MS, dated=False), T0),
    ],
)
def test_a_reading_that_waited_came_soon_after_its_acquisition_where_that_is_known(
    arrival: Arrival, came_ns: int
) -> None:
    freshness = Freshness(STALE_NS)
    freshness.update(T0, T0 - 100 * MS, arrival)
    assert freshness.came_ns == came_ns
    assert freshness.silent_ns(T0) == T0 - came_ns, "its line is empty"
    assert not freshness.is_stale(came_ns + STALE_NS)
    assert freshness.is_stale(came_ns + STALE_NS + 1)
    for unread_ns in (0, 300 * MS):  # what comes next is not late before it is read
        assert freshness.silent_ns(T0 + unread_ns, unread_ns) == 0
        assert not freshness.is_stale(T0 + unread_ns + STALE_NS, unread_ns)
        assert freshness.is_stale(T0 + unread_ns + STALE_NS + 1, unread_ns)


class TestHeldReadings:
    """The daemon stood still from T0 on; a force reading is read first, and its image afterwards."""

    @pytest.fixture
    def finger(self, left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image) -> Finger:
        finger = Finger("left", parse(left).finger["left"], Levels())
        finger.update_image(image(T0))
        read_force(finger, wrench(T0, 10.0))
        assert finger.state.verdict.level == "stable"
        return finger

    def late(self, finger: Finger, wrench: Wrench, read_ms: int, acquired_ms: int) -> int:
        """Verdicts that a reading brings at once."""
        sample = wrench(T0 + read_ms * MS, 10.0)
        arrival = Arrival(read_ms * MS, read_ms * MS)
        return len(list(finger.decide([sample], [T0 + acquired_ms * MS], arrival)))

    def test_one_that_the_image_serves_is_judged_at_once(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 30) == 1
        assert finger.state.verdict.level == "stable"
        assert finger.state.age_s == pytest.approx(0.17)

    def test_a_later_one_waits_for_its_image_and_so_do_those_behind_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        assert self.late(finger, wrench, 201, 120) == 0
        assert list(finger.decide_held(T0 + 202 * MS, 202 * MS)) == []
        assert finger.check_silence(T0 + 202 * MS, 202 * MS) is None
        finger.update_image(image(T0 + 203 * MS), T0 + 75 * MS, Arrival(203 * MS, 203 * MS))
        (judged,) = finger.decide_held(T0 + 203 * MS, 203 * MS)
        assert (judged[0].t_ns, judged[0].verdict.level) == (T0 + 100 * MS, "stable")
        assert judged[0].age_s == pytest.approx(0.103), "its age when it is told"
        finger.update_image(image(T0 + 204 * MS), T0 + 110 * MS, Arrival(204 * MS, 204 * MS))
        assert len(list(finger.decide_held(T0 + 204 * MS, 204 * MS))) == 1

    def test_a_prompt_one_does_not_overtake_it(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        prompt = wrench(T0 + 210 * MS, 10.0)
        judged = list(finger.decide([prompt], [T0 + 210 * MS]))
        assert [state[0].t_ns for state in judged] == [T0 + 100 * MS, T0 + 210 * MS]

    def test_once_the_lines_are_empty_it_is_judged_without_an_image(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        (judged,) = finger.decide_held(T0 + 202 * MS)
        assert judged[0].verdict.reasons == ("rotation_unobserved",)

    def test_it_waits_for_no_pad_that_was_silent_before(self, finger: Finger, wrench: Wrench) -> None:
        for ms in range(1, 40):
            read_force(finger, wrench(T0 + ms * MS, 10.0))
        sample = wrench(T0 + 200 * MS, 10.0)
        arrival = Arrival(160 * MS, 160 * MS)
        (judged,) = finger.decide([sample], [T0 + 100 * MS], arrival)
        assert judged[0].verdict.reasons == ("rotation_unobserved",)

    def test_an_image_without_a_time_of_its_own_serves_what_is_read_with_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        undated = Arrival(201 * MS, 201 * MS, dated=False)
        finger.update_image(image(T0 + 201 * MS), T0 + 1 * MS, undated)
        (judged,) = finger.decide_held(T0 + 201 * MS, 201 * MS)
        assert judged[0].verdict.level == "stable"

    def test_one_that_waited_is_never_judged_on_an_image_that_is_too_old_for_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        """The daemon is overloaded: its lines are not empty, and are waited for no longer."""
        finger.update_image(image(T0 + 20 * MS), T0)
        sample = wrench(T0 + 45 * MS, 10.0)
        for acquired_ms, level in ((30, "stable"), (31, "unknown")):
            (judged,) = finger.decide([sample], [T0 + acquired_ms * MS], Arrival(45 * MS, 0))
            assert judged[0].verdict.level == level

    def test_it_is_forgotten_with_its_stream(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        finger.disconnect(T0 + 201 * MS)
        assert list(finger.decide_held(T0 + 202 * MS)) == []

    def test_an_image_that_was_too_old_before_the_stall_is_not_excused_by_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        finger.update_image(image(T0 + 1 * MS), T0 + 1 * MS - IMAGE_STALE_NS - 1)
        assert self.late(finger, wrench, 200, 20) == 1
        assert finger.state.verdict.reasons == ("rotation_unobserved",)
        finger.update_image(image(T0 + 201 * MS), T0 + 100 * MS, Arrival(201 * MS, 201 * MS))
        assert self.late(finger, wrench, 202, 101) == 1
        assert finger.state.verdict.reasons == ("rotation_unobserved",)


def test_C4_a_reading_is_stale_that_was_late_beyond_what_it_waited(
    left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image
) -> None:
    finger = Finger("left", parse(left).finger["left"], Levels())
    finger.update_image(image(T0))
    read_force(finger, wrench(T0, 10.0))
    arrival = Arrival(100 * MS, 100 * MS)
    for acquired_ns, level in ((T0 - STALE_NS, "stable"), (T0 - STALE_NS - 1, "unknown"), (T0, "unknown")):
        (judged,) = finger.decide([wrench(T0 + 100 * MS, 10.0)], [acquired_ns], arrival)
        assert judged[0].verdict.level == level, "one that is stale is believed again with its first prompt reading"
    assert read_force(finger, wrench(T0 + 101 * MS, 10.0)).contact is not None
    assert np.isfinite(finger.age_s(T0 + 101 * MS) or 0.0)


def test_C4_a_stream_without_a_clock_did_not_fail_while_the_daemon_stood_still(
    left: str, parse: Callable[[str], Config], wrench: Wrench
) -> None:
    finger = Finger("left", parse(left).finger["left"], Levels())
    assert finger.force is not None
    for stall in range(4):
        t_ns = T0 + stall * 200 * MS
        read_force(finger, wrench(t_ns, 10.0))
        undated = Arrival(100 * MS, 100 * MS, dated=False)
        assert len(list(finger.decide([wrench(t_ns + 100 * MS, 10.1)], [t_ns + MS], undated))) == 1
        for ms in range(101, 200):
            read_force(finger, wrench(t_ns + ms * MS, 10.0 + ms / 1000))
        assert finger.force.fault == ""


def test_C4_a_stream_without_a_clock_is_believed_again_before_the_lines_are_empty(
    left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image
) -> None:
    """Nothing shows that it was late itself, and an overloaded daemon may not see its lines empty for long."""
    finger = Finger("left", parse(left).finger["left"], Levels())
    undated = Arrival(100 * MS, 0, dated=False)
    finger.update_image(image(T0), T0 - 100 * MS, undated)
    (judged,) = finger.decide([wrench(T0, 10.0)], [T0 - 100 * MS], undated)
    assert (judged[0].verdict.level, judged[0].age_s) == ("stable", pytest.approx(0.1))
    assert not finger.is_trusted_for_raise(T0)
