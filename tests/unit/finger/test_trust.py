"""What cannot be believed makes the verdict unknown, is told, and comes back when it is well again."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from force_readings import read_force

from slipd.config import Config, Levels
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.samples import Array, TactileSample, WrenchSample
from slipd_client.messages import Health

MS = 1_000_000
T0 = 100_000_000_000
Parse = Callable[[str], Config]


def taxel_faults(finger: Finger) -> dict[str, list[int]]:
    assert finger.image is not None
    return {kind: places for kind, places in finger.image.taxel_health.report().items() if places}


class Hand:
    """A finger that is pressed, pulled and looked at by its pad, with noise on everything."""

    def __init__(self, finger: Finger) -> None:
        self.finger = finger
        self.t_ns = T0
        self.rng = np.random.default_rng(1)
        self.state = finger.state

    def read(self, normal_n: float, pull_n: float = 0.0, *, at_m: tuple[float, float] = (0.0, 0.0)) -> FingerState:
        force = np.array((pull_n, 0.0, -normal_n)) + self.rng.normal(0.0, 0.002, 3)
        return self.send(force, np.cross((*at_m, 0.0), force))

    def send(self, force: Array, torque: Array) -> FingerState:
        self.t_ns += MS
        self.state = read_force(self.finger, WrenchSample(self.t_ns, None, force, torque))
        return self.state

    def look(self, normal_n: float, spoil: Callable[[Array], None] = lambda _: None) -> None:
        counts = np.round(100 * normal_n / 16 + self.rng.normal(0.0, 1.0, 16))
        spoil(counts)
        self.finger.update_image(TactileSample(self.t_ns, None, counts))

    def hold(
        self, seconds: float, spoil: Callable[[Array], None] = lambda _: None, **contact: tuple[float, float]
    ) -> None:
        """Presses with 8 N that swing by a quarter, at 100 Hz, an image each 20 ms."""
        for k in range(round(seconds * 100)):
            normal_n = 8.0 + 2.0 * math.sin(0.1 * k)
            self.t_ns += 9 * MS
            self.read(normal_n, 0.8, **contact)
            if k % 2 == 0:
                self.look(normal_n, spoil)
        self.read(8.0, 0.8, **contact)

    @property
    def told(self) -> tuple[str, tuple[str, ...]]:
        return self.state.verdict.level, self.state.verdict.reasons

    def conditions(self, kind: str) -> list[tuple[Health, str]]:
        return self.finger.conditions(kind, self.t_ns)


@pytest.fixture
def make(left: str, parse: Parse) -> Callable[[str], Hand]:
    """A hand on the left finger; ``more`` are further lines of its force sensor or, behind the pad's table, its pad."""

    def make(wrench: str = "", pad: str = "") -> Hand:
        text = left.replace("stuck_after = 0", wrench) + pad
        return Hand(Finger("left", parse(text.replace("rate_hz = 100.0", "rate_hz = 50.0")).finger["left"], Levels()))

    return make


@pytest.fixture
def hand(make: Callable[..., Hand]) -> Hand:
    return make()


def test_F1_a_force_sensor_that_repeats_itself_is_stuck_until_it_moves_again(hand: Hand) -> None:
    hand.look(8.0)
    assert hand.read(8.0).verdict.level == "stable"
    for _ in range(60):
        hand.send(np.array((0.1, 0.0, -8.0)), np.zeros(3))
    assert hand.told == ("unknown", ("stuck",))
    assert hand.conditions("wrench")[0][0] == Health.ERROR
    hand.look(8.0)
    hand.read(8.0)
    assert hand.told == ("stable", ())
    assert hand.conditions("wrench") == []


def test_a_sensor_whose_readings_rest_may_say_so(make: Callable[..., Hand]) -> None:
    hand = make("stuck_after = 0")
    hand.look(8.0)
    for _ in range(70):
        hand.send(np.array((0.1, 0.0, -8.0)), np.zeros(3))
    assert hand.told[0] == "unknown", "its image is too old by now"
    hand.look(8.0)
    hand.send(np.array((0.1, 0.0, -8.0)), np.zeros(3))
    assert hand.told == ("stable", ())


def test_F1_readings_out_of_range_are_garbage(make: Callable[..., Hand]) -> None:
    hand = make("range_n = 100.0")
    hand.look(8.0)
    for _ in range(5):
        hand.read(500.0)
    assert hand.told == ("unknown", ("garbage",))
    assert "out of range_n" in hand.conditions("wrench")[0][1]


def test_F1_a_stream_that_fails_again_and_again_is_told_and_believed_while_it_is_there(hand: Hand) -> None:
    for _ in range(4):
        for _ in range(20):
            hand.read(0.0)
        hand.t_ns += 300 * MS
    hand.read(0.0)
    assert hand.told == ("no_contact", ())
    assert (Health.WARN, "it failed several times within 10 s") in hand.conditions("wrench")


def test_T3_a_pad_that_repeats_itself_while_the_force_moves_hangs(hand: Hand) -> None:
    def freeze(counts: Array) -> None:
        counts[:] = 50.0

    hand.hold(0.3, freeze)
    assert hand.told == ("unknown", ("stuck", "rotation_unobserved"))
    assert (Health.ERROR, "its images repeat while the force moves: it hangs") in hand.conditions("pad")
    hand.hold(0.3)
    assert hand.told == ("stable", ())


def test_T1_a_dead_taxel_is_masked_and_told_within_a_second(hand: Hand) -> None:
    def kill(counts: Array) -> None:
        counts[5] = 0.0

    hand.hold(1.0, kill)
    assert hand.finger.image is not None
    assert taxel_faults(hand.finger) == {"dead": [5]}
    assert hand.finger.image.pressure[5] > 0.3, "its neighbours speak for it"
    assert (Health.WARN, "taxels that are not believed: dead 5") in hand.conditions("pad")
    assert hand.told == ("stable", ())


def test_T1_a_taxel_at_full_scale_is_told_as_saturated(make: Callable[..., Hand]) -> None:
    hand = make(pad="full_scale = 4095.0\n")

    def saturate(counts: Array) -> None:
        counts[10] = 4095.0

    hand.hold(1.2, saturate)
    assert hand.finger.image is not None
    assert taxel_faults(hand.finger) == {"saturated": [10]}


def test_T1_an_image_with_too_many_bad_taxels_is_not_used(make: Callable[..., Hand]) -> None:
    hand = make(pad="full_scale = 4095.0\n")

    def saturate(counts: Array) -> None:
        counts[:8] = 4095.0

    hand.hold(1.2, saturate)
    assert hand.told == ("unknown", ("rotation_unobserved",))
    level, message = hand.conditions("pad")[0]
    assert level == Health.ERROR
    assert message.startswith("too many taxels cannot be believed")


def test_T1_masked_taxels_of_a_three_axis_pad_give_no_force_of_their_own(right: str, parse: Parse) -> None:
    text = right.replace("rows = 2", "rows = 4").replace("cols = 2", "cols = 4").partition("tare = ")[0]
    finger = Finger("right", parse(text + "full_scale = 65535.0\n").finger["right"], Levels())
    rng = np.random.default_rng(2)
    for k in range(120):
        counts = np.tile((0.0, 0.0, 500.0 + 100.0 * math.sin(0.5 * k)), (16, 1)) + rng.normal(0.0, 3.0, (16, 3))
        counts[6] = (9000.0, 9000.0, 65535.0)
        judged = finger.update_image(TactileSample(T0 + k * 10 * MS, None, counts))
    assert judged is not None
    (state,) = judged
    assert finger.image is not None
    assert taxel_faults(finger) == {"saturated": [6]}
    assert state.wrench is not None
    assert abs(state.wrench[0]) < 0.1
    assert state.wrench[2] == pytest.approx(-16 * 0.5, rel=0.3)


def test_F3_a_centroid_that_the_image_does_not_show_is_a_disagreement(hand: Hand) -> None:
    hand.hold(0.3)
    assert hand.told == ("stable", ())
    hand.hold(0.3, at_m=(0.005, 0.0))
    assert hand.told == ("unknown", ("disagreement", "disagreement_centroid"))
    hand.hold(0.5)
    assert hand.told == ("stable", ())


def test_F3_a_force_that_a_calibrated_image_does_not_show_is_a_disagreement(make: Callable[..., Hand]) -> None:
    hand = make(pad="gain_error = 0.05\n")
    hand.hold(0.3)
    assert hand.told == ("stable", ())

    def halve(counts: Array) -> None:
        counts *= 0.3

    hand.hold(0.3, halve)
    assert hand.told == ("unknown", ("disagreement", "disagreement_force"))
    hand.finger.disconnect_image()
    hand.read(8.0)
    assert hand.told == ("unknown", ("rotation_unobserved",)), "what was compared is gone"


def test_a_force_without_torque_has_no_centroid_to_compare(hand: Hand) -> None:
    for k in range(40):
        normal_n = 8.0 + 2.0 * math.sin(0.5 * k)
        hand.t_ns += 10 * MS
        force = np.array((0.1, 0.0, -normal_n)) + hand.rng.normal(0.0, 0.002, 3)
        hand.state = read_force(hand.finger, WrenchSample(hand.t_ns, None, force, None))
        hand.look(normal_n)
    assert hand.told == ("unknown", ("rotation_unobserved",))


def test_a_calibrated_charge_pad_follows_the_force_sensor(make: Callable[..., Hand]) -> None:
    hand = make(pad="gain_error = 0.05\ncharge_tau_s = 2.0\n")
    for _ in range(50):
        hand.t_ns += 19 * MS
        hand.read(0.0)
        hand.look(0.0)
    for k in range(200):
        hand.t_ns += 9 * MS
        hand.read(8.0 + 2.0 * math.sin(0.5 * k))
        hand.look(8.0 + 2.0 * math.sin(0.5 * k))  # a charge that does not leak: its integral runs away
    assert hand.finger.image is not None
    free_running = 10.0 + 8.0 * 2.0 / 2.0
    assert hand.finger.image.pressure.sum() < free_running, "the force sensor holds it back"


def test_C4_F1_a_reading_that_arrives_too_late_is_stale(hand: Hand) -> None:
    hand.look(8.0)
    assert hand.read(8.0).verdict.level == "stable"
    late = WrenchSample(hand.t_ns + 50 * MS, None, np.array((0.0, 0.0, -8.0)), np.zeros(3))
    state = read_force(hand.finger, late, hand.t_ns + 10 * MS)
    assert (state.verdict.level, state.verdict.reasons) == ("unknown", ("stale",))
    assert hand.finger.age_s(hand.t_ns + 50 * MS) == pytest.approx(0.04)


@pytest.mark.parametrize(("pull_n", "spin_nm", "reason"), [(0.0, 9e5, "rotation"), (9e5, 0.0, "translation")])
def test_N3_a_load_beyond_anything_that_is_held_is_a_danger(
    hand: Hand, pull_n: float, spin_nm: float, reason: str
) -> None:
    hand.look(8.0)
    hand.send(np.array((pull_n, 0.0, -8.0)), np.array((0.0, 0.0, spin_nm)))
    assert hand.told == ("warning", (reason,))


@pytest.mark.parametrize(("force_n", "torque_nm"), [(3e38, 0.0), (-3e38, 0.0), (0.0, 3e38), (1e120, 1e120)])
@pytest.mark.parametrize("more", ["", "range_n = 80.0", "range_nm = 5.0"])
def test_F1_a_single_reading_beyond_what_a_sensor_can_state_is_unknown(
    make: Callable[..., Hand], force_n: float, torque_nm: float, more: str
) -> None:
    hand = make(f"stuck_after = 0\n{more}")
    for _ in range(3):
        hand.look(8.0)
        hand.read(8.0)
        assert hand.told == ("stable", ())
        hand.send(np.array((0.0, 0.0, force_n - 8.0)), np.array((0.0, 0.0, torque_nm)))
        assert hand.told == ("unknown", ("garbage",))
        level, message = hand.finger.conditions("wrench", hand.t_ns)[0]
        assert level == Health.ERROR
        assert "out of range_n or range_nm" in message
        for _ in range(40):
            hand.read(8.0)


def test_N1_readings_that_are_not_finite_are_reported_as_such_however_many(hand: Hand) -> None:
    for _ in range(10):
        hand.send(np.full(3, math.nan), np.zeros(3))
        assert hand.told == ("unknown", ("not_finite",))
    assert hand.conditions("wrench") == [(Health.ERROR, "its readings are not finite numbers")]


def test_a_finger_needs_a_stream_and_takes_only_its_own(left: str, right: str, parse: Parse) -> None:
    config = parse(left + right)
    bare = config.finger["left"].model_copy(update={"wrench": None, "pad": None})
    with pytest.raises(ValueError, match="has no stream"):
        Finger("left", bare, Levels())
    seeing = Finger("right", config.finger["right"], Levels())
    with pytest.raises(ValueError, match="has no force sensor"):
        read_force(seeing, WrenchSample(T0, None, np.zeros(3), np.zeros(3)))
    feeling = Finger("left", config.finger["left"].model_copy(update={"pad": None}), Levels())
    assert feeling.update_image(TactileSample(T0, None, np.zeros(16))) is None
    feeling.disconnect_image()
    assert feeling.channel("pad") is None


def test_a_tare_of_a_pad_that_was_given_up_is_told(right: str, parse: Parse) -> None:
    finger = Finger("right", parse(right).finger["right"], Levels())
    finger.begin_tare(T0, 0.1, "someone")
    finger.disconnect(T0)
    assert finger.conditions("pad", T0) == [(Health.OK, "the last tare was given up: the stream ended")]


def test_a_tare_that_is_being_measured_is_given_up_by_its_undo(hand: Hand) -> None:
    hand.finger.begin_tare(T0, 0.1, "someone")
    assert hand.finger.undo_tare()
    assert hand.finger.tare.current.id == 0
    assert not hand.finger.undo_tare()


def test_F2_what_a_device_says_of_itself_shows_in_the_health_of_its_stream(hand: Hand) -> None:
    reading = np.array((0.0, 0.0, -8.0)), np.zeros(3)
    read_force(hand.finger, WrenchSample(T0, None, *reading, ("overload",)))
    assert hand.conditions("wrench") == [(Health.ERROR, "the device reports: overload")]
    read_force(hand.finger, WrenchSample(T0 + MS, None, *reading, ("skipped",)))
    assert hand.conditions("wrench") == [(Health.WARN, "the device reports: skipped")]
    hand.finger.update_image(TactileSample(T0, None, np.full(16, 50.0), ("saturated",)))
    assert hand.conditions("pad") == [(Health.WARN, "the device reports: saturated")]


def test_an_image_that_grows_old_takes_its_verdict_along_before_the_next_force_reading(hand: Hand) -> None:
    hand.look(8.0)
    hand.t_ns += 55 * MS
    assert hand.read(8.0).verdict.level == "stable"
    assert hand.finger.check_silence(hand.t_ns + 3 * MS) is None
    state = hand.finger.check_silence(hand.t_ns + 5 * MS)
    assert state is not None
    assert (state.verdict.level, state.verdict.reasons, state.model) == ("unknown", ("rotation_unobserved",), "none")
    assert hand.finger.check_silence(hand.t_ns + 6 * MS) is None


def test_a_tare_does_not_go_on_over_a_long_silence(hand: Hand) -> None:
    hand.read(0.0)
    hand.finger.begin_tare(hand.t_ns, 0.1, "someone")
    hand.finger.check_silence(hand.t_ns + 400 * MS)
    assert hand.finger.tare.busy
    hand.finger.check_silence(hand.t_ns + 600 * MS)
    assert (hand.finger.tare.busy, hand.finger.tare.aborted_reason) == (False, "the stream fell silent")


@pytest.mark.parametrize("normal_n", [0.0, 0.3])
def test_a_weight_that_may_hide_a_contact_makes_no_free_finger(make: Callable[..., Hand], normal_n: float) -> None:
    hand = make("mass_kg = 0.1\n")
    hand.finger.begin_tare(hand.t_ns, 0.01, "someone")
    for _ in range(20):
        hand.read(0.0)
    assert hand.finger.tare.current.id == 1
    hand.read(normal_n)
    assert hand.told == ("unknown", ("weight_unknown",))
    assert hand.finger.is_pressed() is None
    force = hand.finger.force
    assert force is not None
    force.set_gravity([0.0, 0.0, -9.8], hand.t_ns)
    force.begin_tare(hand.t_ns, 0.01, "someone")
    for _ in range(20):
        hand.read(0.0)
    assert hand.told == ("no_contact", ())
    assert hand.finger.is_pressed() is False
    force.gravity.forget()
    hand.read(normal_n)
    assert hand.told == ("unknown", ("weight_unknown",)), "the host slept"


def test_the_doubt_of_a_weight_is_a_bound_of_the_utilisation(make: Callable[..., Hand]) -> None:
    hand = make("mass_kg = 0.1\n")
    hand.look(2.0)
    hand.read(2.0, 0.5)
    assert hand.told[0] == "warning", "λ may reach (0.5 + 0.98 / μ...) / (2.0 − 0.98)"
    hand.look(0.9)
    hand.read(0.9, 0.1)
    assert hand.told == ("warning", ("translation", "weight_unknown")), "the weight may be all that presses"


def test_a_centroid_that_a_weight_may_have_moved_outside_is_a_danger(make: Callable[..., Hand]) -> None:
    hand = make("mass_kg = 0.01\ncom_m = [0.0, 0.0, -0.6]\n")
    hand.look(5.0)
    hand.read(5.0)
    level, reasons = hand.told
    assert level in ("caution", "warning")
    assert {"tipping", "weight_unknown"} <= set(reasons)


def test_an_image_that_its_device_distrusts_shows_nothing(hand: Hand) -> None:
    hand.finger.update_image(TactileSample(T0, None, np.full(16, 50.0), ("invalid",)))
    hand.read(8.0)
    assert hand.told == ("unknown", ("rotation_unobserved",))
    assert hand.conditions("pad") == [(Health.ERROR, "the device reports: invalid")]


def test_a_held_load_that_the_pad_does_not_show_is_no_drift(make: Callable[..., Hand]) -> None:
    hand = make("drift_tau_s = 20.0\n")
    force = hand.finger.force
    assert force is not None
    for _ in range(1200):
        hand.t_ns += 99 * MS
        hand.read(1.5)
        hand.look(0.0)
    assert force.drift.value[2] == pytest.approx(0.0, abs=0.01)
    assert hand.told[1][0] == "disagreement"


def test_the_readings_of_one_read_are_judged_as_if_they_came_singly(left: str, parse: Parse) -> None:
    rng = np.random.default_rng(5)
    forces = rng.normal(0.0, 1.0, (300, 3)) + np.array((1.0, 0.0, -2.0))
    forces[::17, 2] = 0.3
    times_ns = [T0 + k * MS // 16 for k in range(len(forces))]
    samples = [WrenchSample(times_ns[-1], None, f, np.cross((0.001, 0.0, 0.0), f)) for f in forces]
    told = []
    for size in (1, 7, 300):
        finger = Finger("left", parse(left).finger["left"], Levels())
        finger.update_image(TactileSample(T0, None, np.full(16, 50.0)))
        states = []
        for at in range(0, len(samples), size):
            for judged in finger.decide(samples[at : at + size], times_ns[at : at + size]):
                states += list(judged)
        told.append([(state.verdict, state.utilisation and state.utilisation[:3]) for state in states])
    assert told[0] == told[1] == told[2]
    assert {verdict.level for verdict, _ in told[0]} >= {"stable", "warning", "no_contact"}


def test_a_tare_is_taken_from_readings_that_come_together(hand: Hand) -> None:
    hand.finger.begin_tare(T0, 0.01, "someone")
    samples = [WrenchSample(T0 + k * MS, None, np.full(3, 0.1), np.zeros(3)) for k in range(30)]
    read = hand.finger.decide(samples, [sample.t_ns for sample in samples])
    states = [state for judged in read for state in judged]
    assert hand.finger.tare.current.id == 1
    assert states[0].wrench == pytest.approx((0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    assert states[-1].wrench == pytest.approx((0.0,) * 6)


def test_N1_a_three_axis_image_without_numbers_is_no_reading(right: str, parse: Parse) -> None:
    finger = Finger("right", parse(right).finger["right"], Levels())
    judged = finger.update_image(TactileSample(T0, None, np.full((4, 3), math.nan)))
    assert judged is not None
    (state,) = judged
    assert (state.verdict.level, state.verdict.reasons, state.wrench) == ("unknown", ("not_finite",), None)
