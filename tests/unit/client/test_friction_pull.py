"""A pull until slip gives both coefficients, or the reason why it does not count."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest
from pulls import Hand, typed

from slipd.publish.message_sequencer import Pace
from slipd_client.friction_pull import LEAST_HZ, NO_CONTACT, PullSample, PullWatch

Bodies = Iterable[dict[str, Any]]
Story = Callable[[Hand], Bodies]

STALE: dict[str, Any] = {"level": "unknown", "reasons": ["stale"]}
GONE: dict[str, Any] = {"level": "no_contact", "normal_n": 0.0, "required_friction": None}
SAMPLE = "0.60, 0.45"
MISSING = "before it slipped: its verdicts were missing for 0.16 s, as on a busy machine: pull again"


def outcomes(watch: PullWatch, bodies: Bodies) -> list[str]:
    """What the pulls gave: both coefficients, or why they do not count."""
    found = [each for body in bodies if (each := watch.add(typed(body))) is not None]
    assert all(each.normal_n == 10.0 for each in found if isinstance(each, PullSample))
    return [each if isinstance(each, str) else f"{each.mu_s:.2f}, {each.mu_d and f'{each.mu_d:.2f}'}"
            for each in found]  # fmt: skip


def changed(bodies: Bodies, places: slice | int, **fields: Any) -> Bodies:
    found = list(bodies)
    for body in found[places] if isinstance(places, slice) else [found[places]]:
        body.update(fields)
    return found


def squeezed_less(hand: Hand) -> Bodies:
    return changed([*hand.rest(), *hand.pull(), *hand.rest()], slice(-235, None), normal_n=7.0)


def creeping(hand: Hand) -> Bodies:
    """Evidence begins on the way up."""
    up = [body | {"evidence": ["image_change"]} for body in hand.pull(seconds=1.2)]
    return [*hand.rest(), *(hand.body(0.1) for _ in range(5)), *up, *hand.rest()]


def uneven(hand: Hand) -> Bodies:
    bodies = list(hand.pull())
    for k, body in enumerate(bodies[-95:]):
        body["required_friction"] = 0.58 if k // 8 % 2 else 0.38
    return [*hand.rest(), *bodies, *hand.rest()]


def without(missing: slice, *, hz: float = 250.0) -> Story:
    def story(hand: Hand) -> Bodies:
        hand.hz = hz
        bodies = [*hand.rest(), *hand.pull(seconds=0.8 if hz > LEAST_HZ else 2.0), *hand.rest()]
        del bodies[missing]
        return bodies

    return story


def gap_in_a_pull(hand: Hand) -> Bodies:
    grows = list(hand.pull())
    return [*Hand(t_s=99.0).rest(), *grows[:100], grows[100] | STALE, *grows[101:], *hand.rest(2.0, required=0.44)]


def slip_within_a_gap(hand: Hand) -> Bodies:
    at_rest, slid = list(hand.rest()), [*hand.pull(), *hand.rest(required=0.44)]
    return [*at_rest, *slid[-100:]]


def slid(count: int) -> Story:
    """Slide for this many readings; four of them come within SETTLE_S of the peak."""
    hand = Hand(hz=240.0)
    return lambda _: [*hand.rest(), *hand.pull(slides_s=count / hand.hz), *hand.rest()]


def stale_at_rest(hand: Hand) -> Bodies:
    return [*hand.rest(), hand.body(0.05) | STALE, *hand.rest()]


def slide_that_ends_in_a_gap(hand: Hand) -> Bodies:
    bodies = [*hand.rest(), *list(hand.pull())[:-60]]
    list(hand.rest())
    return [*bodies, hand.body(0.44)]


@pytest.mark.parametrize(
    ("story", "expected", "phase"),
    [
        *[(lambda _, seed=seed: Hand(seed=seed).once(), [SAMPLE], "pull") for seed in range(5)],
        (lambda hand: [body for _ in range(3) for body in hand.once()], [SAMPLE] * 3, "pull"),
        *[
            (lambda hand, late=late: [*hand.rest(), *hand.pull(late_s=late), *hand.rest()], [SAMPLE], "pull")
            for late in (0.0, 0.02, 0.15)
        ],
        (creeping, [SAMPLE], "pull"),
        (lambda hand: changed([*hand.once()], 290, required_friction=3.0), [SAMPLE], "pull"),
        (slid(12), [SAMPLE], "pull"),
        (slid(11), ["0.60, None"], "pull"),
        (lambda hand: [*hand.rest(), *hand.pull(0.3), *hand.rest()], [SAMPLE], "pull"),
        (lambda hand: [*hand.rest(), *hand.pull(0.25), *hand.rest()], ["the pull grew within 140 ms"], "pull"),
        (uneven, ["0.60, None"], "pull"),
        (lambda hand: [body | {"level": "unknown", "reasons": ["no_mu"]} for body in hand.once()], [SAMPLE], None),
        (lambda hand: [*hand.rest(), *hand.pull(), hand.body(0.0) | GONE], [SAMPLE], "grip"),
        (lambda hand: [*hand.rest(), *hand.pull(), *hand.rest(2.0, required=0.44)], [SAMPLE], "release"),
        (lambda hand: [*hand.rest(), *hand.rest(required=0.3)], [], "pull"),
        (
            lambda hand: [*hand.rest(), *hand.rest(required=0.3), hand.body(0.0) | GONE],
            [f"before it slipped: {NO_CONTACT}"],
            "grip",
        ),
        (lambda hand: [*hand.rest(), *hand.rest(required=0.09), hand.body(0.0) | GONE], [], "grip"),
        (
            lambda hand: [*hand.rest(), *hand.rest(required=0.118), hand.body(0.0) | GONE],
            [f"before it slipped: {NO_CONTACT}"],
            "grip",
        ),
        (lambda hand: [*hand.rest(), hand.body(0.0) | GONE], [], "grip"),
        (
            lambda hand: [*hand.rest(), *hand.pull(0.1), *hand.rest()],
            ["the pull grew within 56 ms: pull more slowly"],
            "pull",
        ),
        (
            lambda _: Hand(more={"friction_ratio": 0.3}).once(),
            ["the object was turned rather than pulled: pull in line with the middle of the pads"],
            "pull",
        ),
        (
            lambda _: Hand(more={"friction_ratio_std": 0.06}).once(),
            ["10.0 N is too light for the noise of the sensor: squeeze harder"],
            None,
        ),
        (squeezed_less, ["the squeeze changed from 7.0 to 10.0 N at the slip: pull along the pads"], None),
        (lambda hand: changed(hand.once(), slice(312), normal_n=7.0), [SAMPLE], "pull"),  # 50 ms before the slip
        (lambda hand: changed(hand.once(), slice(318), normal_n=9.0), [SAMPLE], "pull"),  # by little
        (without(slice(225, 265)), [MISSING], None),
        *[(without(slice(60, 60 + missing), hz=LEAST_HZ), [SAMPLE], None) for missing in (0, 2)],
        (without(slice(60, 65), hz=LEAST_HZ), ["before it slipped: its verdicts were missing"], None),
        (gap_in_a_pull, ["before it slipped: its readings are not trusted (stale): see slipctl status"], "release"),
        (lambda hand: [*gap_in_a_pull(hand), *hand.once()], ["before it slipped", SAMPLE], "pull"),
        (slip_within_a_gap, [], "release"),
        (stale_at_rest, [], "pull"),
        (slide_that_ends_in_a_gap, [SAMPLE], "release"),
    ],
)
def test_what_a_pull_gives_and_what_is_waited_for_then(story: Story, expected: list[str], phase: str | None) -> None:
    watch = PullWatch()
    given = outcomes(watch, story(Hand()))
    assert len(given) == len(expected)
    assert all(text.startswith(begin) for text, begin in zip(given, expected, strict=True)), given
    assert phase in (None, watch.phase)


@pytest.mark.parametrize(
    ("hand", "obstacle"),
    [
        (Hand(more=GONE), NO_CONTACT),
        (Hand(more={"level": "unknown", "reasons": ["stuck"]}), "its readings are not trusted (stuck)"),
        (Hand(more=STALE | {"normal_n": None}), "its readings are not trusted (stale)"),
        (Hand(more={"level": "unknown", "reasons": [], "normal_n": None}), "its force is not known"),
        (Hand(more={"spin_nm": None, "required_friction": None}), "its sensor measures no torque"),
        (
            Hand(more={"reasons": ["rotation_unobserved"], "required_friction": None}),
            "slipd does not know the friction",
        ),
        (Hand(more={"evidence": ["width"]}), "the object moves in the grip"),
        *[
            (
                Hand(hz=hz),
                f"its verdicts come at {hz} Hz, and at least 40 are needed: raise slip_hz in [rates], or the rate of "
                "the sensor where that is lower; on a busy machine, end other programs",
            )
            for hz in (10, 20, 30)
        ],
    ],
)
def test_a_grip_that_is_not_ready_says_why(hand: Hand, obstacle: str) -> None:
    watch = PullWatch()
    outcomes(watch, hand.rest(1.0))
    assert watch.phase == "grip"
    assert watch.obstacle.startswith(obstacle)


def test_a_grip_at_rest_has_no_obstacle_while_it_is_watched() -> None:
    watch = PullWatch()
    outcomes(watch, Hand().rest(0.1))
    assert (watch.phase, watch.obstacle) == ("grip", "")


@pytest.mark.parametrize("sensor_hz", [40.0, 60.0, 100.0, 800.0])
def test_the_lowest_rate_that_is_asked_for_is_enough_whatever_the_sensor_sends(sensor_hz: float) -> None:
    for first_ms in range(0, 50, 5):
        hand, watch, pace = Hand(hz=sensor_hz, t_s=100.0 + first_ms * 1e-3), PullWatch(), Pace(LEAST_HZ)
        outcomes(watch, (body for body in hand.rest(1.0) if pace.passes(body["t_ns"])))
        assert (watch.phase, watch.obstacle) == ("pull", "")
