"""From taxel readings to loads: tare, scale, threshold, rule, and what a wrong reading leaves unknown."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slipd.config import Config, Levels
from slipd.finger.finger import Finger
from slipd.finger.image_channel import ImageChannel
from slipd.fusion import Contact, contact_from_wrench
from slipd.samples import TactileSample

T0 = 100_000_000_000
Image = Callable[..., TactileSample]
Parse = Callable[[str], Config]

RAMP = np.arange(16.0).reshape(4, 4) * 10.0


@pytest.fixture
def make(left: str, parse: Parse) -> Callable[..., ImageChannel]:
    """A pad of 4×4 taxels at 4 mm, 0.01 N a count, threshold 0.05 N; ``more`` are further lines of its config."""

    def make(rule: str = "matched", more: str = "") -> ImageChannel:
        finger = parse(left + more).finger["left"]
        pad = finger.pad
        assert pad is not None
        return ImageChannel(pad, finger.model_copy(update={"load_rule": rule}))

    return make


def press(normal_n: float = 8.0, centroid_m: tuple[float, float] = (0.0, 0.0)) -> Contact:
    force = np.array((0.0, 0.0, -normal_n))
    return contact_from_wrench(force, np.cross((*centroid_m, 0.0), force))


def test_before_the_first_image_nothing_is_known(make: Callable[..., ImageChannel]) -> None:
    pad = make()
    assert pad.load_distribution(press()) is None
    assert pad.shape() is None
    assert pad.shows_contact() is None
    assert pad.wrench() is None


def test_counts_become_newtons_above_the_threshold(make: Callable[..., ImageChannel], image: Image) -> None:
    pad = make(more=f"tare = {[100.0] * 16}\n")
    counts = np.full(16, 100.0)
    counts[3], counts[4], counts[5], counts[6] = 300.0, 106.0, 105.0, 0.0
    pad.update(image(T0, counts))
    expected = np.zeros(16)
    expected[3], expected[4] = 2.0, 0.06
    assert pad.pressure == pytest.approx(expected)
    assert pad.shows_contact() is True
    assert pad.t_ns == T0


def test_an_image_below_the_threshold_shows_no_contact_and_gives_no_loads(
    make: Callable[..., ImageChannel], image: Image
) -> None:
    pad = make()
    pad.update(image(T0, np.full(16, 5.0)))
    assert pad.shows_contact() is False
    assert pad.load_distribution(press()) is None
    shape = pad.shape()
    assert shape is not None
    assert shape.active == 0


@pytest.mark.parametrize("rule", ["grey", "binary", "matched"])
def test_the_loads_carry_the_force_of_the_newest_reading(
    make: Callable[..., ImageChannel], image: Image, rule: str
) -> None:
    pad = make(rule)
    pad.update(image(T0, RAMP))
    for normal_n in (8.0, 2.0):
        found = pad.load_distribution(press(normal_n, (0.001, 0.001)))
        assert found is not None
        loads = found.loads.loads
        assert found.x.shape == found.y.shape == loads.shape == (15,), "the taxel without a reading carries nothing"
        assert loads.sum() == pytest.approx(1.0)
        assert (loads >= 0.0).all()


def test_the_rules_differ_in_what_they_believe(make: Callable[..., ImageChannel], image: Image) -> None:
    centroid = (0.001, 0.0005)
    told = {}
    for rule in ("grey", "binary", "matched"):
        pad = make(rule)
        pad.update(image(T0, RAMP))
        found = pad.load_distribution(press(8.0, centroid))
        assert found is not None
        loads = found.loads.loads
        told[rule] = (found.x @ loads, found.y @ loads), loads
    assert told["grey"][1] == pytest.approx(RAMP.ravel()[1:] / RAMP.sum())
    assert told["binary"][0] == pytest.approx(centroid, abs=1e-9)
    assert told["matched"][0] == pytest.approx(centroid, abs=1e-9)
    flat = make("binary")
    flat.update(image(T0, np.where(RAMP > 0.0, 100.0, 0.0)))
    unseen = flat.load_distribution(press(8.0, centroid))
    assert unseen is not None
    assert told["binary"][1] == pytest.approx(unseen.loads.loads), "it needs no pressures"
    assert told["matched"][1] != pytest.approx(unseen.loads.loads, rel=0.01)


def test_a_reading_that_is_no_number_makes_the_image_unknown(make: Callable[..., ImageChannel], image: Image) -> None:
    pad = make()
    pad.update(image(T0, RAMP))
    spoilt = RAMP.copy()
    spoilt[2, 2] = np.nan
    pad.update(image(T0 + 1, spoilt))
    assert pad.shows_contact() is None
    assert pad.load_distribution(press()) is None
    assert pad.shape() is None
    assert not pad.pressure.any()
    pad.update(image(T0 + 2, RAMP))
    assert pad.load_distribution(press()) is not None


def test_an_image_says_why_it_cannot_be_used(make: Callable[..., ImageChannel], image: Image) -> None:
    spoilt = RAMP.copy()
    spoilt[2, 2] = np.nan
    charge = make(more="charge_tau_s = 2.0\n")
    for pad, counts, status, reasons in (
        (make(), RAMP, (), ()),
        (make(), RAMP, ("saturated",), ()),
        (make(), RAMP, ("overload", "invalid"), ("invalid", "overload")),
        (make(), spoilt, ("invalid",), ("invalid", "not_finite")),
        (make(), 1e15 * RAMP, (), ("garbage",)),
        (make(more="gain_error = 0.1\n"), 1e9 * RAMP, (), ("garbage",)),
        (charge, RAMP, (), ("contact_unseen",)),
    ):
        assert pad.reasons == ("stale",)
        sample = image(T0, counts)
        sample.status = status
        pad.update(sample)
        assert pad.reasons == reasons
        assert (pad.shape() is not None) is not bool(reasons)
        pad.forget()
        assert pad.reasons == ("stale",)


def test_a_forgotten_image_is_unknown(make: Callable[..., ImageChannel], image: Image) -> None:
    pad = make()
    pad.update(image(T0, RAMP))
    pad.forget()
    assert (pad.t_ns, pad.shows_contact(), pad.load_distribution(press())) == (None, None, None)


def test_three_axis_taxels_are_a_force_sensor(right: str, parse: Parse) -> None:
    pad = Finger("right", parse(right).finger["right"], Levels()).image
    assert pad is not None
    assert pad.three_axis
    counts = np.full((4, 3), 1000.0)
    counts[1] += (200.0, -100.0, 3000.0)  # at (+2, −2) mm: 0.2 N and −0.1 N of shear, 3 N into the pad
    pad.update(TactileSample(T0, None, counts))
    wrench = pad.wrench()
    assert wrench is not None
    force, torque = wrench[:3], wrench[3:]
    assert force == pytest.approx((0.2, -0.1, -3.0))
    assert torque == pytest.approx(np.cross((0.002, -0.002, 0.0), force))
    assert pad.pressure == pytest.approx((0.0, 3.0, 0.0, 0.0))


def test_a_turned_three_axis_pad_turns_its_shear_with_its_rows(right: str, parse: Parse) -> None:
    config = parse(right.replace("pitch_m", "swap_xy = true\npitch_m"))
    pad = Finger("right", config.finger["right"], Levels()).image
    assert pad is not None
    counts = np.full((4, 3), 1000.0)
    counts[1] += (200.0, -100.0, 3000.0)
    pad.update(TactileSample(T0, None, counts))
    wrench = pad.wrench()
    assert wrench is not None
    assert wrench[:3] == pytest.approx((-0.1, 0.2, -3.0))
    assert wrench[3:] == pytest.approx(np.cross((-0.002, 0.002, 0.0), wrench[:3]))


def test_the_shape_is_told_in_the_frame_of_the_pad(make: Callable[..., ImageChannel], image: Image) -> None:
    counts = np.zeros((4, 4))
    counts[0, :] = 100.0  # the first row of the scan
    centres = {}
    for more in ("", "flip_y = true\n", "swap_xy = true\n"):
        pad = make(more=more)
        pad.update(image(T0, counts))
        shape = pad.shape()
        assert shape is not None
        assert shape.active == 4
        centres[more] = tuple(shape.centroid_m)
    assert centres[""] == pytest.approx((0.0, -0.006))
    assert centres["flip_y = true\n"] == pytest.approx((0.0, 0.006))
    assert centres["swap_xy = true\n"] == pytest.approx((-0.006, 0.0))
