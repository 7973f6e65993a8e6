"""How a run of readings is cut into reads decides nothing; the friction of the object that is held decides much."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import pytest
from force_readings import read_force
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slipd.config import Config, Levels, Rates
from slipd.events import Output
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.verdict_batch import VerdictBatch
from slipd.publish.finger_messages import slip_body
from slipd.publish.finger_publisher import FingerPublisher
from slipd.publish.message_sequencer import MessageSequencer
from slipd.samples import TactileSample, WrenchSample
from slipd_client.messages import level_code

MS = 1_000_000
T0 = 100_000_000_000
FULL = np.full(16, 100.0)

Parse = Callable[[str], Config]
Wrench = Callable[..., WrenchSample]
Image = Callable[..., TactileSample]


def make(text: str, parse: Parse) -> Finger:
    return Finger("left", parse(text).finger["left"], Levels())


@pytest.fixture
def finger(left: str, parse: Parse) -> Finger:
    """μ 0.5, contact from 0.5 N, 4×4 taxels at 4 mm; readings older than 20 ms are late, images older than 30 ms."""
    return make(left.replace("stuck_after = 0", "stuck_after = 4\nrange_n = 100.0"), parse)


@pytest.fixture
def hands(finger: Finger, wrench: Wrench) -> dict[bool, Finger]:
    """A finger whose image agrees with its force for 0.3 s, and one whose image does not."""
    told = {}
    for agrees in (True, False):
        hand = copy.deepcopy(finger)
        for k in range(30):
            t_ns, normal_n = T0 - (300 - 10 * k) * MS, 8.0 + math.sin(k)
            read_force(hand, wrench(t_ns, normal_n, (0.5, 0.0), 0.0, (0.0 if agrees else 0.006, 0.0)))
            hand.update_image(TactileSample(t_ns, None, 100 * normal_n / 16 + 0.1 * (np.arange(16.0) % 3)))
        told[agrees] = hand
    assert "disagreement" not in told[True].state.verdict.reasons
    read_force(hand, wrench(T0, 8.0, (0.5, 0.0), 0.0, (0.006, 0.0)))
    assert hand.state.verdict.reasons[0] == "disagreement"
    return told


class Split:
    """A finger whose reads are handed over in pieces of given sizes, and everything that it tells."""

    def __init__(self, finger: Finger, sizes: Sequence[int]) -> None:
        self.finger = copy.deepcopy(finger)
        self.voice = FingerPublisher(self.finger, MessageSequencer("b00t", "rig", 0), Rates())
        self.out: list[Output] = []
        self.told: list[str] = []
        self._sizes = list(sizes)

    def take(self, samples: Sequence[WrenchSample], times_ns: Sequence[int]) -> None:
        at = 0
        while at < len(samples):
            size = self._sizes[0]
            self._sizes = [*self._sizes[1:], size]
            for judged in self.finger.decide(samples[at : at + size], times_ns[at : at + size]):
                self.told += plain(judged)
                self.voice.publish_batch(judged, self.out)
            at += size
        self.told.append(repr((self.finger.is_pressed(), self.finger.is_trusted, self.finger.age_s(times_ns[-1]))))


def plain(judged: VerdictBatch) -> list[str]:
    """Everything that is known after each reading, to the last bit."""
    told = []
    for state, level in zip(judged, judged.levels, strict=True):
        assert level == level_code(state.verdict.level)
        used, shares = state.utilisation, state.load_distribution
        arrays = [None if values is None else values.tolist() for values in (used and used.pole_m, shares and shares.x)]
        numbers = (state.contact, used and (*used[:3], *used[4:]), state.tipping_margin_m, state.age_s)
        told.append(repr((state.t_ns, state.verdict, state.wrench, state.model, state.status, *numbers, *arrays)))
    return told


#: Words of the device, time since the reading before in ms, normal force, pull, spin, centroid; what is odd about it.
READING = st.tuples(
    st.sampled_from((*[""] * 8, "skipped", "overload", "invalid")),
    st.sampled_from((0.0, 0.25, 0.25, 1.0, 1.0, 5.0)),
    st.sampled_from((-1.0, 0.0, 0.39, 0.45, 0.55, 3.0, 10.0, 10.0)),
    st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
    st.floats(-0.01, 0.01),
    st.tuples(st.floats(-0.008, 0.008), st.floats(-0.008, 0.008)),
    st.sampled_from((*[""] * 20, "again", "no torque", "no torque", "nan", "-inf", "wild")),
)
#: Readings, how long the last of them waited in ms, the image before them, and the friction told before them.
READ = st.tuples(
    st.lists(READING, min_size=1, max_size=12),
    st.sampled_from((0.0, 0.0, 0.0, 1.0, 8.0, 21.0)),
    st.sampled_from((None, "full", "full", "part", "empty", "invalid")),
    st.sampled_from((None, None, None, (0.9, None), (0.4, 0.35))),
)
WRONG = {"nan": math.nan, "-inf": -math.inf, "wild": 300.0}
IMAGES = {"full": FULL, "part": np.where(np.arange(16) < 6, FULL, 0.0), "empty": np.zeros(16), "invalid": FULL}


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    reads=st.lists(READ, min_size=1, max_size=6), sizes=st.lists(st.integers(1, 12), min_size=1), agrees=st.booleans()
)
def test_any_split_of_a_run_of_readings_is_judged_the_same(
    hands: dict[bool, Finger], wrench: Wrench, reads: list[Any], sizes: list[int], agrees: bool
) -> None:
    """What is untrusted, late, without torque, or ends the contact stands anywhere in a read; so does a slip."""
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
            made.append(odd_one(sample, odd, made))
        for split in splits:
            if image is not None:
                status = ("invalid",) if image == "invalid" else ()
                split.finger.update_image(TactileSample(times_ns[0], None, IMAGES[image], status))
            if friction is not None:
                split.finger.set_friction(*friction)
            split.take(made, times_ns)
    singly, whole, cut = splits
    assert singly.told == whole.told == cut.told
    assert singly.out == whole.out == cut.out


def odd_one(sample: WrenchSample, odd: str, before: Sequence[WrenchSample]) -> WrenchSample:
    """A reading that repeats the one before, has no torque, or numbers that are none."""
    if odd == "again" and before:
        return before[-1]
    if odd == "no torque":
        return WrenchSample(sample.t_ns, None, sample.force_n, None, sample.status)
    if odd in WRONG:
        sample.numbers = (WRONG[odd], *sample.numbers[1:])
    return sample


def test_a_late_reading_ends_a_disagreement_with_its_contact(hands: dict[bool, Finger], wrench: Wrench) -> None:
    samples = [wrench(T0 + 25 * MS, 8.0, (0.5, 0.0), 0.0, (0.006, 0.0)) for _ in range(3)]
    (judged,) = hands[False].decide(samples, [T0 + MS, T0 + 24 * MS, T0 + 25 * MS])
    assert [state.verdict.reasons for state in judged] == [
        ("stale",),
        ("rotation_unobserved",),
        ("rotation_unobserved",),
    ]


def test_a_reading_that_says_nothing_ends_neither_hysteresis_nor_slip(
    finger: Finger, wrench: Wrench, image: Image
) -> None:
    told = []
    finger.update_image(image(T0))
    for k, (pull_n, word) in enumerate(
        ((4.3, ""), (4.1, "overload"), (4.1, ""), (3.0, ""), (3.0, "overload"), (3.0, ""))
    ):
        state = read_force(finger, wrench(T0 + k * MS, 10.0, (pull_n, 0.0), status=(word,) if word else ()))
        told.append(state.verdict.level)
    assert told == ["warning", "unknown", "warning", "slipping", "unknown", "slipping"]


def levels(finger: Finger, wrench: Wrench, image: Image, pulls: Iterable[float]) -> list[str]:
    """Levels of readings 10 ms apart, pressed with 10 N and pulled."""
    told = []
    for k, pull_n in enumerate(pulls):
        finger.update_image(image(T0 + k * 10 * MS))
        told.append(read_force(finger, wrench(T0 + k * 10 * MS, 10.0, (pull_n, 0.0))).verdict.level)
    return told


def test_the_friction_of_the_config_holds_until_another_is_told(finger: Finger, wrench: Wrench, image: Image) -> None:
    assert (finger.friction.mu, finger.friction.source) == (0.5, "config")
    assert levels(finger, wrench, image, [4.5]) == ["warning"]
    finger.set_friction(1.0, None)
    assert (finger.friction.mu, finger.friction.source) == (1.0, "request")
    body = slip_body(finger, finger.state)
    assert (body["mu"], body["mu_source"]) == (1.0, "request")
    assert levels(finger, wrench, image, [4.5]) == ["stable"], "λ is 0.45 now"
    assert finger.state.utilisation is not None
    assert finger.state.utilisation.value == pytest.approx(0.45)


def test_a_finger_without_a_coefficient_learns_one(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    finger = make(left.replace("mu = 0.5\n", ""), parse)
    assert (finger.friction.mu, finger.friction.source) == (None, None)
    assert levels(finger, wrench, image, [1.0]) == ["unknown"]
    finger.set_friction(0.5, None)
    assert (finger.friction.mu, finger.friction.source) == (0.5, "request")
    assert levels(finger, wrench, image, [1.0]) == ["stable"]


FALLS = {0.08: [4.8, 4.8, 4.8 * 0.92], 0.15: [4.8, 4.8, 4.8 * 0.85], 0.03: [4.8, 4.8, 4.8 * 0.97]}


@pytest.mark.parametrize(
    ("mu_d", "told"),
    [
        (None, [False, True, False]),  # as the config has it: 0.12
        (0.45, [True, True, False]),  # a tenth, of which half must be seen
        (0.2, [False, False, False]),  # three fifths: no fall of 0.15 is a slip
        (0.499, [True, True, False]),  # less than noise may bring is never asked for
    ],
)
def test_the_fall_that_is_a_slip_follows_the_dynamic_friction(
    finger: Finger, wrench: Wrench, image: Image, mu_d: float | None, told: list[bool]
) -> None:
    slips = []
    for fall in (0.08, 0.15, 0.03):
        hand = copy.deepcopy(finger)
        hand.set_friction(0.5, mu_d)
        slips.append(levels(hand, wrench, image, FALLS[fall])[-1] == "slipping")
    assert slips == told


def test_friction_without_a_dynamic_one_leaves_the_fall_that_was_told_before(
    finger: Finger, wrench: Wrench, image: Image
) -> None:
    finger.set_friction(0.5, 0.45)
    finger.set_friction(0.5, None)
    assert levels(finger, wrench, image, FALLS[0.08])[-1] == "slipping"


def test_a_state_is_reached_from_either_end_of_its_read(finger: Finger, wrench: Wrench) -> None:
    samples = [wrench(T0 + 2 * MS, normal_n) for normal_n in (0.0, 1.0, 2.0)]
    (judged,) = finger.decide(samples, [T0, T0 + MS, T0 + 2 * MS])
    states: list[FingerState] = list(judged)
    assert [state.t_ns for state in states] == [T0, T0 + MS, T0 + 2 * MS]
    assert [state.age_s for state in states] == pytest.approx([0.002, 0.001, 0.0])
    assert judged[-1].t_ns == judged[2].t_ns == finger.state.t_ns
    with pytest.raises(IndexError):
        judged[3]
