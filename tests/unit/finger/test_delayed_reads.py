"""Force readings that wait for the image of their time after the daemon stood still from T0 on."""

from __future__ import annotations

import pytest
from finger_bench import MS, T0, Image, Wrench, read_force

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.freshness import Arrival

STALE_NS, IMAGE_STALE_NS = 20 * MS, 30 * MS


class Stalled:
    """A finger that held with a stable grip at T0; times are in ms after that."""

    def __init__(self, finger: Finger, wrench: Wrench, image: Image) -> None:
        self.finger, self._wrench, self._image = finger, wrench, image
        self.look(0.0, 0.0, None)
        assert read_force(finger, wrench(T0, 10.0)).verdict.level == "stable"

    def read(self, read_ms: float, acquired_ms: float, arrival: Arrival | None = None) -> list[FingerState]:
        """Read a force that waited, since T0 if nothing else is said; return the verdicts that it brings at once."""
        received_ns = T0 + round(read_ms * MS)
        arrival = arrival or Arrival(round(read_ms * MS), round(read_ms * MS))
        batches = self.finger.decide([self._wrench(received_ns, 10.0)], [T0 + round(acquired_ms * MS)], arrival)
        return [state for batch in batches for state in batch]

    def look(self, read_ms: float, acquired_ms: float, waited_ms: float | None, *, dated: bool = True) -> None:
        """Read an image."""
        arrival = Arrival() if waited_ms is None else Arrival(round(waited_ms * MS), round(waited_ms * MS), dated)
        shown = self._image(T0 + round(read_ms * MS))
        self.finger.update_image(shown, T0 + round(acquired_ms * MS), arrival)

    def release(self, ms: float, unread_ms: float | None = None) -> list[FingerState]:
        """Return the verdicts on readings that wait no longer."""
        unread_ns = None if unread_ms is None else round(unread_ms * MS)
        return [state for batch in self.finger.decide_delayed(T0 + round(ms * MS), unread_ns) for state in batch]


@pytest.fixture
def stalled(finger: Finger, wrench: Wrench, image: Image) -> Stalled:
    return Stalled(finger, wrench, image)


def test_reading_of_the_time_of_the_image_is_not_delayed(stalled: Stalled) -> None:
    (state,) = stalled.read(200, 30)
    assert (state.verdict.level, state.age_s) == ("stable", pytest.approx(0.17))


def test_later_readings_wait_for_their_image_in_their_order(stalled: Stalled) -> None:
    assert stalled.read(200, 100) == stalled.read(201, 120) == stalled.release(202, 202) == []
    assert stalled.finger.check_silence(T0 + 202 * MS, 202 * MS) is None
    stalled.look(203, 75, 203)
    (state,) = stalled.release(203, 203)
    assert (state.t_ns, state.verdict.level) == (T0 + 100 * MS, "stable")
    assert state.age_s == pytest.approx(0.103), "its age when it is reported"
    prompt = stalled.read(210, 210, Arrival())
    assert [state.t_ns for state in prompt] == [T0 + 120 * MS, T0 + 210 * MS], "a prompt one overtakes none"


def test_reading_is_decided_without_image_once_the_lines_are_empty_and_dropped_with_its_stream(
    stalled: Stalled,
) -> None:
    assert stalled.read(200, 100) == []
    (state,) = stalled.release(202)
    assert state.verdict.reasons == ("rotation_unobserved",)
    stalled.look(203, 203, None)
    assert stalled.read(300, 250, Arrival(90 * MS, 90 * MS)) == []
    stalled.finger.disconnect(T0 + 301 * MS)
    assert stalled.release(302) == []


def test_reading_does_not_wait_for_a_pad_that_was_silent_before(stalled: Stalled, wrench: Wrench) -> None:
    for ms in range(1, 40):
        read_force(stalled.finger, wrench(T0 + ms * MS, 10.0))
    (state,) = stalled.read(200, 100, Arrival(160 * MS, 160 * MS))
    assert state.verdict.reasons == ("rotation_unobserved",)


def test_image_without_device_time_serves_readings_received_with_it(stalled: Stalled) -> None:
    assert stalled.read(200, 100) == []
    stalled.look(201, 1, 201, dated=False)
    assert [state.verdict.level for state in stalled.release(201, 201)] == ["stable"]


def test_reading_is_not_decided_on_an_image_too_old_for_it(stalled: Stalled) -> None:
    """The daemon is overloaded: its lines are not empty, and are waited for no longer."""
    stalled.look(20, 0, None)
    levels = [stalled.read(45, acquired_ms, Arrival(45 * MS, 0))[0].verdict.level for acquired_ms in (30, 31)]
    assert levels == ["stable", "unknown"]


def test_stall_does_not_excuse_an_image_that_was_too_old_before(stalled: Stalled) -> None:
    stalled.look(1, 1 - (IMAGE_STALE_NS + 1) / MS, None)
    assert stalled.read(200, 20)[0].verdict.reasons == ("rotation_unobserved",)
    stalled.look(201, 100, 201)
    assert stalled.read(202, 101)[0].verdict.reasons == ("rotation_unobserved",)


def test_C4_reading_older_than_its_wait_explains_is_stale(stalled: Stalled) -> None:
    for acquired_ns, level in ((-STALE_NS, "stable"), (-STALE_NS - 1, "unknown"), (0, "unknown")):
        (state,) = stalled.read(100, acquired_ns / MS)
        assert state.verdict.level == level, "a stale stream recovers with its first prompt reading"


def test_C4_wait_of_a_stream_without_clock_is_no_gap_of_it(stalled: Stalled) -> None:
    """Time seems to stand still for its readings, and then to jump."""
    for ms in range(1, 800, 200):
        waited = Arrival(99 * MS, 0, dated=False)
        assert len(stalled.read(ms + 100, ms, waited)) == 1
        for k in range(1, 100):
            stalled.read(ms + 100 + k, ms + 100 + k, Arrival())
        assert stalled.finger.force.fault == ""


def test_C4_stream_without_clock_recovers_before_the_lines_are_empty(stalled: Stalled) -> None:
    """Nothing shows that the stream was late itself, and an overloaded daemon may not see its lines empty for long."""
    undated = Arrival(100 * MS, 0, dated=False)
    stalled.look(200, 100, 100, dated=False)
    (state,) = stalled.read(200, 100, undated)
    assert (state.verdict.level, state.age_s) == ("stable", pytest.approx(0.1))
    assert not stalled.finger.trust.for_raise(T0 + 200 * MS)
