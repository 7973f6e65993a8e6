"""From taxel counts to the pressure on each taxel: tare, scale, charge, masked taxels, threshold; unusable images."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from finger_bench import EMPTY, Press, make_finger, taxel_faults, verdict
from fixture_types import Image, Parse
from known_zeros import known_finger
from nanoseconds import MS, T0

from slipd.config import Levels
from slipd.finger.finger import Finger
from slipd.finger.force_image_check import ForceSummary
from slipd.finger.image_channel import ImageChannel
from slipd.fusion import contact_from_wrench
from slipd.fusion.rows import TOUCHING, Rows
from slipd.fusion.streaming import new_readings
from slipd.types.samples import TactileSample

MakePress = Callable[[Finger], Press]
UNSEEN = ("unknown", ("rotation_unobserved",))


@pytest.fixture
def charged(left: str, parse: Parse) -> Finger:
    """A finger with a pad whose charge leaks away, beside a force sensor that shows when there is contact."""
    return make_finger(left.replace("threshold = 0.05", "threshold = 0.05\ncharge_tau_s = 2.0"), parse)


def leaked(seconds: float) -> np.ndarray:
    """Return what is left over of a press of 10 N on each taxel."""
    return np.full((4, 4), np.round(1000 * np.exp(-seconds / 2.0)))


def hold(press: Press, seconds: float) -> None:
    """Hold a press after a light touch; the output of the amplifiers decays with 2 s."""
    for _ in range(20):
        press(0.0, counts=EMPTY)
    press(0.6, counts=EMPTY)
    for k in range(round(seconds / 0.01)):
        assert press(10.0, (1.0, 0.0), counts=leaked(0.01 * k)).verdict.level == "stable"


def test_held_contact_keeps_its_image_also_through_a_short_silence_of_the_force_sensor_and_another_zero(
    charged: Finger, make_press: MakePress
) -> None:
    press, image = make_press(charged), charged.image
    hold(press, 3.0)
    whole = pytest.approx(np.full(16, 10.0), rel=0.03)
    assert image.pressure == whole
    assert charged.check_silence(T0 + 10_000 * MS) is not None
    by_config = image.tare.current
    for change in (
        lambda: None,
        lambda: image.tare.restore(replace(by_config, id=1, value=by_config.value + 200.0, origin="stored")),
        lambda: image.tare.reject("the normal force is clearly negative"),
    ):
        change()
        assert press(10.0, counts=leaked(3.0)).verdict.level == "stable"
        assert image.pressure == whole
    assert image.tare.current is by_config


@pytest.mark.parametrize("held_s", [0.0, 1.0])
def test_contact_that_began_unseen_or_lost_its_stream_has_no_image(
    charged: Finger, make_press: MakePress, held_s: float
) -> None:
    press = make_press(charged)
    if held_s:
        hold(press, held_s)
        charged.disconnect_image()
    assert {verdict(press(10.0)) for _ in range(5)} == {UNSEEN}


def test_T1_masked_three_axis_taxels_are_replaced_by_their_neighbours(right: str, parse: Parse) -> None:
    text = right.replace("rows = 2", "rows = 4").replace("cols = 2", "cols = 4").partition("tare = ")[0]
    finger = known_finger("right", parse(text + "full_scale = 65535.0\n").finger["right"], Levels())
    rng = np.random.default_rng(2)
    for k in range(120):
        counts = np.tile((0.0, 0.0, 500.0 + 100.0 * math.sin(0.5 * k)), (16, 1)) + rng.normal(0.0, 3.0, (16, 3))
        counts[6] = (9000.0, 9000.0, 65535.0)
        (batch,) = finger.update_image(TactileSample(T0 + k * 10 * MS, None, counts))
    (state,) = batch
    assert taxel_faults(finger) == {"saturated": [6]}
    assert abs(state.wrench[0]) < 0.1
    assert state.wrench[2] == pytest.approx(-16 * 0.5, rel=0.3)


RAMP = np.arange(16.0).reshape(4, 4) * 10.0


@pytest.fixture
def make(left: str, parse: Parse) -> Callable[..., ImageChannel]:
    """A pad of 4×4 taxels at 4 mm, 0.01 N a count, threshold 0.05 N; ``more`` are further lines of its config."""

    def make(rule: str = "matched", more: str = "") -> ImageChannel:
        finger = parse(left + more).finger["left"]
        pad = finger.pad
        channel = ImageChannel(pad, finger.model_copy(update={"load_rule": rule}))
        channel.tare.observe(T0)
        return channel

    return make


def pressed() -> Rows:
    """Return a reading of 8 N at the middle of the pad."""
    readings = new_readings([(0.0, 0.0, -8.0, 0.0, 0.0, 0.0)], [T0])
    readings["phase"], readings["contact"] = TOUCHING, contact_from_wrench((0.0, 0.0, -8.0), (0.0, 0.0, 0.0))
    return readings


def known(pad: ImageChannel) -> tuple[bool, bool, bool]:
    """Return whether the pad knows a load distribution, a shape, and whether something touches."""
    return pad.load_distribution(pressed()) is not None, pad.shape() is not None, pad.shows_contact() is not None


def test_an_image_is_known_from_its_coming_until_it_is_spoilt_or_forgotten(
    make: Callable[..., ImageChannel], image: Image
) -> None:
    pad, spoilt = make(), RAMP.copy()
    spoilt[2, 2] = np.nan
    assert (known(pad), pad.wrench(), pad.fresh_until_ns) == ((False,) * 3, None, -1)
    for counts in (RAMP, spoilt, RAMP):
        pad.update(image(T0, counts), T0)
        assert known(pad) == (counts is RAMP,) * 3
        assert pad.pressure.any() == (counts is RAMP)
    assert pad.fresh_until_ns == T0 + pad.freshness.stale_ns
    pad.forget()
    assert (known(pad), pad.t_ns, pad.fresh_until_ns) == ((False,) * 3, None, -1)


@pytest.mark.parametrize(("name", "noise"), [("left", np.ones(16)), ("right", np.tile((50.0, 50.0, 1.0), (4, 1)))])
def test_a_taxel_within_the_noise_of_its_tare_shows_neither_a_contact_nor_none(
    name: str, noise: np.ndarray, rig: str, parse: Parse
) -> None:
    finger = parse(rig.replace("threshold = 0.05", "threshold = 0.0")).finger[name]
    pad = ImageChannel(finger.pad, finger)
    pad.begin_tare(T0, 0.1, "someone")
    shown = []
    for k, counts in enumerate((*(300.0 + k % 2 * noise for k in range(12)), 299.0, 302.0, 310.0)):
        pad.update(TactileSample(T0 + k * 10 * MS, None, np.broadcast_to(counts, noise.shape)), T0 + k * 10 * MS)
        shown.append(pad.shows_contact())
    assert (pad.tare.busy, shown[-3:]) == (False, [False, None, True])


def test_counts_become_newtons_above_the_threshold(make: Callable[..., ImageChannel], image: Image) -> None:
    pad = make(more=f"tare = {[100.0] * 16}\n")
    counts = np.full(16, 100.0)
    counts[3:7] = 300.0, 106.0, 105.0, 0.0
    pad.update(image(T0, counts), T0)
    assert pad.pressure == pytest.approx([0.0] * 3 + [2.0, 0.06] + [0.0] * 11)
    assert pad.shows_contact() is True
    pad.update(image(T0 + 1, np.full(16, 105.0)), T0 + 1)
    assert (pad.shows_contact(), pad.load_distribution(pressed())) == (False, None)
    shape = pad.shape()
    assert shape.active == 0


@pytest.mark.parametrize(("status", "origin"), [((), "observed"), (("invalid",), None)])
def test_images_of_a_free_pad_that_read_nothing_show_its_zero_unless_they_are_doubtful(
    left: str, parse: Parse, status: tuple[str, ...], origin: str | None
) -> None:
    config = parse(left).finger["left"]
    pad = ImageChannel(config.pad, config)
    for k in range(1000):
        sample = TactileSample(T0 + k * 10 * MS, None, np.zeros(16), status)
        pad.update(sample, sample.t_ns, ForceSummary(True, 0.0 + 0.001 * k, moving=False, agrees=True))
    assert pad.zero.origin == origin


def test_image_states_why_it_cannot_be_used(make: Callable[..., ImageChannel], image: Image) -> None:
    spoilt = RAMP.copy()
    spoilt[2, 2] = np.nan
    for more, counts, status, reasons in (
        ("", RAMP, (), ()),
        ("", RAMP, ("saturated",), ()),
        ("", RAMP, ("overload", "invalid"), ("invalid", "overload")),
        ("", spoilt, ("invalid",), ("invalid", "not_finite")),
        ("", 1e15 * RAMP, (), ("garbage",)),
        ("gain_error = 0.1\n", 1e9 * RAMP, (), ("garbage",)),
        ("charge_tau_s = 2.0\n", RAMP, (), ("contact_unseen",)),
    ):
        pad, sample = make(more=more), image(T0, counts)
        sample.status = status
        assert pad.reasons == ("stale",)
        pad.update(sample, sample.t_ns)
        assert pad.reasons == reasons
        assert pad.is_independent is known(pad)[1] is not bool(reasons)


@pytest.mark.parametrize(
    ("swap", "force_n", "at_m"),
    [("", (0.2, -0.1, -3.0), (0.002, -0.002, 0.0)), ("swap_xy = true\n", (-0.1, 0.2, -3.0), (-0.002, 0.002, 0.0))],
)
def test_three_axis_taxels_give_a_wrench_that_is_turned_with_the_pad(
    right: str, parse: Parse, swap: str, force_n: tuple[float, ...], at_m: tuple[float, ...]
) -> None:
    """0.2 N and −0.1 N of shear, 3 N into the pad at (+2, −2) mm."""
    config = parse(right.replace("pitch_m", swap + "pitch_m"))
    pad = known_finger("right", config.finger["right"], Levels()).image
    assert pad.three_axis
    counts = np.full((4, 3), 1000.0)
    counts[1] += (200.0, -100.0, 3000.0)
    pad.update(TactileSample(T0, None, counts), T0)
    assert pad.wrench() == pytest.approx((*force_n, *np.cross(at_m, force_n)))
    assert sorted(pad.pressure) == pytest.approx([0.0, 0.0, 0.0, 3.0])


@pytest.mark.parametrize(
    ("more", "centre_m"),
    [("", (0.0, -0.006)), ("flip_y = true\n", (0.0, 0.006)), ("swap_xy = true\n", (-0.006, 0.0))],
)
def test_contact_shape_is_in_the_pad_frame(
    make: Callable[..., ImageChannel], image: Image, more: str, centre_m: tuple[float, float]
) -> None:
    pad = make(more=more)
    pad.update(image(T0, np.where(np.arange(16) < 4, 100.0, 0.0)), T0)  # the first row of the scan
    shape = pad.shape()
    assert (shape.active, tuple(shape.centroid_m)) == (4, pytest.approx(centre_m))
