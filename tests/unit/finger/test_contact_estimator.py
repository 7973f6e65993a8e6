"""Contact estimate: it does not depend on how readings are split into reads; hysteresis; what a weight may add."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from finger_bench import Press, make_finger, read_force
from fixture_types import Parse, Wrench
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nanoseconds import MS, T0

from slipd.config import Finger as FingerConfig
from slipd.config import Rates
from slipd.events import Output, WallClock
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState, VerdictBatch
from slipd.finger.freshness import Read
from slipd.finger.trust import is_trusted
from slipd.publish.finger_messages import FingerPublisher
from slipd.publish.message_sequencer import MessageSequencer
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import level_code

FULL = np.full(16, 100.0)


@pytest.fixture
def finger(left: str, parse: Parse) -> Finger:
    """μ 0.5, contact from 0.5 N, 4×4 taxels at 4 mm; readings older than 20 ms are late, images older than 30 ms."""
    return make_finger(left.replace("stuck_after = 0", "stuck_after = 4\nrange_n = 100.0"), parse)


@pytest.fixture
def hands(finger: Finger, wrench: Wrench) -> dict[bool, Finger]:
    """A finger whose image agrees with its force for 0.3 s, and one whose image does not."""
    fingers = {}
    for agrees in (True, False):
        one = copy.deepcopy(finger)
        for k in range(30):
            t_ns, normal_n = T0 - (300 - 10 * k) * MS, 8.0 + math.sin(k)
            read_force(one, wrench(t_ns, normal_n, (0.5, 0.0), 0.0, (0.0 if agrees else 0.006, 0.0)))
            one.update_image(TactileSample(t_ns, None, 100 * normal_n / 16 + 0.1 * (np.arange(16.0) % 3)))
        fingers[agrees] = one
    assert "disagreement" not in fingers[True].state.verdict.reasons
    read_force(one, wrench(T0, 8.0, (0.5, 0.0), 0.0, (0.006, 0.0)))
    assert one.state.verdict.reasons[0] == "disagreement"
    return fingers


class Split:
    """A finger that gets its readings in reads of given sizes, and all that it reports and publishes."""

    def __init__(self, finger: Finger, sizes: Sequence[int]) -> None:
        self.finger = copy.deepcopy(finger)
        self.publisher = FingerPublisher(self.finger, MessageSequencer("b00t", "rig", WallClock(0)), Rates())
        self.out: list[Output] = []
        self.reported: list[str] = []
        self._sizes = list(sizes)

    def feed(self, samples: Sequence[WrenchSample], times_ns: Sequence[int]) -> None:
        at = 0
        while at < len(samples):
            size = self._sizes[0]
            self._sizes = [*self._sizes[1:], size]
            for batch in self.finger.decide(Read(samples[at : at + size], times_ns[at : at + size])):
                self.reported += plain(batch, self.finger.config)
                self.publisher.publish_batch(batch, self.out)
            at += size
        self.reported.append(
            repr(
                (
                    self.finger.presence.is_pressed(),
                    is_trusted(self.finger.state.verdict),
                    self.finger.freshness.age_s(times_ns[-1]),
                )
            )
        )


def plain(batch: VerdictBatch, config: FingerConfig) -> list[str]:
    """Return all that is known after each reading, to the last bit."""
    known = []
    for state, level in zip(batch, batch.levels, strict=True):
        assert level == level_code(state.verdict.level)
        used, shares = state.utilisation, state.load_distribution
        arrays = [None if values is None else values.tolist() for values in (used and used.pole_m, shares and shares.x)]
        numbers = (state.contact, used and (*used[:3], *used[4:]), state.numbers(config), state.age_s)
        known.append(repr((state.t_ns, state.verdict, state.wrench, state.status, state.friction, *numbers, *arrays)))
    return known


# Status, time since the reading before in ms, normal and tangential force, spin, centroid; what is odd about it.
READING = st.tuples(
    st.sampled_from((*[""] * 8, "skipped", "overload", "invalid")),
    st.sampled_from((0.0, 0.25, 0.25, 1.0, 1.0, 5.0)),
    st.sampled_from((-1.0, 0.0, 0.39, 0.45, 0.55, 3.0, 10.0, 10.0)),
    st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
    st.floats(-0.01, 0.01),
    st.tuples(st.floats(-0.008, 0.008), st.floats(-0.008, 0.008)),
    st.sampled_from((*[""] * 20, "again", "no torque", "no torque", "nan", "-inf", "wild")),
)


# Readings, how long the last of them waited in ms, the image before them, and the friction set before them.
READ = st.tuples(
    st.lists(READING, min_size=1, max_size=12),
    st.sampled_from((0.0, 0.0, 0.0, 1.0, 8.0, 21.0)),
    st.sampled_from((None, "full", "full", "part", "empty", "invalid")),
    st.sampled_from((None, None, None, (0.9, None), (0.4, 0.35))),
)

WRONG = {"nan": math.nan, "-inf": -math.inf, "wild": 300.0}

IMAGES = {"full": FULL, "part": np.where(np.arange(16) < 6, FULL, 0.0), "empty": np.zeros(16), "invalid": FULL}


@pytest.mark.uncovered
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    reads=st.lists(READ, min_size=1, max_size=6), sizes=st.lists(st.integers(1, 12), min_size=1), agrees=st.booleans()
)
def test_verdicts_do_not_depend_on_how_readings_are_split_into_reads(
    hands: dict[bool, Finger], wrench: Wrench, reads: list[Any], sizes: list[int], agrees: bool
) -> None:
    """Readings that are untrusted, late, without torque, or end the contact may stand anywhere in a read."""
    t_ns = T0
    splits = [Split(hands[agrees], some) for some in ((1,), (12,), sizes)]
    for readings, waited_ms, image, friction in reads:
        times_ns, made = [], []
        for _, ms, *_ in readings:
            t_ns += round(ms * MS)
            times_ns.append(t_ns)
        received_ns = t_ns + round(waited_ms * MS)
        for word, _, *contact, odd in readings:
            sample = wrench(received_ns, *contact, status=(word,) if word else ())
            made.append(make_odd(sample, odd, made))
        for split in splits:
            if image is not None:
                status = ("invalid",) if image == "invalid" else ()
                split.finger.update_image(TactileSample(times_ns[0], None, IMAGES[image], status))
            if friction is not None:
                split.finger.set_friction(*friction)
            split.feed(made, times_ns)
    singly, whole, cut = splits
    assert singly.reported == whole.reported == cut.reported
    assert singly.out == whole.out == cut.out


def make_odd(sample: WrenchSample, odd: str, before: Sequence[WrenchSample]) -> WrenchSample:
    """Return a reading that repeats the one before, has no torque, or is not finite."""
    if odd == "again" and before:
        return before[-1]
    if odd == "no torque":
        return WrenchSample(sample.t_ns, None, sample.force_n, None, sample.status)
    if odd in WRONG:
        sample.numbers = (WRONG[odd], *sample.numbers[1:])
    return sample


def test_late_reading_ends_contact_and_disagreement(hands: dict[bool, Finger], wrench: Wrench) -> None:
    samples = [wrench(T0 + 25 * MS, 8.0, (0.5, 0.0), 0.0, (0.006, 0.0)) for _ in range(3)]
    (batch,) = hands[False].decide(Read(samples, [T0 + MS, T0 + 24 * MS, T0 + 25 * MS]))
    assert [state.verdict.reasons for state in batch] == [
        ("stale",),
        ("rotation_unobserved",),
        ("rotation_unobserved",),
    ]


def test_untrusted_reading_keeps_hysteresis_and_slip(press: Press) -> None:
    pulls = [2.0 + 0.01 * k for k in range(250)] + [3.8] * 20
    reported = [
        press(10.0, (pull_n, 0.0), ms=1.0, status=("overload",) if k in (240, 265) else ()).verdict.level
        for k, pull_n in enumerate(pulls)
    ]
    assert reported[239:242] == ["warning", "unknown", "warning"]
    assert reported[264:267] == ["slipping", "unknown", "slipping"]


def test_batch_is_indexed_from_both_ends(finger: Finger, wrench: Wrench) -> None:
    samples = [wrench(T0 + 2 * MS, normal_n) for normal_n in (0.0, 1.0, 2.0)]
    (batch,) = finger.decide(Read(samples, [T0, T0 + MS, T0 + 2 * MS]))
    states: list[FingerState] = list(batch)
    assert [state.t_ns for state in states] == [T0, T0 + MS, T0 + 2 * MS]
    assert [state.age_s for state in states] == pytest.approx([0.002, 0.001, 0.0])
    assert batch[-1].t_ns == batch[2].t_ns == finger.state.t_ns
    with pytest.raises(IndexError):
        batch[3]
