"""A pull until slip gives both coefficients, or the reason why it does not count."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from pulls import Hand, typed

from slipd.publish.message_sequencer import Pace
from slipd_client.friction_pull import LEAST_HZ, NO_CONTACT, PullRejected, PullSample, PullWatch


def found(bodies: Iterable[dict[str, Any]], watch: PullWatch | None = None) -> list[PullSample | PullRejected]:
    watch = watch or PullWatch()
    return [each for body in bodies if (each := watch.add(typed(body))) is not None]


@pytest.mark.parametrize("seed", range(5))
def test_a_pull_gives_the_peak_and_the_plateau(seed: int) -> None:
    [sample] = found(Hand(seed=seed).once())
    assert isinstance(sample, PullSample)
    assert sample.mu_s == pytest.approx(0.6, rel=0.01)
    assert sample.mu_d == pytest.approx(0.45, rel=0.01)
    assert sample.normal_n == 10.0


def test_several_pulls_of_one_grip_each_give_a_sample() -> None:
    hand = Hand()
    samples = found(body for _ in range(3) for body in hand.once())
    assert [isinstance(sample, PullSample) for sample in samples] == [True] * 3


@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.15])
def test_a_slip_that_is_noticed_late_has_the_same_peak(late_s: float) -> None:
    hand = Hand()
    [sample] = found([*hand.rest(), *hand.pull(late_s=late_s), *hand.rest()])
    assert isinstance(sample, PullSample)
    assert (sample.mu_s, sample.mu_d) == (pytest.approx(0.6, rel=0.01), pytest.approx(0.45, rel=0.01))


def test_creep_before_the_slip_is_not_the_peak() -> None:
    """Evidence that begins on the way up is followed until the load falls."""
    hand = Hand()
    way_up = [body | {"evidence": ["image_change"]} for body in hand.pull(seconds=1.2)]
    [sample] = found([*hand.rest(), *(hand.body(0.1) for _ in range(5)), *way_up, *hand.rest()])
    assert isinstance(sample, PullSample)
    assert sample.mu_s == pytest.approx(0.6, rel=0.01)


def test_one_outlier_is_not_the_peak() -> None:
    hand = Hand()
    bodies = [*hand.rest(), *hand.pull(), *hand.rest()]
    bodies[200]["required_friction"] = 3.0
    [sample] = found(bodies)
    assert isinstance(sample, PullSample)
    assert sample.mu_s == pytest.approx(0.6, rel=0.01)


def test_a_slide_that_is_short_or_uneven_has_no_dynamic_friction() -> None:
    hand = Hand()
    [short] = found([*hand.rest(), *hand.pull(slides_s=0.04), *hand.rest()])
    bodies = list(hand.pull())
    for k, body in enumerate(bodies[-95:]):
        body["required_friction"] = 0.58 if k // 8 % 2 else 0.38
    [uneven] = found([*hand.rest(), *bodies, *hand.rest()])
    assert [each.mu_d for each in (short, uneven) if isinstance(each, PullSample)] == [None, None]


@pytest.mark.parametrize(
    ("hand", "seconds", "reason"),
    [
        (Hand(), 0.1, "the pull grew within 56 ms: pull more slowly"),
        (Hand(more={"friction_ratio": 0.3}), 0.8, "the object was turned rather than pulled"),
        (Hand(more={"friction_ratio_std": 0.06}), 0.8, "10.0 N is too light for the noise of the sensor"),
    ],
)
def test_a_pull_that_shows_something_else_is_not_counted(hand: Hand, seconds: float, reason: str) -> None:
    [rejected] = found([*hand.rest(), *hand.pull(seconds), *hand.rest()])
    assert isinstance(rejected, PullRejected)
    assert rejected.reason.startswith(reason)


def test_a_squeeze_that_changes_at_the_slip_is_not_counted() -> None:
    hand = Hand()
    bodies = [*hand.rest(), *hand.pull(), *hand.rest()]
    for body in bodies[-235:]:
        body["normal_n"] = 7.0
    [rejected] = found(bodies)
    assert isinstance(rejected, PullRejected)
    assert rejected.reason == "the squeeze changed from 7.0 to 10.0 N at the slip: pull along the pads"


@pytest.mark.parametrize(
    ("fields", "obstacle"),
    [
        ({"level": "no_contact", "normal_n": 0.0, "required_friction": None}, NO_CONTACT),
        ({"level": "unknown", "reasons": ["stuck"]}, "its readings are not trusted (stuck)"),
        ({"level": "unknown", "reasons": ["stale"], "normal_n": None}, "its readings are not trusted (stale)"),
        ({"level": "unknown", "reasons": [], "normal_n": None}, "its force is not known"),
        ({"spin_nm": None, "required_friction": None}, "its sensor measures no torque"),
        ({"reasons": ["rotation_unobserved"], "required_friction": None}, "slipd does not know the friction"),
        ({"evidence": ["width"]}, "the object moves in the grip"),
    ],
)
def test_a_grip_that_is_not_ready_says_why(fields: dict[str, Any], obstacle: str) -> None:
    watch = PullWatch()
    found((body | fields for body in Hand().rest()), watch)
    assert watch.phase == "grip"
    assert watch.obstacle.startswith(obstacle)


def test_without_a_coefficient_in_the_config_it_is_measured_too() -> None:
    hand = Hand(more={"mu": None, "mu_source": "none", "utilisation": None})
    bodies = [body | {"level": "unknown", "reasons": ["no_mu"]} for body in hand.once()]
    [sample] = found(bodies)
    assert isinstance(sample, PullSample)


@pytest.mark.parametrize("rate_hz", [10, 20, 30])
def test_verdicts_that_are_too_rare_are_an_obstacle(rate_hz: int) -> None:
    watch = PullWatch()
    found(Hand(hz=rate_hz).rest(1.0), watch)
    assert watch.obstacle == (
        f"its verdicts come at {rate_hz} Hz, and at least 40 are needed: raise slip_hz in [rates], or the rate of the "
        "sensor where that is lower; on a busy machine, end other programs"
    )


@pytest.mark.parametrize("first_ms", range(0, 50, 5))
@pytest.mark.parametrize("sensor_hz", [40.0, 60.0, 100.0, 800.0])
def test_the_lowest_rate_that_is_asked_for_is_enough_whatever_the_sensor_sends(sensor_hz: float, first_ms: int) -> None:
    hand, watch, pace = Hand(hz=sensor_hz, t_s=100.0 + first_ms * 1e-3), PullWatch(), Pace(LEAST_HZ)
    found((body for body in hand.rest(1.0) if pace.passes(body["t_ns"])), watch)
    assert (watch.phase, watch.obstacle) == ("pull", "")


@pytest.mark.parametrize(("missing", "counts"), [(0, True), (2, True), (5, False)])
def test_at_the_lowest_rate_a_few_missing_verdicts_do_not_end_a_pull(missing: int, counts: bool) -> None:
    hand = Hand(hz=LEAST_HZ)
    bodies = [*hand.rest(), *hand.pull(seconds=2.0), *hand.rest()]
    del bodies[60 : 60 + missing]
    [each] = found(bodies)
    assert isinstance(each, PullSample) == counts


def test_a_contact_that_ends_during_the_pull_is_told() -> None:
    hand = Hand()
    watch = PullWatch()
    assert found([*hand.rest(), *hand.rest(required=0.3)], watch) == []
    assert watch.phase == "pull"
    gone = hand.body(0.0) | {"level": "no_contact", "required_friction": None}
    assert found([gone], watch) == [PullRejected(f"before it slipped: {NO_CONTACT}")]
    assert watch.phase == "grip"
    assert found([*hand.rest(), gone], watch) == [], "nobody pulled yet"


def test_an_object_that_slips_out_of_the_grip_gives_its_sample() -> None:
    hand = Hand()
    gone = hand.body(0.0) | {"level": "no_contact", "required_friction": None}
    [sample] = found([*hand.rest(), *hand.pull(), gone])
    assert isinstance(sample, PullSample)


def test_a_pull_that_goes_on_is_one_pull() -> None:
    """The object sticks again at a large load: not a new grip at rest."""
    hand, watch = Hand(), PullWatch()
    assert len(found([*hand.rest(), *hand.pull(), *hand.rest(2.0, required=0.44)], watch)) == 1
    assert watch.phase == "release"
    found(hand.rest(), watch)
    assert watch.phase == "pull"


STALE: dict[str, Any] = {"level": "unknown", "reasons": ["stale"]}


def test_after_a_gap_in_a_pull_its_end_is_waited_for() -> None:
    hand, watch = Hand(), PullWatch()
    found(hand.rest(), watch)
    grows = list(hand.pull())
    assert found([*grows[:100], grows[100] | STALE], watch) == [
        PullRejected("before it slipped: its readings are not trusted (stale): see slipctl status")
    ]
    assert (watch.phase, bool(watch.obstacle)) == ("release", True)
    assert found(grows[101:], watch) == [], "the rest of this pull is none of its own"
    assert (watch.phase, watch.obstacle) == ("release", "")
    found(hand.rest(2.0, required=0.44), watch)
    assert watch.phase == "release", "the last pull still acts"
    [sample] = found(hand.once(), watch)
    assert isinstance(sample, PullSample)


def test_a_slip_within_a_gap_is_no_sample_and_its_pull_is_waited_for() -> None:
    hand, watch = Hand(), PullWatch()
    found(hand.rest(), watch)
    slid = [*hand.pull(), *hand.rest(required=0.44)]
    assert found(slid[-100:], watch) == [], "nobody pulled before the verdicts were missing"
    assert watch.phase == "release"
    found(hand.rest(), watch)
    assert watch.phase == "pull"


def test_verdicts_that_are_missing_end_a_pull_and_a_slide() -> None:
    hand = Hand()
    bodies = list(hand.pull())
    [pulled] = found([*Hand(t_s=99.0).rest(), *bodies[:150], *bodies[190:]])
    assert pulled == PullRejected(
        "before it slipped: its verdicts were missing for 0.16 s, as on a busy machine: pull again; where this happens "
        "often, end other programs, or lower slip_hz in [rates] (to 40 at least)"
    )
    hand, watch = Hand(), PullWatch()
    found([*hand.rest(), *list(hand.pull())[:-60]], watch)
    assert watch.phase == "slide"
    list(hand.rest())
    [sample] = found([hand.body(0.44)], watch)
    assert isinstance(sample, PullSample)
    assert watch.phase == "release"


def test_a_finger_at_rest_that_was_stale_for_a_moment_is_ready_again_by_itself() -> None:
    hand, watch = Hand(), PullWatch()
    found([*hand.rest(), hand.body(0.05) | STALE], watch)
    assert watch.obstacle
    found(hand.rest(), watch)
    assert (watch.phase, watch.obstacle) == ("pull", "")
