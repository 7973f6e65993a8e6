"""One finger: staleness, readings that cannot be used, streams that it does not have, and evidence of motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from finger_bench import Press, make_finger, read_force, verdict
from fixture_types import Parse, Wrench
from nanoseconds import MS, T0
from plain_kernels import run_without_compilation

from slipd.finger import force_image_check
from slipd.finger.finger import Finger
from slipd.finger.trust import is_trusted
from slipd.publish.finger_messages import slip_body
from slipd.publish.stream_health import finger_conditions
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import Health

STALE = ("unknown", ("stale",))


@pytest.mark.parametrize(("pull_n", "level"), [(1.0, "stable"), (3.5, "caution"), (4.5, "warning")])
def test_image_of_three_periods_ago_takes_back_stable_and_caution_but_no_warning(
    finger: Finger, press: Press, wrench: Wrench, pull_n: float, level: str
) -> None:
    edge = press(10.0, (pull_n, 0.0)).t_ns + 30 * MS
    state = read_force(finger, wrench(edge, 10.0, (pull_n, 0.0)))
    assert (state.verdict.level, finger.check_silence(edge)) == (level, None)
    after = ("unknown", ("rotation_unobserved",)) if level != "warning" else verdict(state)
    changed = finger.check_silence(edge + 1)
    assert (changed is None) is (level == "warning")
    assert verdict(finger.state) == after
    assert finger.check_silence(edge + 2) is None, "it is reported once"
    if level != "warning":
        assert slip_body(finger, finger.state)["model"] == "none"
        assert verdict(read_force(finger, wrench(edge + 1, 10.0, (pull_n, 0.0)))) == after


@pytest.mark.parametrize(
    ("rate_hz", "stale_ns"), [(1000.0, 20 * MS), (150.0, 20 * MS), (100.0, 30 * MS), (10.0, 300 * MS)]
)
def test_stream_is_stale_after_three_periods_but_not_within_20_ms(
    left: str, parse: Parse, wrench: Wrench, rate_hz: float, stale_ns: int
) -> None:
    text = left.replace('"bota"', '"robotous"').replace("rate_hz = 1000.0", f"rate_hz = {rate_hz}\nbaud = 921600")
    finger = make_finger(text, parse)
    assert (verdict(finger.state), finger.check_silence(T0), finger.freshness.age_s(T0)) == (STALE, None, None), (
        "nothing changed"
    )
    read_force(finger, wrench(T0, 10.0))
    assert finger.check_silence(T0 + stale_ns) is None
    state = finger.check_silence(T0 + stale_ns + 1)
    assert (verdict(state), state.wrench) == (STALE, None)
    assert finger.check_silence(T0 + stale_ns + 2) is None, "it is reported once"
    assert finger.freshness.age_s(T0 + stale_ns + 1) == pytest.approx(stale_ns * 1e-9)
    assert read_force(finger, wrench(T0 + stale_ns + 3, 10.0)).contact is not None


def test_finger_refuses_streams_that_it_does_not_have(left: str, right: str, parse: Parse) -> None:
    padless = make_finger(left.partition("[finger.left.pad]")[0], parse)
    sensorless = make_finger(right, parse, "right")
    with pytest.raises(ValueError, match="finger right has no force sensor"):
        read_force(sensorless, WrenchSample(T0, None, np.zeros(3), np.zeros(3)))
    padless.disconnect_image()
    assert padless.update_image(TactileSample(T0, None, np.zeros(16))) == ()
    assert list(padless.channels) == ["wrench"]


NOT_FINITE = ("unknown", ("not_finite",))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_N1_a_reading_that_is_not_finite_is_unknown_and_affects_no_other(
    finger: Finger, press: Press, bad: float, place: int
) -> None:
    before = press(10.0, (1.0, 0.0))
    values = np.where(np.arange(6) == place, bad, (1.0, 0.0, -10.0, 0.0, 0.0, 0.0))
    assert verdict(read_force(finger, WrenchSample(T0 + 11 * MS, None, values[:3], values[3:]))) == NOT_FINITE
    after = press(10.0, (1.0, 0.0), ms=2.0)
    assert (verdict(after), after.utilisation.value) == (verdict(before), pytest.approx(before.utilisation.value))


@pytest.mark.parametrize("word", ["overload", "invalid", "raw"])
def test_a_reading_that_its_sensor_marks_is_unknown(press: Press, word: str) -> None:
    press(10.0)
    marked = press(10.0, (1.0, 0.0), status=(word,))
    assert (verdict(marked), marked.status, marked.contact, marked.utilisation) == (
        ("unknown", (word,)), (word,), None, None,
    )  # fmt: skip


def test_N1_a_three_axis_image_that_is_not_finite_is_unknown(right: str, parse: Parse) -> None:
    image = TactileSample(T0, None, np.full((4, 3), math.nan))
    ((state,),) = make_finger(right, parse, "right").update_image(image)
    assert (verdict(state), state.wrench) == (NOT_FINITE, None)


def test_tare_that_was_given_up_is_reported(right: str, parse: Parse) -> None:
    finger = make_finger(right, parse, "right")
    finger.begin_tare(T0, 0.1, "someone")
    finger.disconnect(T0)
    assert finger_conditions(finger, "pad", T0) == [(Health.OK, "the last tare was given up: the stream ended")]


def test_old_image_does_not_end_a_disagreement(finger: Finger, press: Press, monkeypatch: pytest.MonkeyPatch) -> None:
    run_without_compilation(monkeypatch, force_image_check)
    corner = 400 * (np.arange(16) == 0).reshape(4, 4)
    for _ in range(100):
        state = press(5.0, (0.1, 0.0), 0.0, (0.006, 0.006), counts=corner)
    state = press(5.0, (0.1, 0.0), 0.0, (0.006, 0.006), ms=25.0, counts=None)
    assert state.load_distribution is not None
    assert not is_trusted(finger.state.verdict)
    finger.check_silence(state.t_ns + 6 * MS)
    assert not finger.trust.for_raise(state.t_ns + 6 * MS)
    assert verdict(finger.state) == verdict(state)


def test_F3_three_axis_taxels_are_compared_with_the_force_sensor_behind_them(
    left: str, right: str, parse: Parse, wrench: Wrench
) -> None:
    pads = [text.partition(f"[finger.{name}.pad]") for name, text in (("left", left), ("right", right))]
    finger = make_finger(pads[0][0] + pads[0][1] + pads[1][2], parse)
    for t_ns in range(T0, T0 + 200 * MS, 10 * MS):
        finger.update_image(TactileSample(t_ns, None, np.full((4, 3), 1000.0), source="2"))
        read_force(finger, wrench(t_ns, 5.0))
    assert verdict(finger.state) == ("unknown", ("disagreement", "disagreement_contact"))


def test_only_images_in_front_of_a_force_sensor_are_looked_at(left: str, parse: Parse) -> None:
    finger = make_finger(left, parse)
    with pytest.raises(ValueError, match="before it is confirmed"):
        finger.motion.confirm()
    assert make_finger(left.split("[finger.left.pad]")[0], parse).motion is None


def test_evidence_from_elsewhere_is_a_slip_only_of_a_finger_that_touches_and_is_trusted(
    finger: Finger, wrench: Wrench
) -> None:
    assert finger.note_motion(T0 + 500 * MS, ("width",)) is None, "no reading yet"
    for t_ns, normal_n, status, slips in (
        (T0, 0.0, (), False),
        (T0 + MS, 8.0, ("invalid",), False),
        (T0 + 2 * MS, 8.0, (), True),
    ):
        read_force(finger, wrench(t_ns, normal_n, status=status))
        state = finger.note_motion(T0 + 500 * MS, ("width",))
        assert (state is not None) == slips
    assert (state.verdict.level, state.verdict.reasons[0]) == ("slipping", "slip_detected")
