"""Advice on the motion of the arm: what is not known, or old, is never full speed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest
from scipy.spatial.transform import Rotation

from slipd_client.aio import AsyncMotionAdvisor
from slipd_client.errors import CallError
from slipd_client.motion import STALE_S, MotionAdvisor, point_of

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

NEEDED = {"safety": 1.25, "wanted_acceleration_mps2": 3.0}
REPLY = {
    "utilisation": 1.2,
    "at_s": 0.3,
    "finger": "left",
    "mode": "translation",
    "grip_needed_n": 9.0,
    "time_scale": 0.8,
}


class Sender:
    """Publishes advice; each message has a number of its own."""

    def __init__(self, publisher: Publisher) -> None:
        self.publisher, self.seq = publisher, 0

    def send(self, **fields: Any) -> None:
        self.seq += 1
        self.publisher.send("motion", self.seq, **NEEDED | fields)


def received(advisor: Any, sender: Sender, **fields: Any) -> None:
    """Publish advice until the advisor has it."""
    sender.send(**fields)
    until_s = time.monotonic() + 60
    while getattr(advisor._newest, "seq", 0) < sender.seq:
        assert time.monotonic() < until_s
        advisor.advice()
        time.sleep(0.002)


@pytest.fixture
def advisor(publisher: Publisher, daemon: Daemon) -> Iterator[MotionAdvisor]:
    with MotionAdvisor(publisher.endpoint, daemon.endpoint) as advisor:
        publisher.wait_for(b"motion")
        yield advisor


def test_what_is_unknown_or_stale_or_ahead_of_its_time_is_the_floor_and_never_full_speed(
    advisor: MotionAdvisor, publisher: Publisher
) -> None:
    sender = Sender(publisher)
    assert advisor.speed_scale() is None
    assert advisor.why_unknown.startswith("no advice has come")
    assert advisor.speed_scale(0.1) == 0.1
    old_ns, ahead_ns = (time.monotonic_ns() + round(away_s * 1e9) for away_s in (-STALE_S - 0.01, 100.0))
    for fields, why in (
        ({"speed_scale": 1.0, "t_ns": old_ns}, "s old"),
        ({"speed_scale": 1.0, "t_ns": ahead_ns}, "s old"),
        ({"speed_scale": None, "unknown": "no object is held"}, "no object is held"),
        ({"speed_scale": 1.0, "unknown": "no object is held"}, "no object is held"),
        ({"speed_scale": None}, "no speed is known to hold"),
    ):
        received(advisor, sender, **fields)
        assert (advisor.speed_scale(), advisor.speed_scale(0.2)) == (None, 0.2), fields
        assert why in advisor.why_unknown or "s old" in advisor.why_unknown, "this process may stall meanwhile"
    for floor in (1.0, -0.1, float("nan")):
        with pytest.raises(CallError, match="never full speed"):
            advisor.speed_scale(floor)


@pytest.mark.parametrize(("sent", "scale"), [(0.4, 0.4), (0.0, 0.0), (1.5, 1.0), (-0.5, 0.0)])
def test_a_scale_that_is_known_is_returned_and_is_at_most_full_speed(
    sent: float, scale: float, advisor: MotionAdvisor, publisher: Publisher
) -> None:
    far_ns = time.monotonic_ns() + 10**15  # the clock of a daemon elsewhere, that its reply has shown
    advisor.client.clock.observe(0, 0, 10**15)
    received(advisor, Sender(publisher), speed_scale=sent, t_ns=far_ns)
    assert advisor.speed_scale(0.9) in (scale, 0.9), "0.9 if this process stalls meanwhile"


async def test_a_trajectory_is_checked_by_either_advisor(publisher: Publisher, daemon: Daemon) -> None:
    daemon.handlers["motion.check"] = lambda _: REPLY
    points = [point_of(0.0, (0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 2.0))]
    with MotionAdvisor(publisher.endpoint, daemon.endpoint) as advisor:
        assert advisor.check(points).time_scale == 0.8
    async with AsyncMotionAdvisor(publisher.endpoint, daemon.endpoint) as other:
        assert other.speed_scale(0.3) == 0.3
        assert (await other.check(acceleration_mps2=(0.0, 0.0, 2.0))).utilisation == 1.2
    first, second = (request for request in daemon.requests if request["op"] == "motion.check")
    assert first["points"] == [[0.0, -1.0, 0.0, -11.80665, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
    assert second["acceleration_mps2"] == [0.0, 0.0, 2.0]


def test_a_point_is_turned_into_the_gripper_frame_as_by_scipy() -> None:
    turn = Rotation.random(random_state=4)
    point = point_of(1.5, turn.as_quat(), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))
    vectors = [[-1.0, -2.0, -3.0 - 9.80665], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]
    assert point == pytest.approx([1.5, *turn.inv().apply(vectors).ravel()])
