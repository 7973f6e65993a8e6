"""Every force reading of a finger gets its verdict, and what cannot be known is unknown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from force_readings import read_force

from slipd.config import Config, stale_after_ns
from slipd.config import Levels as LevelsConfig
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.fusion import torque_limit
from slipd.samples import TactileSample, WrenchSample

MS = 1_000_000
T0 = 100_000_000_000
FULL = np.full((4, 4), 100)
EMPTY = np.zeros((4, 4))

Wrench = Callable[..., WrenchSample]
Image = Callable[..., TactileSample]
Parse = Callable[[str], Config]
ContactEstimator = Callable[..., FingerState]


@pytest.fixture
def finger(left: str, parse: Parse) -> Finger:
    """μ 0.5, contact from 0.5 N, 4×4 taxels at 4 mm, force at 1000 Hz, images at 100 Hz."""
    return make(left, parse)


def make(text: str, parse: Parse, name: str = "left") -> Finger:
    return Finger(name, parse(text).finger[name], LevelsConfig())


@pytest.fixture
def judge(finger: Finger, wrench: Wrench, image: Image) -> ContactEstimator:
    """A reading on a fresh image, ``ms`` after the one before: ``judge(normal, tangential, spin, centroid)``."""
    now = [T0]

    def decide(*contact: float, ms: float = 10.0, counts: np.ndarray | None = FULL, **more: object) -> FingerState:
        now[0] += round(ms * MS)
        if counts is not None:
            finger.update_image(image(now[0], counts))
        return read_force(finger, wrench(now[0], *contact, **more))

    return decide


def limit_nm(finger: Finger, normal_n: float) -> float:
    """Largest spin that friction carries on the whole pad, evenly pressed."""
    assert finger.image is not None
    x, y = finger.image.x, finger.image.y
    return torque_limit(x, y, np.full(16, normal_n / 16), 0.5, (0.0, 0.0), (0.0, 0.0)).torque_nm


def verdict(state: FingerState) -> tuple[str, tuple[str, ...]]:
    return state.verdict.level, state.verdict.reasons


def test_before_any_reading_a_finger_is_unknown(finger: Finger) -> None:
    assert verdict(finger.state) == ("unknown", ("stale",))
    assert finger.check_silence(T0) is None, "there is nothing new to tell"
    assert finger.age_s(T0) is None


def test_nothing_that_presses_is_no_contact(judge: ContactEstimator) -> None:
    assert verdict(judge(0.0)) == ("no_contact", ())
    assert verdict(judge(-3.0)) == ("no_contact", ())


def test_an_even_press_with_little_pull_is_stable(judge: ContactEstimator) -> None:
    state = judge(10.0, (1.0, 0.5))
    assert verdict(state) == ("stable", ())
    assert state.model == "exact"
    assert state.utilisation is not None
    assert state.utilisation.value == pytest.approx(math.hypot(1.0, 0.5) / (0.5 * 10.0), rel=1e-6)
    assert state.loads is not None
    assert state.loads.loads.sum() == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("share", "level"), [(0.69, "stable"), (0.72, "caution"), (0.84, "caution"), (0.86, "warning")]
)
def test_pull_alone_raises_the_level_for_translation(judge: ContactEstimator, share: float, level: str) -> None:
    state = judge(10.0, (share * 5.0, 0.0))
    assert verdict(state) == (level, () if level == "stable" else ("translation",))


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(("share", "level"), [(0.69, "stable"), (0.72, "caution"), (0.86, "warning"), (1.5, "warning")])
def test_twist_alone_raises_the_level_for_rotation(
    finger: Finger, judge: ContactEstimator, share: float, level: str, sense: float
) -> None:
    state = judge(10.0, (0.0, 0.0), sense * share * limit_nm(finger, 10.0))
    assert verdict(state) == (level, () if level == "stable" else ("rotation",))


def test_pull_and_twist_together_are_worse_than_either(finger: Finger, judge: ContactEstimator) -> None:
    twist = 0.6 * limit_nm(finger, 10.0)
    assert judge(10.0, (3.0, 0.0)).verdict.level == "stable"
    assert judge(10.0, (0.0, 0.0), twist).verdict.level == "stable"
    level, reasons = verdict(judge(10.0, (3.0, 0.0), twist))
    assert level in ("caution", "warning")
    assert "rotation" in reasons


def test_a_twist_that_no_grip_holds_is_unsupportable(judge: ContactEstimator) -> None:
    one = np.zeros((4, 4))
    one[1, 1] = 100
    at = (-0.002, -0.002)
    level, reasons = verdict(judge(10.0, (0.0, 0.0), 0.01, at, counts=one))
    assert level == "warning"
    assert reasons[:2] == ("unsupportable", "rotation")


def test_a_contact_at_the_edge_of_its_image_tips(judge: ContactEstimator) -> None:
    """The hull of the taxels ends at 6 mm; it is uncertain by half a pitch, 2 mm."""
    assert verdict(judge(10.0, (0.0, 0.0), 0.0, (0.0059, 0.0))) == ("stable", ())
    assert verdict(judge(10.0, (0.0, 0.0), 0.0, (0.0070, 0.0))) == ("caution", ("tipping",))
    assert verdict(judge(10.0, (0.0, 0.0), 0.0, (0.0090, 0.0))) == ("warning", ("tipping",))


def test_noise_of_the_centroid_is_no_tipping(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    noisy = make(left.replace("torque_std_nm = 0.0", "torque_std_nm = 0.005"), parse)
    noisy.update_image(image(T0, FULL))
    assert verdict(read_force(noisy, wrench(T0, 10.0, (0.0, 0.0), 0.0, (0.0065, 0.0)))) == ("stable", ())


def pull(judge: ContactEstimator, forces: Iterable[float], normals: Iterable[float] | None = None) -> list[str]:
    """Levels of readings 10 ms apart."""
    forces = list(forces)
    return [
        judge(normal, (force, 0.0)).verdict.level
        for force, normal in zip(forces, normals or [10.0] * len(forces), strict=True)
    ]


def test_a_pull_that_gives_way_near_the_limit_is_a_slip(judge: ContactEstimator) -> None:
    assert pull(judge, [4.0, 4.4, 4.8])[-1] == "warning"
    state = judge(10.0, (3.9, 0.0))
    assert state.verdict.level == "slipping"
    assert state.verdict.reasons[0] == "slip_detected"


def test_a_slip_stays_told_for_a_while_and_not_for_ever(judge: ContactEstimator) -> None:
    levels = pull(judge, [4.8, 4.8, 3.9] + [3.0] * 40)
    assert levels[2:27] == ["slipping"] * 25, "hold_s is 0.25 s"
    assert levels[28] == "stable"


def test_a_twist_that_gives_way_near_the_limit_is_a_slip(finger: Finger, judge: ContactEstimator) -> None:
    most = limit_nm(finger, 10.0)
    for share in (0.8, 0.95):
        judge(10.0, (0.0, 0.0), share * most)
    assert judge(10.0, (0.0, 0.0), 0.75 * most).verdict.level == "slipping"


def test_tightening_the_grip_is_no_slip(judge: ContactEstimator) -> None:
    """R falls as fast as in a slip, but the pull stays."""
    assert "slipping" not in pull(judge, [4.8] * 6, [10.0, 10.0, 12.0, 14.0, 17.0, 20.0])


def test_setting_an_object_down_is_no_slip(judge: ContactEstimator) -> None:
    assert "slipping" not in pull(judge, np.linspace(4.8, 0.0, 60))


def test_a_light_load_that_vanishes_is_no_slip(judge: ContactEstimator) -> None:
    assert "slipping" not in pull(judge, [2.0, 2.0, 0.5, 0.0])


def test_without_mu_a_contact_is_unknown(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    finger = make(left.replace("mu = 0.5\n", ""), parse)
    finger.update_image(image(T0, FULL))
    assert verdict(read_force(finger, wrench(T0, 10.0, (9.0, 0.0)))) == ("unknown", ("no_mu",))
    assert verdict(read_force(finger, wrench(T0, 0.0))) == ("no_contact", ())


@pytest.mark.parametrize("counts", [None, EMPTY])
def test_without_an_image_translation_alone_can_only_prove_a_grip_unsafe(
    judge: ContactEstimator, counts: np.ndarray | None
) -> None:
    for share, expected in (
        (0.1, ("unknown", ("rotation_unobserved",))),
        (0.8, ("unknown", ("rotation_unobserved",))),
        (0.86, ("warning", ("translation",))),
        (1.2, ("warning", ("translation",))),
    ):
        state = judge(10.0, (share * 5.0, 0.0), counts=counts)
        assert verdict(state) == expected
        assert state.model == "translation"
        assert state.utilisation is None


def test_without_an_image_a_slip_is_told_all_the_same(judge: ContactEstimator) -> None:
    for force in (4.4, 4.8, 3.9):
        state = judge(10.0, (force, 0.0), counts=None)
    assert verdict(state) == ("slipping", ("slip_detected", "rotation_unobserved"))


@pytest.mark.parametrize(("pull_n", "level"), [(1.0, "stable"), (3.5, "caution"), (4.5, "warning")])
def test_time_alone_takes_back_what_rests_on_an_old_image_and_nothing_worse(
    finger: Finger, judge: ContactEstimator, pull_n: float, level: str
) -> None:
    judge(10.0, (pull_n, 0.0))
    state = judge(10.0, (pull_n, 0.0), ms=25.0, counts=None)
    assert state.verdict.level == level
    assert finger.check_silence(state.t_ns + 5 * MS) is None
    finger.check_silence(state.t_ns + 6 * MS)
    after = ("unknown", ("rotation_unobserved",)) if level != "warning" else verdict(state)
    assert verdict(finger.state) == after


def test_time_alone_ends_no_disagreement(finger: Finger, judge: ContactEstimator) -> None:
    corner = np.zeros((4, 4))
    corner[0, 0] = 400
    for _ in range(100):
        state = judge(5.0, (0.1, 0.0), 0.0, (0.006, 0.006), counts=corner)
    state = judge(5.0, (0.1, 0.0), 0.0, (0.006, 0.006), ms=25.0, counts=None)
    assert state.load_distribution is not None
    assert not finger.is_trusted
    finger.check_silence(state.t_ns + 6 * MS)
    assert not finger.is_trusted_for_raise(state.t_ns + 6 * MS)
    assert verdict(finger.state) == verdict(state)


def test_a_finger_with_a_pad_that_fell_silent_does_not_feel(finger: Finger, judge: ContactEstimator) -> None:
    t_ns = judge(10.0).t_ns
    judge(10.1, ms=50.0, counts=None)
    assert finger.is_trusted_for_raise(t_ns + 50 * MS)
    assert not finger.is_trusted_for_raise(t_ns + 50 * MS + 1)
    finger.disconnect_image()
    assert not finger.is_trusted_for_raise(t_ns + 50 * MS)
    judge(10.0)
    assert finger.is_trusted_for_raise(t_ns + 60 * MS)


def test_an_old_image_is_none(finger: Finger, wrench: Wrench, image: Image) -> None:
    finger.update_image(image(T0, FULL))
    edge = T0 + 30 * MS  # three periods of 100 Hz
    assert read_force(finger, wrench(edge, 10.0)).verdict.level == "stable"
    assert verdict(read_force(finger, wrench(edge + 1, 10.0))) == ("unknown", ("rotation_unobserved",))


@pytest.mark.parametrize(
    ("rate_hz", "stale_ns"), [(1000.0, 20 * MS), (150.0, 20 * MS), (100.0, 30 * MS), (10.0, 300 * MS)]
)
def test_a_stream_is_stale_after_three_periods_and_never_within_20_ms(
    left: str, parse: Parse, wrench: Wrench, rate_hz: float, stale_ns: int
) -> None:
    robotous = left.replace('"bota"', '"robotous"').replace("rate_hz = 1000.0", f"rate_hz = {rate_hz}\nbaud = 921600")
    config = parse(robotous).finger["left"]
    assert stale_after_ns(config.wrench) == stale_ns
    finger = Finger("left", config, LevelsConfig())
    read_force(finger, wrench(T0, 10.0))
    assert finger.check_silence(T0 + stale_ns) is None
    state = finger.check_silence(T0 + stale_ns + 1)
    assert state is not None
    assert verdict(state) == ("unknown", ("stale",))
    assert state.wrench is None
    assert finger.check_silence(T0 + stale_ns + 2) is None, "it is told once"
    assert finger.age_s(T0 + stale_ns + 1) == pytest.approx(stale_ns * 1e-9)


def test_a_config_may_say_when_a_stream_is_stale_but_not_when_a_grip_is_raised(
    left: str, parse: Parse, wrench: Wrench, image: Image
) -> None:
    patient = parse(left.replace("rate_hz", "stale_s = 0.1\nrate_hz")).finger["left"]
    finger = Finger("left", patient, LevelsConfig())
    finger.update_image(image(T0))
    read_force(finger, wrench(T0, 10.0))
    assert finger.check_silence(T0 + 100 * MS) is None
    assert finger.is_trusted_for_raise(T0 + 50 * MS)
    assert not finger.is_trusted_for_raise(T0 + 50 * MS + 1)
    assert verdict(finger.check_silence(T0 + 100 * MS + 1)) == ("unknown", ("stale",))


def test_a_stale_finger_knows_again_with_its_next_reading(
    finger: Finger, judge: ContactEstimator, wrench: Wrench
) -> None:
    judge(10.0)
    finger.check_silence(T0 + 1000 * MS)
    assert judge(10.0, ms=1000.0).verdict.level == "stable"


@pytest.mark.parametrize("word", ["overload", "invalid", "raw"])
def test_a_reading_that_the_sensor_distrusts_is_unknown(judge: ContactEstimator, word: str) -> None:
    judge(10.0)
    state = judge(10.0, (1.0, 0.0), status=(word,))
    assert verdict(state) == ("unknown", (word,))
    assert state.status == (word,)
    assert state.contact is None, "nothing of such a reading is told as a contact"
    assert state.utilisation is None


def test_samples_that_were_skipped_do_not_spoil_those_that_came(judge: ContactEstimator) -> None:
    assert judge(10.0, status=("skipped",)).verdict.level == "stable"


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_reading_that_is_no_number_is_unknown_and_poisons_nothing(
    finger: Finger, judge: ContactEstimator, bad: float, place: int
) -> None:
    before = judge(10.0, (1.0, 0.0))
    values = np.array((1.0, 0.0, -10.0, 0.0, 0.0, 0.0))
    values[place] = bad
    spoilt = read_force(finger, WrenchSample(T0 + 11 * MS, None, values[:3], values[3:]))
    assert verdict(spoilt) == ("unknown", ("not_finite",))
    after = judge(10.0, (1.0, 0.0), ms=2.0)
    assert verdict(after) == verdict(before)
    assert after.utilisation is not None
    assert before.utilisation is not None
    assert after.utilisation.value == pytest.approx(before.utilisation.value)


def test_a_sensor_without_torque_proves_a_grip_unsafe_at_most(finger: Finger, image: Image) -> None:
    for pulled_n, level in ((1.0, ("unknown", ("rotation_unobserved",))), (4.8, ("warning", ("translation",)))):
        finger.update_image(image(T0, FULL))
        state = read_force(finger, WrenchSample(T0, None, np.array((pulled_n, 0.0, -10.0)), None))
        assert verdict(state) == level
        assert state.model == "translation"
        assert math.isnan(state.tipping_margin_m)
    assert verdict(read_force(finger, WrenchSample(T0, None, np.zeros(3), None))) == ("no_contact", ())


def test_a_force_sensor_without_a_pad_proves_a_grip_unsafe_at_most(left: str, parse: Parse, wrench: Wrench) -> None:
    finger = make(left.partition("[finger.left.pad]")[0], parse)
    assert verdict(read_force(finger, wrench(T0, 10.0, (1.0, 0.0)))) == ("unknown", ("rotation_unobserved",))
    assert verdict(read_force(finger, wrench(T0, 10.0, (4.8, 0.0)))) == ("warning", ("translation",))
    assert math.isnan(finger.state.tipping_margin_m)


def test_a_level_is_left_a_hysteresis_below_its_threshold(judge: ContactEstimator) -> None:
    levels = pull(judge, [0.5 * 10.0 * share for share in (0.72, 0.66, 0.64, 0.86, 0.81, 0.79)])
    assert levels == ["caution", "caution", "stable", "warning", "warning", "caution"]


def test_a_contact_begins_at_the_least_force_and_ends_a_fifth_below(judge: ContactEstimator) -> None:
    levels = [judge(normal).verdict.level for normal in (0.49, 0.5, 0.41, 0.39, 0.45, 0.5)]
    assert levels == ["no_contact", "stable", "stable", "no_contact", "no_contact", "stable"]


def test_a_new_contact_knows_nothing_of_the_last(judge: ContactEstimator) -> None:
    pull(judge, [4.8, 4.8])
    judge(0.0)
    assert judge(10.0, (4.1, 0.0)).verdict.level == "caution", "no hysteresis, and no slip from the last one's load"


def test_the_mounting_stands_between_sensor_and_pad(left: str, parse: Parse, image: Image) -> None:
    pose = "{ xyz_m = [0.0, 0.0, -0.02], quat_xyzw = [1.0, 0.0, 0.0, 0.0] }"
    turned = left.replace("force_std_n = 0.0", f"force_std_n = 0.0\nsign = -1\npad_from_sensor = {pose}")
    finger = make(turned, parse)
    finger.update_image(image(T0, FULL))
    # Half a turn about X, and the load by the finger: the pad's (2, 0, −10) is the sensor's (−2, 0, −10).
    state = read_force(finger, WrenchSample(T0, None, np.array((-2.0, 0.0, -10.0)), np.zeros(3)))
    assert state.wrench is not None
    assert state.wrench[:3] == pytest.approx((2.0, 0.0, -10.0))
    assert state.wrench[3:] == pytest.approx((0.0, -0.04, 0.0)), "r × F with r 20 mm behind the pad"


class TestPressed:
    """Whether something presses is known or not; what is not known is not free."""

    def tared(self, finger: Finger, wrench: Wrench, *, t_ns: int = T0 - 100 * MS) -> None:
        finger.begin_tare(t_ns, 0.01, "someone")
        for k in range(20):
            read_force(finger, wrench(t_ns + k * MS, 0.0))
        assert finger.tare.current.id == 1

    def test_nothing_is_known_before_the_first_reading(self, finger: Finger) -> None:
        assert finger.is_pressed() is None

    def test_a_force_sensor_that_was_never_tared_is_not_believed(self, finger: Finger, wrench: Wrench) -> None:
        for normal_n in (0.0, 30.0):
            read_force(finger, wrench(T0, normal_n))
            assert finger.is_pressed() is None

    def test_a_tared_force_sensor_is(self, finger: Finger, wrench: Wrench) -> None:
        self.tared(finger, wrench)
        read_force(finger, wrench(T0, 0.1))
        assert finger.is_pressed() is False
        read_force(finger, wrench(T0, 5.0))
        assert finger.is_pressed() is True

    def test_a_fresh_image_tells_it_of_its_own(self, finger: Finger, judge: ContactEstimator) -> None:
        judge(0.0, counts=EMPTY)
        assert finger.is_pressed() is False
        judge(0.0, counts=FULL)
        assert finger.is_pressed() is True

    def test_an_old_image_does_not(self, finger: Finger, judge: ContactEstimator) -> None:
        judge(0.0, counts=EMPTY)
        judge(0.0, counts=None, ms=31.0)
        assert finger.is_pressed() is None

    def test_an_image_outvotes_a_force_sensor_that_reads_nothing(
        self, finger: Finger, judge: ContactEstimator, wrench: Wrench
    ) -> None:
        self.tared(finger, wrench)
        judge(0.1, counts=FULL)
        assert finger.is_pressed() is True

    def test_a_silent_force_sensor_is_no_free_finger(self, finger: Finger, wrench: Wrench) -> None:
        self.tared(finger, wrench)
        read_force(finger, wrench(T0, 0.0))
        finger.disconnect(T0 + 100 * MS)
        assert finger.is_pressed() is None

    @pytest.mark.parametrize(("normal_n", "known"), [(5.0, True), (0.0, None)])
    def test_an_overloaded_sensor_never_shows_a_free_finger(
        self, finger: Finger, wrench: Wrench, normal_n: float, known: bool | None
    ) -> None:
        self.tared(finger, wrench)
        read_force(finger, wrench(T0, normal_n))
        read_force(finger, wrench(T0 + MS, 0.0, status=("overload",)))
        assert finger.is_pressed() is known

    def test_charge_that_rests_by_assumption_is_no_evidence(
        self, left: str, parse: Parse, wrench: Wrench, image: Image
    ) -> None:
        finger = make(left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0"), parse)
        for k in range(5):
            read_force(finger, wrench(T0 + 10 * k * MS, 0.0))
            finger.update_image(image(T0 + 10 * k * MS, FULL))
        assert finger.is_pressed() is None

    def test_taxels_that_are_the_force_sensor_count_once_they_are_tared(self, right: str, parse: Parse) -> None:
        rest, press = np.full((4, 3), 1000.0), np.tile((1000.0, 1000.0, 3000.0), (4, 1))
        for text, known in ((right, [False, True]), (right.partition("tare =")[0], [None, None])):
            finger = make(text, parse, "right")
            found = []
            for k, counts in enumerate((rest, press)):
                finger.update_image(TactileSample(T0 + k * MS, None, counts, source="2"))
                found.append(finger.is_pressed())
            assert found == known


class TestTare:
    def test_a_tare_takes_the_bias_away(self, finger: Finger, judge: ContactEstimator) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        for _ in range(12):
            judge(2.0, (1.0, 0.0), counts=EMPTY)
        assert finger.tare.current.id == 1
        assert verdict(judge(2.0, (1.0, 0.0), counts=EMPTY)) == ("no_contact", ())
        state = judge(12.0, (2.0, 0.0))
        assert state.contact is not None
        assert state.contact.normal_n == pytest.approx(10.0)
        assert state.contact.tangential_n == pytest.approx((1.0, 0.0))

    def test_it_is_given_up_when_something_presses_meanwhile(self, finger: Finger, judge: ContactEstimator) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        for _ in range(5):
            judge(0.0, counts=EMPTY)
        judge(5.0, counts=FULL)
        assert not finger.tare.busy
        for _ in range(20):
            judge(5.0, counts=FULL)
        assert finger.tare.current.id == 0

    def test_it_is_given_up_when_its_stream_ends(self, finger: Finger, judge: ContactEstimator) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        judge(0.0, counts=EMPTY)
        finger.disconnect(T0 + 20 * MS)
        assert not finger.tare.busy

    def test_a_moments_silence_does_not_end_it(self, finger: Finger, judge: ContactEstimator) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        judge(0.0, counts=EMPTY)
        finger.check_silence(T0 + 50 * MS)
        for _ in range(12):
            judge(0.0, counts=EMPTY)
        assert finger.tare.current.id == 1

    def test_readings_that_the_sensor_distrusts_do_not_enter_it(self, finger: Finger, judge: ContactEstimator) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        for k in range(24):
            judge(0.0 if k % 2 else 500.0, counts=EMPTY, status=() if k % 2 else ("overload",))
        assert finger.tare.current.id == 1
        assert finger.tare.current.value == pytest.approx(np.zeros(6))


class TestCharge:
    """Images of a pad whose charge leaks away, beside a force sensor that says when there is contact."""

    @pytest.fixture
    def finger(self, left: str, parse: Parse) -> Finger:
        return make(left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0"), parse)

    def hold(self, judge: ContactEstimator, seconds: float) -> FingerState:
        """A press held, touched lightly first: the amplifiers' output dies away with 2 s."""
        for _ in range(20):
            judge(0.0, counts=EMPTY)
        state = judge(0.6, counts=EMPTY)
        for k in range(round(seconds / 0.01)):
            state = judge(10.0, (1.0, 0.0), counts=np.round(1000 * np.exp(-k * 0.01 / 2.0) * np.ones((4, 4))))
        return state

    def test_a_held_contact_keeps_its_image(self, finger: Finger, judge: ContactEstimator) -> None:
        state = self.hold(judge, 6.0)
        assert state.verdict.level == "stable"
        assert finger.image is not None
        assert finger.image.pressure == pytest.approx(np.full(16, 10.0), rel=0.02)

    def test_a_moments_silence_of_the_force_sensor_does_not_take_it_away(
        self, finger: Finger, judge: ContactEstimator
    ) -> None:
        self.hold(judge, 3.0)
        assert finger.check_silence(T0 + 10_000 * MS) is not None
        assert finger.image is not None
        left_over = np.round(1000 * np.exp(-3.0 / 2.0) * np.ones((4, 4)))
        assert judge(10.0, counts=left_over).verdict.level == "stable"
        assert finger.image.pressure == pytest.approx(np.full(16, 10.0), rel=0.03)

    def test_a_contact_whose_beginning_nobody_saw_has_none(self, judge: ContactEstimator) -> None:
        for _ in range(5):
            assert verdict(judge(10.0, counts=FULL)) == ("unknown", ("rotation_unobserved",))

    def test_an_image_stream_that_ended_takes_it_away(self, finger: Finger, judge: ContactEstimator) -> None:
        self.hold(judge, 1.0)
        finger.disconnect_image()
        for _ in range(5):
            assert verdict(judge(10.0, counts=FULL)) == ("unknown", ("rotation_unobserved",))
