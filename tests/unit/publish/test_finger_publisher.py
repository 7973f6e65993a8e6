"""Messages about a finger: each change of level at once, all else at the configured rates, in order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from fixture_types import Parse, Wrench
from known_zeros import known_finger
from nanoseconds import MS, T0

from slipd.config import Levels, Rates
from slipd.events import Output, Publish, WallClock
from slipd.finger.finger import Finger
from slipd.finger.finger_state import VerdictBatch
from slipd.finger.freshness import Read
from slipd.publish.finger_messages import FingerPublisher
from slipd.publish.message_sequencer import MessageSequencer
from slipd.types.samples import TactileSample

PULLS = (0.5, 0.5, 0.5, 3.6, 4.5, 0.6, 0.5, 0.6, 3.6, 4.5, 4.5, 0.5)


@pytest.fixture
def finger(left: str, parse: Parse) -> Finger:
    """μ is 0.5: with 10 N of normal force a pull of 3.6 N is a caution and one of 4.5 N a warning."""
    return known_finger("left", parse(left).finger["left"], Levels())


@pytest.fixture
def batch(finger: Finger, wrench: Wrench) -> VerdictBatch:
    """Readings a millisecond apart: stable, caution, then warning."""
    finger.update_image(TactileSample(T0, None, np.full(16, 100.0)))
    samples = [wrench(T0 + 11 * MS, 10.0, (pull_n, 0.0)) for pull_n in PULLS]
    (batch,) = finger.decide(Read(samples, [T0 + k * MS for k in range(len(samples))]))
    return batch


def publisher(finger: Finger, rates: Rates) -> FingerPublisher:
    return FingerPublisher(finger, MessageSequencer("b00t", "rig", WallClock(0)), rates)


def published(out: Sequence[Output]) -> list[tuple[str, int]]:
    """Topic and time of each message, ms since the first reading."""
    return [(one.topic, (one.body["t_ns"] - T0) // MS) for one in out if isinstance(one, Publish)]


def times(out: Sequence[Output], topic: str) -> list[int]:
    return [ms for what, ms in published(out) if what == topic]


@pytest.mark.parametrize(("slip_hz", "wrench_hz"), [(1000.0, 1000.0), (250.0, 500.0), (500.0, 100.0), (1.0, 1.0)])
def test_a_batch_is_published_like_its_readings_one_by_one(
    finger: Finger, batch: VerdictBatch, slip_hz: float, wrench_hz: float
) -> None:
    rates = Rates(slip_hz=slip_hz, wrench_hz=wrench_hz)
    at_once: list[Output] = []
    one_by_one: list[Output] = []
    publisher(finger, rates).publish_batch(batch, at_once)
    singly = publisher(finger, rates)
    for state in batch:
        singly.publish_state(state, one_by_one)
    assert at_once == one_by_one
    assert len(times(at_once, "warning")) == 3


def test_each_topic_keeps_its_own_rate_and_a_change_is_published_beside_it(finger: Finger, batch: VerdictBatch) -> None:
    out: list[Output] = []
    publisher(finger, Rates(slip_hz=250.0, wrench_hz=500.0)).publish_batch(batch, out)
    assert {topic: times(out, topic) for topic in ("warning", "slip.left", "wrench.left")} == {
        "warning": [0, 3, 4],  # stable, caution, warning
        "slip.left": [0, 3, 4, 8],
        "wrench.left": [0, 2, 3, 4, 6, 8, 10],
    }
    assert published(out) == sorted(published(out), key=lambda one: one[1])


def test_an_image_is_published_at_its_rate_and_at_once_where_it_became_unusable(finger: Finger) -> None:
    images = publisher(finger, Rates(tactile_hz=1.0))
    out: list[Output] = []
    for k, status in enumerate(((), (), ("overload",), ("overload",), ())):
        finger.update_image(TactileSample(T0 + 10 * k * MS, None, np.full(16, 100.0 + k), status))
        images.publish_image(T0 + 10 * k * MS, out)
    assert times(out, "tactile.left") == [0, 20, 40]
