"""Force readings that wait for the image of their time after the daemon stood still."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import MS, T0, Image, Wrench, make_finger, read_force

from slipd.config import Config
from slipd.finger.finger import Finger
from slipd.finger.freshness import Arrival

STALE_NS, IMAGE_STALE_NS = 20 * MS, 30 * MS


class TestDelayedReads:
    """The daemon stood still from T0 on; a force reading is read first, and its image afterwards."""

    @pytest.fixture
    def finger(self, left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image) -> Finger:
        finger = make_finger(left, parse)
        finger.update_image(image(T0))
        read_force(finger, wrench(T0, 10.0))
        assert finger.state.verdict.level == "stable"
        return finger

    def late(self, finger: Finger, wrench: Wrench, read_ms: int, acquired_ms: int) -> int:
        """Verdicts that a reading brings at once."""
        sample = wrench(T0 + read_ms * MS, 10.0)
        arrival = Arrival(read_ms * MS, read_ms * MS)
        return len(list(finger.decide([sample], [T0 + acquired_ms * MS], arrival)))

    def test_reading_of_the_time_of_the_image_is_not_delayed(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 30) == 1
        assert finger.state.verdict.level == "stable"
        assert finger.state.age_s == pytest.approx(0.17)

    def test_later_reading_waits_for_its_image_with_those_behind_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        assert self.late(finger, wrench, 201, 120) == 0
        assert list(finger.decide_delayed(T0 + 202 * MS, 202 * MS)) == []
        assert finger.check_silence(T0 + 202 * MS, 202 * MS) is None
        finger.update_image(image(T0 + 203 * MS), T0 + 75 * MS, Arrival(203 * MS, 203 * MS))
        (batch,) = finger.decide_delayed(T0 + 203 * MS, 203 * MS)
        assert (batch[0].t_ns, batch[0].verdict.level) == (T0 + 100 * MS, "stable")
        assert batch[0].age_s == pytest.approx(0.103), "its age when it is reported"
        finger.update_image(image(T0 + 204 * MS), T0 + 110 * MS, Arrival(204 * MS, 204 * MS))
        assert len(list(finger.decide_delayed(T0 + 204 * MS, 204 * MS))) == 1

    def test_prompt_reading_does_not_overtake_held_ones(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        prompt = wrench(T0 + 210 * MS, 10.0)
        batch = list(finger.decide([prompt], [T0 + 210 * MS]))
        assert [state[0].t_ns for state in batch] == [T0 + 100 * MS, T0 + 210 * MS]

    def test_held_reading_is_decided_without_image_once_the_lines_are_empty(
        self, finger: Finger, wrench: Wrench
    ) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        (batch,) = finger.decide_delayed(T0 + 202 * MS)
        assert batch[0].verdict.reasons == ("rotation_unobserved",)

    def test_reading_does_not_wait_for_a_pad_that_was_silent_before(self, finger: Finger, wrench: Wrench) -> None:
        for ms in range(1, 40):
            read_force(finger, wrench(T0 + ms * MS, 10.0))
        sample = wrench(T0 + 200 * MS, 10.0)
        arrival = Arrival(160 * MS, 160 * MS)
        (batch,) = finger.decide([sample], [T0 + 100 * MS], arrival)
        assert batch[0].verdict.reasons == ("rotation_unobserved",)

    def test_image_without_device_time_serves_readings_received_with_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        undated = Arrival(201 * MS, 201 * MS, dated=False)
        finger.update_image(image(T0 + 201 * MS), T0 + 1 * MS, undated)
        (batch,) = finger.decide_delayed(T0 + 201 * MS, 201 * MS)
        assert batch[0].verdict.level == "stable"

    def test_held_reading_is_not_decided_on_an_image_too_old_for_it(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        """The daemon is overloaded: its lines are not empty, and are waited for no longer."""
        finger.update_image(image(T0 + 20 * MS), T0)
        sample = wrench(T0 + 45 * MS, 10.0)
        for acquired_ms, level in ((30, "stable"), (31, "unknown")):
            (batch,) = finger.decide([sample], [T0 + acquired_ms * MS], Arrival(45 * MS, 0))
            assert batch[0].verdict.level == level

    def test_held_reading_is_dropped_with_its_stream(self, finger: Finger, wrench: Wrench) -> None:
        assert self.late(finger, wrench, 200, 100) == 0
        finger.disconnect(T0 + 201 * MS)
        assert list(finger.decide_delayed(T0 + 202 * MS)) == []

    def test_stall_does_not_excuse_an_image_that_was_too_old_before(
        self, finger: Finger, wrench: Wrench, image: Image
    ) -> None:
        finger.update_image(image(T0 + 1 * MS), T0 + 1 * MS - IMAGE_STALE_NS - 1)
        assert self.late(finger, wrench, 200, 20) == 1
        assert finger.state.verdict.reasons == ("rotation_unobserved",)
        finger.update_image(image(T0 + 201 * MS), T0 + 100 * MS, Arrival(201 * MS, 201 * MS))
        assert self.late(finger, wrench, 202, 101) == 1
        assert finger.state.verdict.reasons == ("rotation_unobserved",)


def test_C4_reading_older_than_its_wait_explains_is_stale(
    left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image
) -> None:
    finger = make_finger(left, parse)
    finger.update_image(image(T0))
    read_force(finger, wrench(T0, 10.0))
    arrival = Arrival(100 * MS, 100 * MS)
    for acquired_ns, level in ((T0 - STALE_NS, "stable"), (T0 - STALE_NS - 1, "unknown"), (T0, "unknown")):
        (batch,) = finger.decide([wrench(T0 + 100 * MS, 10.0)], [acquired_ns], arrival)
        assert batch[0].verdict.level == level, "a stale stream recovers with its first prompt reading"
    assert read_force(finger, wrench(T0 + 101 * MS, 10.0)).contact is not None
    assert np.isfinite(finger.age_s(T0 + 101 * MS) or 0.0)


def test_C4_stall_of_the_daemon_is_no_gap_of_a_stream_without_clock(
    left: str, parse: Callable[[str], Config], wrench: Wrench
) -> None:
    finger = make_finger(left, parse)
    assert finger.force is not None
    for stall in range(4):
        t_ns = T0 + stall * 200 * MS
        read_force(finger, wrench(t_ns, 10.0))
        undated = Arrival(100 * MS, 100 * MS, dated=False)
        assert len(list(finger.decide([wrench(t_ns + 100 * MS, 10.1)], [t_ns + MS], undated))) == 1
        for ms in range(101, 200):
            read_force(finger, wrench(t_ns + ms * MS, 10.0 + ms / 1000))
        assert finger.force.fault == ""


def test_C4_stream_without_clock_recovers_before_the_lines_are_empty(
    left: str, parse: Callable[[str], Config], wrench: Wrench, image: Image
) -> None:
    """Nothing shows that the stream was late itself, and an overloaded daemon may not see its lines empty for long."""
    finger = make_finger(left, parse)
    undated = Arrival(100 * MS, 0, dated=False)
    finger.update_image(image(T0), T0 - 100 * MS, undated)
    (batch,) = finger.decide([wrench(T0, 10.0)], [T0 - 100 * MS], undated)
    assert (batch[0].verdict.level, batch[0].age_s) == ("stable", pytest.approx(0.1))
    assert not finger.is_trusted_for_raise(T0)
